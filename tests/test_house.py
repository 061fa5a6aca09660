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


def test_no_file_is_long():
    long = {name_of(file): n for file in FILES if (n := len(file.read_text().splitlines())) > 520}
    assert long == {}
