"""The page validation.md is what its script writes from stored numbers, and those are what the code gives today."""

import json
import sys

import pytest
from conftest import ROOT, run

sys.path[:0] = [str(ROOT / "demos"), str(ROOT / "benchmarks"), str(ROOT / "docs")]
import compression_roll_over  # noqa: E402
import make_validation  # noqa: E402
import thick_cylinder  # noqa: E402
import treloar_mesh  # noqa: E402
from all_demos import differs  # noqa: E402
from validation_rows import Row  # noqa: E402

import formingx as fx  # noqa: E402

TEMPLATE, STORED = make_validation.TEMPLATE.read_text(), json.loads(make_validation.STORED.read_text())


def test_page_is_what_the_script_writes():
    assert make_validation.PAGE.read_text() == make_validation.page(TEMPLATE, STORED), \
        "run docs/make_validation.py: the page, its template, its rows or the stored numbers have changed"


def test_stored_numbers_are_those_of_the_page():
    """None is missing, none is left over."""
    assert sorted(STORED) == sorted(set(make_validation.paths(TEMPLATE)))


def test_scripts_of_all_numbers_are_there():
    names = {path.split("/")[0] for path in STORED}
    assert all((ROOT / "demos" / f"{n}.py").is_file() or (ROOT / "benchmarks" / f"{n}.py").is_file() for n in names)


def test_a_page_from_summaries(tmp_path, monkeypatch):
    """Numbers, quotients and deviations of summaries; a number that is nowhere is named."""
    rows = [Row("pressure", "run/a/p", 2.0, "a book", "MPa", ".3f"),
            Row("error", "run/list/1", 0.0, "theory", style=".1e", absolute=True),
            Row("ratio", "run/a/p OVER run/a/q", "run/a/q", "exact"),
            Row("near", "run/a/q", lambda: 2.0 * (1 - 1e-5), "x"),
            Row("alone", "run/a/q", None, "a figure", note="undecided")]
    monkeypatch.setattr(make_validation, "TABLES", {"all": rows})
    template = "{{run/a/p .2f}} {{run/a/p OVER run/a/q +.1%}} {{run/none d}}\n\n{{TABLE all}}\n"
    (tmp_path / "run").mkdir()
    summary = {"a": {"p": 2.2, "q": 2.0}, "list": [1, -1e-3], "none": None}
    (tmp_path / "run" / "summary.json").write_text(json.dumps(summary))
    wanted = set(make_validation.paths(template))
    numbers = make_validation.collect(tmp_path, wanted, {})
    text = make_validation.page(template, numbers).splitlines()
    assert text[1] == "2.20 +10.0 % none"
    assert [line.split(" | ")[1:4] for line in text[5:]] == [
        ["2.200 MPa", "2.000 MPa", "+10.0 %"], ["-1.0e-03", "0", "-1.0e-03"], ["1.1", "2", "-45.0 %"],
        ["2", "2", "+1.0e-05"], ["2", "", "undecided"]]
    assert make_validation.collect(tmp_path / "no", wanted, numbers) == numbers
    with pytest.raises(KeyError, match="no number for run/a/p"):
        make_validation.collect(tmp_path / "no", wanted, {})


def test_paragraphs_are_filled():
    """Items keep their marks, tables and headings their lines."""
    text = "# A heading\n\nOne two\nthree.\n\n* An item\n  of two lines\n* more\n\n| a |\n|---|\n| " + "b " * 99 + "|"
    lines = make_validation.wrapped(text + "\n\n" + "word " * 60).splitlines()
    assert lines[:6] == ["# A heading", "", "One two three.", "", "* An item of two lines", "* more"]
    assert lines[7:9] == ["| a |", "|---|"] and len(lines[9]) > 200
    assert all(len(line) <= make_validation.WIDTH for line in lines[10:]) and len(lines) == 14


@pytest.mark.parametrize("elements", [(20, 1), pytest.param((40, 2), marks=pytest.mark.slow)])
def test_treloar(elements):
    found = treloar_mesh.pressures(elements, fx.SimplySupported("rim"))
    name = f"treloar_mesh/simply supported {elements[0]}x{elements[1]}"
    assert found["limit"] == pytest.approx(STORED[f"{name}/limit"], rel=1e-6)
    assert found["at"] == pytest.approx([STORED[f"{name}/at/{k}"] for k in range(7)], rel=2e-5)
    assert (found["steps"], found["iterations"]) == (STORED[f"{name}/steps"], STORED[f"{name}/iterations"])


def test_thick_cylinder_and_sphere():
    def stored(kind, key):
        return STORED[f"thick_cylinder/{kind}/{key}"]
    path, targets = thick_cylinder.inflate("tube", thick_cylinder.wall("tube", 16))
    for at in ("10", "30", "50"):
        key = f"pressure_MPa_at_inner_displacement_cm/{at}"
        found = path.met(targets[at]).measures["pressure"] * thick_cylinder.PSI
        assert found == pytest.approx(stored("cylinder", key), rel=1e-7)
        exact = thick_cylinder.exact("tube", at).pressure * thick_cylinder.PSI
        assert exact == pytest.approx(stored("cylinder", f"exact_{key}"), rel=1e-7)
    path, targets = thick_cylinder.inflate("sphere", thick_cylinder.wall("sphere", 16))
    limit = path.limit_points[0]
    assert limit.measures["pressure"] * thick_cylinder.PSI == pytest.approx(
        stored("sphere", "limit_pressure_MPa"), rel=1e-7)
    assert path.value(targets["50"].bind(path.problem), limit) * thick_cylinder.INCH == pytest.approx(
        stored("sphere", "inner_displacement_cm_at_limit"), rel=1e-4)


def check_roll_over(elements):
    name = f"compression_roll_over/grids/{elements[0]}x{elements[1]}/force_N_at_ratio"
    _, met, end = compression_roll_over.compress(elements)
    stored = {path.removeprefix(f"{name}/"): value for path, value in STORED.items() if path.startswith(f"{name}/")}
    assert end == "done"
    found = {ratio: compression_roll_over.force(state) for ratio, state in met.items()}
    assert found == pytest.approx(stored, rel=2e-5)


def test_roll_over():
    check_roll_over((8, 4))


@pytest.mark.slow
@pytest.mark.parametrize("elements", compression_roll_over.GRIDS[1:])
def test_roll_over_on_finer_grids(elements):
    check_roll_over(elements)


@pytest.mark.slow
@pytest.mark.parametrize("demo", ["clamp_ring", "compression_homogeneous", "measured_ellipse", "other_programs",
                                  "plug_stress", "thick_plate", "treloar", "two_layer"])
def test_stored_numbers_are_those_of_today(demo, tmp_path):
    run(f"demos/{demo}.py", "--out", tmp_path)
    summary = json.loads((tmp_path / "summary.json").read_text())
    stored = {path: value for path, value in STORED.items() if path.startswith(f"{demo}/")}
    today = {path: make_validation.found(summary, path.partition("/")[2]) for path in stored}
    assert today and not {path: (stored[path], now) for path, now in today.items()
                          if differs(path, stored[path], now, 1e-3)}
