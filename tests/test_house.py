"""The structure of the package: no import climbs from a lower room to a higher one, none goes in a circle."""

import ast

from conftest import ROOT

PACKAGE = ROOT / "formingx"
ROOMS = ["errors", "ranks", "_compat", "units", "io", "figures", "values", "mesh", "tools", "physics", "materials",
         "calibration", "exact", "scene", "discrete", "measures", "solve", "results", "heat"]
# what is not here is above them all
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
    climbs = {name_of(file): found for file in FILES if file != PACKAGE / "__init__.py"
              for found in imports(file) if level(found) > level(name_of(file))}
    assert climbs == {}


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


def test_what_is_private_stays_so():
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


TWO_BY_NATURE = {
    # ends of an edge, of a line, of pieces of them
    ("discrete.contact.taken_over", "rule.edges[(rule.edges == axis).any(1), :2]"),
    ("discrete.outline", "edges[:, :2]"), ("discrete.outline", "self._gathered(names)[:, :2]"),
    ("discrete.outline", "np.stack([chain[:, :-1], chain[:, 1:]], -1).reshape(-1, 2)"),
    ("discrete.outline", "np.unique(ends, return_inverse=True)[1].reshape(-1, 2)"),
    ("heat.layers", "grid.boundaries[face][:, :2]"), ("heat.layers", "grid.boundaries[name][:, :2]"),
    ("heat.result", "np.array(self._ends() if line is None else line, dtype=float).reshape(2, 2)"),
    ("scene.tool_width", "of_facets(mesh.domain, mesh.facets_of(contact.on))[:, :2]"),
    # lines and outlines of sections
    ("discrete.membrane", "ufl.as_vector([-t[1], t[0]])"), ("remeshing", "edges[:, [0, 2]].reshape(-1, 2)"),
    ("remeshing", "np.array(found).reshape(-1, 2)"),
    # in the plane of a section, of tensors with a hoop; in that of a sheet's lid; in a window
    ("results.evaluate.stress", "self.cauchy[:, :2, :2]"), ("results.files.shells", "points[:, :2]"),
    ("results.evaluate.stress", "self.deformation_gradient[:, :2, :2]"), ("results.show.views", "projected[:, :2]"),
    ("solve.linear", "range(2)"),                                                # attempts
}


def test_no_2_where_components_are_meant():
    """Above physics nothing writes a 2 for components or coordinates (`Kinematics`): listed is what is 2 by nature."""
    def two(node):
        return isinstance(node, ast.Constant) and node.value == 2

    def last(node):
        return node.elts[-1] if isinstance(node, ast.Tuple) and node.elts else node

    def written(node):
        if isinstance(node, ast.Subscript) and isinstance(node.slice, ast.Tuple):
            end = last(node.slice)
            return isinstance(end, ast.Slice) and end.lower is None and two(end.upper)
        if not isinstance(node, ast.Call) or not node.args:
            return False
        name = getattr(node.func, "attr", getattr(node.func, "id", ""))
        if name == "as_vector":
            return isinstance(node.args[0], ast.List) and len(node.args[0].elts) == 2 and not any(
                isinstance(entry, ast.Starred) for entry in node.args[0].elts)
        return (name == "reshape" and two(last(node.args[-1])) or len(node.args) == 1 and name in ("range", "Identity")
                and two(node.args[0]) or name in ("zeros", "empty", "ones", "full") and two(last(node.args[0])))
    found = {(name_of(file), ast.unparse(node)) for file in FILES if level(name_of(file)) >= ROOMS.index("scene")
             for node in ast.walk(ast.parse(file.read_text())) if written(node)}
    assert found == TWO_BY_NATURE


def test_protocols_say_what_they_take():
    """No argument or result of an interface is just anything, but what a history remembers and matplotlib gives."""
    memories = {"get", "put.memory", "save.memory", "load", "carry", "carry.memory", "carry.source"}
    found = set()
    for file in (file for file in FILES if name_of(file) != "figures"):
        for kind in (node for node in ast.walk(ast.parse(file.read_text())) if isinstance(node, ast.ClassDef)):
            if any(ast.unparse(base) == "Protocol" for base in kind.bases):
                for call in (node for node in kind.body if isinstance(node, ast.FunctionDef)):
                    said = {f"{call.name}.{arg.arg}": arg.annotation for arg in call.args.args}
                    said[call.name] = call.returns
                    found |= {(kind.name, name) for name, note in said.items() if getattr(note, "id", "") == "Any"}
    assert found <= {("History", name) for name in memories}
