"""Pages with templates are what their script writes from stored numbers; those are what the code gives today."""

import json
import sys

import pytest
from conftest import ROOT, run

sys.path[:0] = [str(ROOT / "demos"), str(ROOT / "benchmarks"), str(ROOT / "docs")]
import compression_roll_over  # noqa: E402
import kbkz_branches  # noqa: E402
import make_pages  # noqa: E402
import thick_cylinder  # noqa: E402
import treloar_mesh  # noqa: E402
from all_demos import differs  # noqa: E402
from validation_rows import Row  # noqa: E402

import formingx as fx  # noqa: E402

pytestmark = pytest.mark.thorough

STORED = json.loads(make_pages.STORED.read_text())


@pytest.mark.parametrize("name", make_pages.TEMPLATES)
def test_page_is_what_the_script_writes(name):
    template = make_pages.TEMPLATES[name].read_text()
    assert (make_pages.DOCS / f"{name}.md").read_text() == make_pages.page(name, template, STORED), \
        "run docs/make_pages.py: the page, its template, its rows or the stored numbers have changed"


def test_stored_numbers_are_those_of_the_pages():
    """None is missing, none is left over."""
    assert sorted(STORED) == sorted(make_pages.wanted())


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
    monkeypatch.setattr(make_pages, "TABLES", {"all": rows})
    template = "{{run/a/p .2f}} {{run/a/p OVER run/a/q +.1%}} {{run/none d}}\n\n{{TABLE all}}\n"
    (tmp_path / "run").mkdir()
    summary = {"a": {"p": 2.2, "q": 2.0}, "list": [1, -1e-3], "none": None}
    (tmp_path / "run" / "summary.json").write_text(json.dumps(summary))
    wanted = set(make_pages.paths(template))
    numbers = make_pages.collect(tmp_path, wanted, {})
    text = make_pages.page("validation", template, numbers).splitlines()
    assert text[1] == "2.20 +10.0 % none"
    assert [line.split(" | ")[1:4] for line in text[5:]] == [
        ["2.200 MPa", "2.000 MPa", "+10.0 %"], ["-1.0e-03", "0", "-1.0e-03"], ["1.1", "2", "-45.0 %"],
        ["2", "2", "+1.0e-05"], ["2", "", "undecided"]]
    assert make_pages.collect(tmp_path / "no", wanted, numbers) == numbers
    with pytest.raises(KeyError, match="no number for run/a/p"):
        make_pages.collect(tmp_path / "no", wanted, {})


def test_paragraphs_are_filled():
    """Items keep their marks, tables and headings their lines."""
    text = "# A heading\n\nOne two\nthree.\n\n* An item\n  of two lines\n* more\n\n| a |\n|---|\n| " + "b " * 99 + "|"
    lines = make_pages.wrapped(text + "\n\n" + "word " * 60).splitlines()
    assert lines[:6] == ["# A heading", "", "One two three.", "", "* An item of two lines", "* more"]
    assert lines[7:9] == ["| a |", "|---|"] and len(lines[9]) > 200
    assert all(len(line) <= make_pages.WIDTH for line in lines[10:]) and len(lines) == 14


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
        found = path.target_state(targets[at]).measures["pressure"] * thick_cylinder.PSI
        assert found == pytest.approx(stored("cylinder", key), rel=1e-7)
        exact = thick_cylinder.exact("tube", at).pressure * thick_cylinder.PSI
        assert exact == pytest.approx(stored("cylinder", f"exact_{key}"), rel=1e-7)
    path, targets = thick_cylinder.inflate("sphere", thick_cylinder.wall("sphere", 16))
    limit = path.limit_points[0]
    assert limit.measures["pressure"] * thick_cylinder.PSI == pytest.approx(
        stored("sphere", "limit_pressure_MPa"), rel=1e-7)
    assert path.value(targets["50"].bind(path.problem), limit) * thick_cylinder.INCH == pytest.approx(
        stored("sphere", "inner_displacement_cm_at_limit"), rel=1e-4)


def test_branches_against_kbkz():
    """Branches with the same spectrum, work along another path, few past states; the fits are slow."""
    def stored(path):
        return {key: value for key, value in STORED.items() if key.startswith(f"kbkz_branches/{path}/")}
    same = kbkz_branches.misfits(fx.Viscoelastic(None, kbkz_branches.SPECTRUM), kbkz_branches.MELT)
    found = {f"kbkz_branches/same spectrum/{mode}/{rate}/{stretch}": value for mode, rates in same.items()
             for rate, row in rates.items() for stretch, value in row.items()}
    assert found == pytest.approx(stored("same spectrum"), rel=1e-6) and len(found) == 24
    work = [kbkz_branches.no_potential(kbkz_branches.DAMPING)[k] for k in (1, 0)]
    assert work == pytest.approx([*stored("no potential: PSM(alpha=10.0, beta=0.05)").values()], rel=1e-6)
    kept = [kbkz_branches.kept(mode, rate, 8) for mode in ("equibiaxial", "uniaxial") for rate in (0.1, 1.0, 10.0)]
    assert kept == pytest.approx([*stored("kept 8").values()], rel=1e-6)


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
@pytest.mark.parametrize("name", ["clamp_ring", "compression_homogeneous", "kbkz", "kbkz_branches", "measured_ellipse",
                                  "other_programs", "plug_stress", "thick_plate", "treloar", "two_layer"])
def test_stored_numbers_are_those_of_today(name, tmp_path):
    folder = "demos" if (ROOT / "demos" / f"{name}.py").is_file() else "benchmarks"
    run(f"{folder}/{name}.py", "--out", tmp_path)
    summary = json.loads((tmp_path / "summary.json").read_text())
    stored = {path: value for path, value in STORED.items() if path.startswith(f"{name}/")}
    today = {path: make_pages.found(summary, path.partition("/")[2]) for path in stored}
    assert today and not {path: (stored[path], now) for path, now in today.items()
                          if differs(path, stored[path], now, 1e-3)}
