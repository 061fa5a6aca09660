"""python -m formingx as a user runs it."""

import subprocess
import sys

import numpy as np
import pytest
from conftest import ROOT, drawn, run

from formingx.__main__ import main


def table(file, header, *columns):
    file.write_text("\n".join([header, *(",".join(map(repr, row)) for row in np.column_stack(columns).tolist())]))
    return str(file)


def test_overview_lists_every_demo():
    text = run("-m", "formingx")
    assert "  treloar" in text and "Free inflation of Treloar's rubber sheet" in text
    assert "compare OURS THEIRS" in text and "common" not in text
    for file in (ROOT / "demos").glob("*.py"):               # what demos share has no main
        assert (f"\n  {file.stem} " in text) == ("def main" in file.read_text())


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
    (["compare", "absent.csv", "absent.csv"], "'absent.csv' cannot be read"),
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


def test_unknown_command():
    done = subprocess.run([sys.executable, "-m", "formingx", "fly"], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 2 and "invalid choice: 'fly'" in done.stderr and "Traceback" not in done.stderr
