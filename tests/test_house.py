"""The structure of the package: the order of folders in imports, without circles; length of files, names of classes."""

import ast
import functools
import inspect
import io
import pkgutil
import re
import subprocess
import sys
import tokenize
from collections import Counter

import pytest
from conftest import ROOT

import formingx as fx

PACKAGE = ROOT / "formingx"
ROOMS = ["_interrupts", "errors", "ranks", "findings", "_jit", "_compat", "units", "io", "figures", "values", "mesh",
         "tools", "physics", "materials", "scene", "forms", "contact", "problem", "measures", "solve", "results"]
# a room that is not listed is above them all
EXTENSIONS = {"contact_events", "heat", "space", "stability", "design", "remeshing", "kbkz", "fits", "release",
              "compare", "study", "adapt"}
FILES = sorted(PACKAGE.rglob("*.py"))


def name_of(file):
    parts = file.relative_to(PACKAGE).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


MODULES = {name_of(file): file for file in FILES}


@functools.cache
def tree_of(file):
    """Syntax tree of a file."""
    return ast.parse(file.read_text())


@functools.cache
def imports(file):
    """Modules of the package that a file imports, inside functions too."""
    return list(_imports(file))


def _imports(file):
    here = name_of(file).split(".") if name_of(file) else []
    package = here if file.name == "__init__.py" else here[:-1]
    for node in ast.walk(tree_of(file)):
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
    found = {(name_of(file), alias.name) for file in FILES for node in ast.walk(tree_of(file))
             if isinstance(node, ast.ImportFrom) and node.level and node.module for alias in node.names
             if alias.name.startswith("_")}
    assert found == set()


def code_lines(file):
    """Number of lines with a token that is no comment or docstring."""
    said = {n for node in ast.walk(tree_of(file)) if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)
            and isinstance(node.value.value, str) for n in range(node.lineno, node.end_lineno + 1)}
    blank = {tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT, tokenize.ENDMARKER}
    return len({n for token in tokenize.generate_tokens(io.StringIO(file.read_text()).readline)
                if token.type not in blank for n in range(token.start[0], token.end[0] + 1)} - said)


def test_no_file_has_many_lines_of_code():
    assert {name_of(file): n for file in FILES if (n := code_lines(file)) > 450} == {}


def test_no_class_name_is_defined_twice():
    names = Counter(node.name for file in FILES for node in ast.walk(tree_of(file)) if isinstance(node, ast.ClassDef))
    assert {name for name, n in names.items() if n > 1} == set()


ALSO_MET = {"LoadedBody", "Face", "Diagnosis", "RigidTool", "PlaneTool"}     # met as arguments


def met_by_users():
    """(module, qualified name) of all that users meet: of `fx`, pages, members of these classes, what they return."""
    pages = "".join(page.read_text() for page in (ROOT / "docs").rglob("*.md"))
    names = re.findall(r":: (formingx\.[\w.]+)", pages) + [f"{module}.{name}" for module, several in re.findall(
        r"from (formingx[\w.]*) import ([\w, ]+)", pages) for name in several.replace(" ", "").split(",")]
    todo = [fx, fx.mesh, fx.tools, *map(pkgutil.resolve_name, names)]
    classes = {thing.__name__: thing for name, module in sys.modules.items() if name.startswith("formingx")
               for thing in vars(module).values() if isinstance(thing, type)}
    todo += map(classes.get, ALSO_MET)
    met = set()
    while todo:
        thing = todo.pop()
        for wrapper in ("__func__", "fget", "func"):
            thing = getattr(thing, wrapper, None) or thing
        thing = inspect.unwrap(thing) if callable(thing) else thing
        if inspect.ismodule(thing):
            todo += [v for n, v in vars(thing).items() if n[0] != "_" and not inspect.ismodule(v) and (
                thing in (fx, fx.mesh, fx.tools) or getattr(v, "__module__", "") == thing.__name__)]
        key = getattr(thing, "__module__", None) or "", getattr(thing, "__qualname__", "")
        if not key[0].startswith("formingx") or key in met or not callable(thing):
            continue
        met.add(key)
        said = [getattr(thing, "__annotations__", {}).get("return", "")]
        if isinstance(thing, type):
            todo += [*thing.__mro__, *(v for n, v in vars(thing).items()
                                       if (n[0] != "_" or n[:2] == "__") and not isinstance(v, type))]
            said = [t for n, t in vars(thing).get("__annotations__", {}).items() if n[0] != "_"]
        todo += [classes[n] for n in re.findall(r"\w+", str(said)) if n[0] != "_" and n in classes
                 and not classes[n].__module__.startswith(CORE)]
    return met


CORE = tuple(f"formingx.{room}" for room in ("solve", "contact", "forms", "problem", "extensions.contact_events"))


def test_docstrings_of_internals_are_short():
    """At most 7 lines of text, no more than of code, but for equations and interfaces; no sections of arguments."""
    met, long = met_by_users(), set()

    def visit(file, node, owner, prefix):
        for n in ast.iter_child_nodes(node):
            if isinstance(n, ast.FunctionDef) and (said := ast.get_docstring(n, clean=False)) is not None:
                text = sum(bool(line.strip()) for line in said.split("\n"))
                code = n.end_lineno - min([n.lineno, *(d.lineno for d in n.decorator_list)]) - said.count("\n")
                interface = "Protocol" in owner or "abstract" in ast.dump(n) or "NotImplementedError" in ast.dump(n)
                if (f"formingx.{name_of(file)}", prefix + n.name) not in met and (
                        re.search(r"^ *(Args|Returns|Raises):$", said, re.M) or not interface
                        and ".. math" not in said and text > min(7, code)):
                    long.add((name_of(file), prefix + n.name))
            named = isinstance(n, ast.ClassDef | ast.FunctionDef)
            bases = [n.name, *(getattr(b, "id", "") for b in n.bases)] if isinstance(n, ast.ClassDef) else owner
            visit(file, n, bases, f"{prefix}{n.name}." if named else prefix)
    for file in FILES:
        visit(file, tree_of(file), [], "")
    assert long == set()


def members():
    """{name of a member of `Equations`: members of its own interface, {} if it has none}; see `solve/equations.py`."""
    classes = {node.name: node for node in tree_of(PACKAGE / "solve" / "equations.py").body
               if isinstance(node, ast.ClassDef)}

    def named(name):
        return {getattr(n, "name", None) or n.target.id: n for n in classes[name].body
                if isinstance(n, ast.FunctionDef | ast.AnnAssign)}
    return {name: set(named(n.returns.id)) if getattr(getattr(n, "returns", None), "id", None) in classes else set()
            for name, n in named("Equations").items()}


def test_the_solver_sees_equations_alone():
    """No UFL, no forms and no scene; of what is called problem or equations nothing but members of `Equations`."""
    allowed, found, seen = members(), set(), set()
    for file in (PACKAGE / "solve").glob("*.py"):
        for node in ast.walk(tree_of(file)):
            if isinstance(node, ast.Import) and any(a.name.split(".")[0] == "ufl" for a in node.names):
                found.add((file.name, "ufl"))
            if (isinstance(node, ast.arg) and node.arg in ("problem", "equations")
                    and getattr(node.annotation, "id", None) in ("Any", None)):
                found.add((file.name, node.arg, "Any"))
            if not isinstance(node, ast.Attribute):
                continue
            owner = getattr(node.value, "attr", getattr(node.value, "id", None))
            if owner in ("problem", "_problem", "equations"):
                seen.add(node.attr)
            of_part = isinstance(node.value, ast.Attribute) and getattr(
                node.value.value, "attr", getattr(node.value.value, "id", None)) in ("problem", "_problem", "equations")
            if node.attr == "forms" or of_part and allowed.get(owner) and node.attr not in allowed[owner]:
                found.add((file.name, node.attr))
    assert found == set() and seen <= set(allowed) and len(allowed) <= 20


@pytest.mark.thorough
@pytest.mark.parametrize("friction, most", [
    ("stick", (275, 39, 770)), ("0.3", (277, 39, 768)), ("free", (138, 32, 218))])
def test_a_step_passes_few_functions_and_files(friction, most):
    """Functions, files and calls from file to file in a median step; these limits only fall."""
    said = subprocess.run([sys.executable, ROOT / "benchmarks" / "follow.py", friction], capture_output=True, text=True,
                          check=True).stdout
    found = [int(n) for n in re.findall(r"\d+", said.split("median step:")[1])]
    assert all(n <= limit for n, limit in zip(found, most, strict=True)), found
