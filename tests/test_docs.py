"""Every code block of the pages runs, one after the other, and prints what stands below it; Sphinx builds them all."""

import ast
import importlib
import pkgutil
import re
import shutil
import sys
from contextlib import nullcontext

import pytest
from conftest import ROOT, drawn, run
from PIL import Image, ImageChops, ImageStat
from printed import assert_shows

import formingx.exact
from formingx import findings

DOCS = ROOT / "docs"
MADE = {"_build", "notebooks"}
PAGES = [p for p in sorted(DOCS.rglob("*.md")) if not MADE & {*p.parts} and "```python" in p.read_text()]
NOTEBOOKS = sorted(DOCS.glob("notebooks/*.ipynb"))


@pytest.mark.thorough
@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.relative_to(DOCS).with_suffix("").as_posix())
def test_blocks_run(page, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(findings, "_registered", {at: [*checks] for at, checks in findings._registered.items()})
    monkeypatch.chdir(tmp_path)
    names: dict = {}
    for block, shown in re.findall(r"```python\n(.*?)```(?:\n\n```text\n(.*?)```)?", page.read_text(), re.S):
        exec(compile(block, page.name, "exec"), names)
        assert_shows(shown, capsys.readouterr().out)
    for name in re.findall(r"\]\(pictures/(\w+\.png)\)", page.read_text()):
        assert drawn(tmp_path / name) and (page.parent / "pictures" / name).is_file(), f"docs/run_page.py stores {name}"


@pytest.mark.thorough
def test_thumbnails_are_panels_of_the_pictures():
    sys.path.insert(0, str(DOCS))
    import make_thumbnails
    found = {file.stem for file in make_thumbnails.THUMBNAILS.iterdir()}
    shown = set(re.findall(r"\(thumbnails/(\w+)\.png\)", (DOCS / "gallery.md").read_text()))
    assert found == shown == {*make_thumbnails.PANELS}
    for name in found:
        with Image.open(make_thumbnails.THUMBNAILS / f"{name}.png") as stored:
            off = ImageChops.difference(stored.convert("RGB"), make_thumbnails.panel(name))
        assert max(ImageStat.Stat(off).mean) < 1.5, f"run docs/make_thumbnails.py: {name}"


@pytest.mark.thorough
def test_pictures_of_pages_are_all_shown():
    for folder in DOCS.glob("*/pictures"):
        pages = "".join(page.read_text() for page in folder.parent.glob("*.md"))
        assert {*re.findall(r"pictures/(\w+\.png)", pages)} == {file.name for file in folder.iterdir()}


@pytest.mark.parametrize("shown, printed, same", [
    ("force 1.23 N", "force 1.2345 N", True), ("force 1.23 N", "force 1.2501 N", False), ("1.5e-06", "1.59e-06", True),
    ("force 1 N", "force  1\nN", True), ("force 1 N", "forces 1 N", False), ("", "1", False),
    ("2 runs, ... s", "2 runs, 7 s", True),
    ("a ... 1\n... 2", "a 0 1\n1 2", True), ("a ... b ... c", "a c b", False), ("x ... " * 9 + "y", "x " * 300, False),
    ("2 runs, ... s", "3 runs, 7 s", False), ("[1. 2.]", "[1. 2. 3.]", False), ("-1.5", "1.5", False)])
def test_printed_output_is_compared_to_the_shown_digits(shown, printed, same):
    with nullcontext() if same else pytest.raises(AssertionError):
        assert_shows(shown, printed)


@pytest.mark.thorough
@pytest.mark.skipif(shutil.which("ffmpeg") is None, reason="no ffmpeg")
@pytest.mark.parametrize("file", NOTEBOOKS, ids=lambda p: p.stem)
def test_notebook(file, tmp_path):
    """It runs, and shows what it holds: the same words and numbers, and things of the same kinds."""
    nbformat, nbclient = pytest.importorskip("nbformat"), pytest.importorskip("nbclient")
    held = nbformat.read(file, as_version=4)
    run = nbclient.NotebookClient(nbformat.from_dict(held), resources={"metadata": {"path": tmp_path}}).execute()
    shown = 0
    for one, other in zip(held.cells, run.cells, strict=True):
        for a, b in zip(one.get("outputs", []), other.get("outputs", []), strict=True):
            kinds = set(a.get("data", {}))
            assert kinds == set(b.get("data", {}))
            shown += len(kinds - {"text/plain"})
            if kinds <= {"text/plain"}:
                assert_shows(*(o.get("text") or o["data"]["text/plain"] for o in (a, b)))
    assert shown == 4


def test_messages_are_quoted_as_they_are():
    """Phrases of the tables of errors.md, but those of the first, which are Python's own, are said by the package."""
    nodes = (node for file in (ROOT / "formingx").rglob("*.py") for node in ast.walk(ast.parse(file.read_text()))
             if isinstance(node, ast.JoinedStr | ast.Constant))
    said = "\n".join("".join(str(part.value) for part in getattr(node, "values", [node])
                             if isinstance(part, ast.Constant)) for node in nodes)
    tables = (DOCS / "errors.md").read_text().split("the message says |")[2:]
    rows = [row for table in tables for row in table.splitlines() if row.startswith("| ") and row.endswith(" |")]
    quoted = [re.sub(r"\(.*?\)", "", row.split(" | ")[0][2:]) for row in rows]
    parts = {part.strip(" .|`") for one in quoted for part in re.split(r"\.\.\.|, |: |=", one)}
    assert len(parts) > 80 and not sorted(part for part in parts if part not in said)


@pytest.mark.thorough
def test_every_demo_is_in_the_gallery():
    """With a picture, a line and its command; the pictures are there, and its script is where the links lead."""
    rows = [[cell.strip() for cell in line.strip().strip("|").split("|")]
            for line in (DOCS / "gallery.md").read_text().splitlines() if line.startswith("| [")]
    found = {}
    for pictures, lines in zip(rows[::2], rows[1::2], strict=True):
        for picture, line in zip(filter(None, pictures), filter(None, lines), strict=True):
            file, script = re.fullmatch(r"\[!\[[^]]+\]\((.+\.png)\)\]\((.+)\)", picture).groups()
            name, linked, command = re.fullmatch(r"\[(\w+)\]\((.+?)\): .+ <br> `(.+)`", line).groups()
            assert (DOCS / file).is_file() and script == linked == f"../demos/{name}.py"
            assert command == f"./fx python3 demos/{name}.py"
            found[name] = DOCS / linked
    demos = {f.stem: f for f in (ROOT / "demos").glob("*.py") if "\ndef main(" in f.read_text()}
    assert sorted(found) == sorted(demos) and all(f.is_file() for f in found.values())


@pytest.mark.thorough
@pytest.mark.quick
def test_sphinx_warns_of_nothing(tmp_path):
    run("-m", "sphinx", "-W", "--keep-going", "-q", "docs", tmp_path / "html")
    page = (tmp_path / "html" / "api.html").read_text()
    exact = [importlib.import_module(m.name) for m in pkgutil.iter_modules(formingx.exact.__path__, "formingx.exact.")]
    assert [name for room in exact for name, thing in vars(room).items() if not name.startswith("_")
            and callable(thing) and getattr(thing, "__module__", "") == room.__name__
            and f'id="{room.__name__}.{name}"' not in page] == []
    assert [name for name, thing in public().items() if not any(
        f'id="{place}"' in page for place in (f"formingx.{name}", f"{thing.__module__}.{thing.__qualname__}"))] == []

    assert [f"{base}.{member}" for base, member in inherited() if f'.{base}.{member}"' not in page] == []


def test_public_names_are_documented():
    assert all(thing.__doc__ for thing in public().values())


def public():
    """{name: class or function} of `formingx` itself, and of its rooms that scripts call by name."""
    import formingx as fx
    rooms = {"": fx, "mesh.": fx.mesh, "tools.": fx.tools}
    return {prefix + name: getattr(room, name) for prefix, room in rooms.items() for name in dir(room)
            if not name.startswith("_") and callable(getattr(room, name)) and (room is fx or not hasattr(fx, name))}


def inherited():
    """[(class, method or property)] that public classes inherit from classes of the package."""
    bases = {base for thing in public().values() for base in getattr(thing, "__mro__", ())[1:]
             if base.__module__.startswith("formingx") and not base.__name__.startswith("_")
             and base.__name__ not in {"Kinematics", "Model", "RunExtension"}}      # these are not for users
    return [(base.__qualname__, member) for base in bases for member, value in vars(base).items()
            if not member.startswith("_") and (callable(value) or isinstance(value, property))]


def test_one_version():
    """In the package, the citation, the changelog and the pages."""
    import formingx as fx
    for file, line in (("CITATION.cff", f"version: {fx.__version__}"), ("CHANGELOG.md", f"## {fx.__version__}")):
        assert re.search(rf"^{re.escape(line)}\b", (ROOT / file).read_text(), re.M), file
    assert re.search(r'^version = \{ attr = "formingx.__version__" \}', (ROOT / "pyproject.toml").read_text(), re.M)
