"""The tables of the docs hold what the code that makes them gives today."""

import re
import sys

import pytest
from conftest import ROOT

sys.path[:0] = [str(ROOT / "demos"), str(ROOT / "benchmarks")]
import compression_roll_over  # noqa: E402
import thick_cylinder  # noqa: E402
import treloar_mesh  # noqa: E402

import formingx as fx  # noqa: E402

DOCS = "\n".join((ROOT / "docs" / f"{page}.md").read_text() for page in ("verification", "forming"))


def row(table, name):
    """The cells after the first one of a table's row; the table is known by how its head begins."""
    lines = DOCS[DOCS.index(f"\n| {table}") + 1:].split("\n\n")[0].splitlines()
    found = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]
    return next(cells[1:] for cells in found if cells[0].startswith(name))


def printed(value, cell):
    """A value with as many decimals as the cell has."""
    return f"{value:.{len(cell.partition('.')[2])}f}"


@pytest.mark.parametrize("elements, name", [((20, 1), "20 x 1"), ((40, 2), "40 x 2")])
def test_treloar(elements, name):
    *cells, states, iterations = row("simply supported", name)
    found = treloar_mesh.pressures(elements, fx.SimplySupported("rim"))
    assert [printed(v, c) for v, c in zip([found["limit"], *found["at"]], cells, strict=True)] == cells
    assert (found["steps"], found["iterations"]) == (int(states), int(iterations))


def test_thick_cylinder_and_sphere():
    ours, exact = (re.findall(r"[\d.]+", cell) for cell in row("study", "`thick_cylinder`"))
    path, targets = thick_cylinder.inflate("tube", thick_cylinder.wall("tube", 16))
    for mine, theirs, at in zip(ours, exact, ("10", "30", "50"), strict=True):
        assert printed(path.met(targets[at]).measures["pressure"] * thick_cylinder.PSI, mine) == mine
        assert printed(thick_cylinder.exact("tube", at).pressure * thick_cylinder.PSI, theirs) == theirs
    path, targets = thick_cylinder.inflate("sphere", thick_cylinder.wall("sphere", 16))
    limit = path.limit_points[0]
    found = (limit.measures["pressure"] * thick_cylinder.PSI,
             path.value(targets["50"].bind(path.problem), limit) * thick_cylinder.INCH)
    cells = re.findall(r"[\d.]+", row("study", "its thick sphere")[0])
    assert [printed(v, c) for v, c in zip(found, cells, strict=True)] == cells


def test_roll_over():
    cells = row("force on one plate", "8 x 4")
    _, met, end = compression_roll_over.compress((8, 4))
    assert end == "done"
    assert [printed(compression_roll_over.force(s), c) for s, c in zip(met.values(), cells, strict=True)] == cells


@pytest.mark.slow
@pytest.mark.parametrize("elements", compression_roll_over.GRIDS[1:])
def test_roll_over_on_finer_grids(elements):
    cells = row("force on one plate", f"{elements[0]} x {elements[1]}")
    _, met, end = compression_roll_over.compress(elements)
    assert end == "done"
    assert [printed(compression_roll_over.force(s), c) for s, c in zip(met.values(), cells, strict=True)] == cells
