"""python -m formingx as a user runs it."""

import os
import re
import subprocess
import sys

import numpy as np
import pytest
from conftest import ROOT, drawn, run

import formingx as fx
from formingx.__main__ import main


def table(file, header, *columns):
    file.write_text("\n".join([header, *(",".join(map(repr, row)) for row in np.column_stack(columns).tolist())]))
    return str(file)


@pytest.mark.thorough
def test_overview_lists_every_demo():
    text = run("-m", "formingx")
    assert "  treloar" in text and "Inflate Treloar's rubber sheet" in text
    assert "compare OURS THEIRS" in text and "common" not in text
    for file in (ROOT / "demos").glob("*.py"):               # what demos share has no main
        assert (f"\n  {file.stem} " in text) == ("def main" in file.read_text())


def test_a_closed_output_pipe_is_no_error():
    """`python -m formingx | head`"""
    there, end = os.pipe()
    os.close(there)
    with open(end, "wb") as closed:
        done = subprocess.run([sys.executable, "-m", "formingx"], stdout=closed, stderr=subprocess.PIPE, timeout=300)
    assert (done.returncode, done.stderr) == (0, b"")


@pytest.mark.thorough
def test_demo_runs_with_its_options(tmp_path):
    text = run("-m", "formingx", "demo", "treloar", "--quick", "--out", tmp_path)
    assert "limit pressure" in text and (tmp_path / "summary.json").exists()
    assert "--elements" in run("-m", "formingx", "demo", "treloar", "--help")


def test_compare(tmp_path, capsys):
    t = np.linspace(0, 3, 40)
    ours = table(tmp_path / "ours.csv", "pressure,pole_height", np.sin(t), t)
    theirs = table(tmp_path / "theirs.csv", "H [in],p [psi]", t / 2.54, np.sin(t) / 0.070306957964)
    out = tmp_path / "out"
    assert main(["compare", ours, theirs, "--columns", "pressure=p", "pole_height=H", "--units",
                 "pressure=0.070306957964", "pole_height=cm", "--out", str(out)]) == 0
    text = capsys.readouterr().out
    assert "40 of 40 points" in text and "1 ours" in text and "1 theirs" in text
    assert drawn(out / "curves.png") and len((out / "pairs.csv").read_text().splitlines()) == 41


@pytest.mark.parametrize("words, message", [
    (["demo"], "demo: needs a NAME; known: "),
    (["demo", "nothing"], "demo 'nothing' is not known; known: "),
    (["compare", "absent.csv", "absent.csv"], "'absent.csv' is not there"),
    (["compare", "OURS", "OURS", "--columns", "pressure", "travel"], "column 'travel' is not known; known: 'pressure'"),
    (["compare", "OURS", "OURS", "--units", "pressure"], "--units 'pressure': must be COLUMN=UNIT"),
    (["compare", "OURS", "OURS", "--units", "pressure=psi"], "does not state the unit of column 'pressure'"),
    (["compare", "OURS", "OURS", "--columns", "=p"], "--columns '=p': must be OURS=THEIRS"),
])
def test_errors_in_plain_words(tmp_path, capsys, words, message):
    ours = table(tmp_path / "ours.csv", "pressure,pole_height", [0.0, 1.0, 2.0], [0.0, 1.0, 4.0])
    assert main([ours if word == "OURS" else word for word in words]) == 2
    error = capsys.readouterr().err
    assert message in error and error.startswith("formingx: ") and "Traceback" not in error


SCENE = """import sys
import formingx as fx
print("options", sys.argv[1:])
sheet = fx.mesh.disc(radius=10.0, thickness=0.3, elements=(20, 1))
mould = fx.tools.cup(radius=10.0, depth=5.0, mouth=0.3, fillet=0.1)
scene = fx.Scene(mesh=sheet, materials=fx.NeoHookean(c10=1.0), supports=[fx.Symmetry("axis"), fx.Clamped("rim")],
                 loads=[fx.Pressure("bottom", name="air")], contacts=[fx.Contact("top", mould)])
"""
RUNS = {"trace": "fx.trace(scene, until=fx.pole_height(900.0))", "solve": "fx.solve(scene, to=1.0)",
        "process": "fx.Process(scene).run([fx.Stage('blow', control='air', until=fx.pole_height(900.0))])",
        "relaxing": "fx.Process(fx.Scene(mesh=sheet, materials=fx.Viscoelastic(fx.NeoHookean(c10=1.0), [(1.0, 1.0)]), "
                    "supports=scene.supports, loads=scene.loads, contacts=scene.contacts)).run([fx.Stage('blow', "
                    "control=scene.loads[0], until=fx.pole_height(900.0), speed=1.0)])",
        "study": "fx.study(lambda p: fx.trace(scene, until=fx.pressure(p)), {'p': [1, 2]}, {'p': 'pressure'})"}


@pytest.mark.parametrize("way", RUNS)
def test_check_looks_at_the_first_run(way, tmp_path, capsys):
    """The fillet is too small for the mesh, a target too far away; nothing is solved, whatever runs the scene."""
    (tmp_path / "script.py").write_text(SCENE + RUNS[way] + "\nprint('solved')\n")
    before = fx.trace, fx.solve, fx.study, fx.Process.run
    assert main(["check", str(tmp_path / "script.py"), "--fast"]) == 0
    assert (fx.trace, fx.solve, fx.study, fx.Process.run) == before
    text = capsys.readouterr().out
    assert "options ['--fast']" in text and "solved" not in text and "its fillet of radius 0.1" in text
    assert ("pole height = 900" in text) == (way in ("trace", "process", "relaxing"))


def test_check_of_no_scene(tmp_path, capsys):
    (tmp_path / "script.py").write_text("print(1)")
    assert main(["check", str(tmp_path / "script.py")]) == 2 == main(["check", str(tmp_path / "absent.py")])
    error = capsys.readouterr().err
    assert "script.py' runs no scene" in error and "absent.py' is not there" in error
    (tmp_path / "script.py").write_text("import formingx as fx\nfx.NeoHookean(c10=-1)")
    assert main(["check", str(tmp_path / "script.py")]) == 2 and "NeoHookean(c10=-1" in capsys.readouterr().err


@pytest.mark.parametrize("text, words", [
    (b"\x89PNG\r\n\x1a\n\0\0", "is no Python: "), (b"scene = (1,\nprint 2\n", "is no Python: .*, line "),
    (b"\0" * 9, "is no Python: "), (b"x = " + b"(" * 10_000, "is no Python: ")])
def test_check_of_a_file_that_is_not_python(text, words, tmp_path, capsys):
    (tmp_path / "script.py").write_bytes(text)
    assert main(["check", str(tmp_path / "script.py")]) == 2
    error = capsys.readouterr().err
    assert re.search(f"script.py' {words}", error) and len(error.splitlines()) == 1


@pytest.mark.thorough
def test_unknown_command():
    done = subprocess.run([sys.executable, "-m", "formingx", "fly"], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 2 and "invalid choice: 'fly'" in done.stderr and "Traceback" not in done.stderr
