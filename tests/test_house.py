"""The structure of the package: the order of folders in imports, without circles, and rules for all files."""

import ast

from conftest import ROOT

PACKAGE = ROOT / "formingx"
ROOMS = ["errors", "ranks", "findings", "_jit", "_compat", "units", "io", "figures", "values", "mesh", "tools",
         "physics", "materials", "scene", "forms", "contact", "problem", "measures", "solve", "results"]
# a room that is not listed is above them all
EXTENSIONS = {"contact_events", "heat", "space", "stability", "design", "remeshing", "kbkz", "fits", "release",
              "compare", "study", "adapt"}
FILES = sorted(PACKAGE.rglob("*.py"))


def name_of(file):
    parts = file.relative_to(PACKAGE).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


MODULES = {name_of(file): file for file in FILES}


def imports(file):
    """Modules of the package that a file imports, inside functions too."""
    here = name_of(file).split(".") if name_of(file) else []
    package = here if file.name == "__init__.py" else here[:-1]
    for node in ast.walk(ast.parse(file.read_text())):
        if isinstance(node, ast.ImportFrom) and node.level:
            base = package[:len(package) - node.level + 1] + (node.module.split(".") if node.module else [])
            for alias in node.names:
                full = ".".join([*base, alias.name])
                yield full if full in MODULES else ".".join(base)


def level(module):
    room = module.split(".")[0]
    return ROOMS.index(room) if room in ROOMS else len(ROOMS)


def test_no_import_climbs():
    """Within the core and its readers; test_core_and_readers_import_no_extension looks at extensions."""
    climbs = {(name_of(file), found) for file in FILES if file != PACKAGE / "__init__.py"
              for found in imports(file) if level(found) > level(name_of(file)) and not found.startswith("extensions.")}
    assert climbs == set()


def test_extensions_are_all_known():
    assert {file.parent.name for file in (PACKAGE / "extensions").glob("*/__init__.py")} == EXTENSIONS


def test_core_and_readers_import_no_extension():
    """Only `formingx/__init__` names extensions."""
    files = [file for file in FILES if file != PACKAGE / "__init__.py" and not name_of(file).startswith("extensions")]
    arrows = {(name_of(file), found) for file in files for found in imports(file) if found.startswith("extensions.")}
    assert arrows == set()


def test_no_circle():
    arrows = {name: {found for found in imports(file) if found != name} for name, file in MODULES.items() if name}
    state = {}

    def visit(name, trail):
        assert state.get(name) != "open", " -> ".join([*trail, name])
        if name not in state:
            state[name] = "open"
            for found in sorted(arrows.get(name, ())):
                visit(found, [*trail, name])
            state[name] = "done"
    for name in arrows:
        visit(name, [])


def test_private_names_are_not_imported():
    """No file imports a name from another that begins with an underscore (the modules that do are not names)."""
    found = {(name_of(file), alias.name) for file in FILES for node in ast.walk(ast.parse(file.read_text()))
             if isinstance(node, ast.ImportFrom) and node.level and node.module for alias in node.names
             if alias.name.startswith("_")}
    assert found == set()


def test_no_file_is_long():
    long = {name_of(file): n for file in FILES if (n := len(file.read_text().splitlines())) > 450}
    assert long == {}


def test_tuned_numbers_have_a_name_each():
    """No module begins with a tuple of numbers: each has a line and a word of its own, or is a field of a dataclass.

    Those of the solver are all fields; any other is said what it is, on its line or the next.
    """
    codes = {"physics.supports", "solve.linear", "solve.predictor"}     # indices, counts
    tops = [(name_of(file), node) for file in FILES for node in ast.parse(file.read_text()).body]
    found = {(name, ast.unparse(node.targets[0])) for name, node in tops
             if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Tuple) and name not in codes
             and isinstance(node.value, ast.Tuple) and all(isinstance(n, ast.Constant | ast.UnaryOp) and isinstance(
                 ast.literal_eval(n), int | float) for n in node.value.elts)}
    found |= {(name, ast.unparse(node.targets[0])) for name, node in tops if name.startswith("solve.")
              and isinstance(node, ast.Assign) and isinstance(node.value, ast.Constant)
              and isinstance(node.value.value, int | float) and ast.unparse(node.targets[0]) != "SAME_TIME"}
    for file in FILES:
        lines, body = file.read_text().splitlines(), ast.parse(file.read_text()).body
        for node, following in zip(body, [*body[1:], None]):
            said = "#" in lines[node.lineno - 1] or isinstance(following, ast.Expr)
            if (isinstance(node, ast.Assign) and isinstance(node.value, ast.Constant) and not said
                    and isinstance(node.value.value, int | float)):
                found.add((name_of(file), ast.unparse(node.targets[0])))
    assert found == set()


GIVEN = {"STEFAN_BOLTZMANN", "GAS_CONSTANT", "_PSI", "_KG_PER_CM2", "FORMAT", "_LONGEST", "COORDINATES", "components",
         "dimension_of_volume", "quadrature_degree", "_DENSITY_OF_OSMIUM", "_power", "_STRESS_ORDER", "DIGITS",
         "PRINTED_ROWS"}
"""Constants of physics (the densest material), formats (digits and rows of output), dimensions and powers of a law, and
the order of the stress of quadratic elements: they are not tuned."""


def is_number(node):
    node = node.operand if isinstance(node, ast.UnaryOp) else node
    return isinstance(node, ast.Constant) and type(node.value) in (int, float) and node.value != 0


def test_the_count_of_tuned_numbers_only_falls():
    """Numbers with a name: constants of modules, and defaults of fields (also those of users) that are not zero."""
    found = []
    for file in FILES:
        tops = ast.parse(file.read_text()).body
        classes = [node for node in tops if isinstance(node, ast.ClassDef)
                   and not any("Enum" in ast.unparse(base) for base in node.bases)]
        fields = [line for node in classes for line in node.body]
        for line in (line for line in (*tops, *fields) if isinstance(line, ast.Assign | ast.AnnAssign)):
            name = ast.unparse(line.targets[0] if isinstance(line, ast.Assign) else line.target)
            values = line.value.elts if isinstance(line.value, ast.Tuple) else [line.value]
            if name not in GIVEN and values and all(map(is_number, values)):
                found += [(name_of(file), name)] * len(values)
    assert len(found) <= 270


def members(tree):
    """Names in the class bodies of `solve/equations.py`."""
    return {getattr(n, "name", None) or n.target.id for c in ast.walk(tree) if isinstance(c, ast.ClassDef)
            for n in c.body if isinstance(n, (ast.FunctionDef, ast.AnnAssign))}


def test_the_solver_sees_equations_alone():
    """No UFL, no forms and no scene; of what is called problem or equations nothing but members of `Equations`."""
    allowed = members(ast.parse((PACKAGE / "solve" / "equations.py").read_text()))
    found = set()
    for file in (PACKAGE / "solve").glob("*.py"):
        tree = ast.parse(file.read_text())
        for node in ast.walk(tree):
            if isinstance(node, ast.Import) and any(a.name.split(".")[0] == "ufl" for a in node.names):
                found.add((file.name, "ufl"))
            if (isinstance(node, ast.arg) and node.arg in ("problem", "equations")
                    and getattr(node.annotation, "id", None) in ("Any", None)):
                found.add((file.name, node.arg, "Any"))
            if isinstance(node, ast.Attribute):
                owner = getattr(node.value, "attr", getattr(node.value, "id", None))
                if node.attr == "forms" or owner in ("problem", "_problem", "equations") and node.attr not in allowed:
                    found.add((file.name, node.attr))
    assert found == set()


def test_protocols_have_types_for_all_arguments():
    """No argument or result of an interface is just anything, but the history variables and matplotlib's objects."""
    histories = {"get", "put.variables", "save.variables", "load", "transfer", "transfer.variables", "transfer.source"}
    found = set()
    for file in (file for file in FILES if name_of(file) != "figures"):
        for kind in (node for node in ast.walk(ast.parse(file.read_text())) if isinstance(node, ast.ClassDef)):
            if any(ast.unparse(base) == "Protocol" for base in kind.bases):
                for call in (node for node in kind.body if isinstance(node, ast.FunctionDef)):
                    said = {f"{call.name}.{arg.arg}": arg.annotation for arg in call.args.args}
                    said[call.name] = call.returns
                    found |= {(kind.name, name) for name, note in said.items() if getattr(note, "id", "") == "Any"}
    assert found <= {("History", name) for name in histories}
