"""Temperatures on coarse meshes: layers of elements below heated faces, and the estimated error of the mesh."""

import logging
import re

import numpy as np
import pytest
import ufl
from conftest import run_json
from dolfinx import fem

import formingx as fx
from formingx import _compat
from formingx.exact import heat as reference
from formingx.extensions.heat import checks
from formingx.extensions.heat import run as running
from formingx.extensions.heat.layers import layered
from formingx.mesh.grid import gathered

SHEET = fx.ThermalProperties(conductivity=0.17, density=1050.0, heat_capacity=1800.0)
STEEL, ALUMINIUM = {"conductivity": 40.0, "heat_capacity": 3.611e6}, {"conductivity": 200.0, "heat_capacity": 2.43e6}


def chilled(accuracy, thickness, conductance, metal, times, start=150.0, **options):
    """(a sheet on a cold tool, errors at the times, against the transform)."""
    mesh = fx.mesh.disc(radius=50 * thickness, thickness=thickness, accuracy=accuracy)
    tool = fx.ConductingTool(thickness=0.02, back=30.0, **metal)
    run = fx.heat(mesh, SHEET, [fx.ContactWithTool("bottom", conductance=conductance, tool=tool)], start=start,
                  times=times, unit="C", tolerance=0.02)
    x = np.linspace(0, thickness, 15)
    exact, _ = reference.sheet_on_tool(reference.Slab(thickness, 0.17, 1050 * 1800.0),
                                       reference.Slab(0.02, *metal.values()),
                                       conductance, start, 30.0, 0.0, 25.0, x, [0.0], times)
    return run, np.abs(run.at_points(np.column_stack([0 * x, x])) - exact).max(1)


@pytest.mark.parametrize("accuracy, thickness, conductance, metal, start", [
    ("draft", 1e-3, 1000.0, ALUMINIUM, 150.0), ("draft", 0.3e-3, 300.0, ALUMINIUM, 90.0),
    pytest.param("standard", 1e-3, 1000.0, ALUMINIUM, 150.0, marks=pytest.mark.thorough),
    pytest.param("draft", 4e-3, 3e4, STEEL, 200.0, marks=pytest.mark.thorough),
    pytest.param("fine", 1e-3, 1000.0, ALUMINIUM, 150.0, marks=pytest.mark.slow)])
def test_accuracy_presets_keep_their_temperature_error(accuracy, thickness, conductance, metal, start, caplog):
    """The promise of docs/heat.md, right after the sheet was laid on the tool."""
    with caplog.at_level(logging.WARNING, "formingx"):
        run, errors = chilled(accuracy, thickness, conductance, metal, [0.05, 0.1, 0.2], start)
    assert errors.max() < running.WARNED_ERROR * (start - 30) and not caplog.records
    assert run.errors_in_space.max() < running.WARNED_ERROR * (start - 30)


@pytest.mark.parametrize("accuracy", ["draft", "standard"])
def test_the_error_in_space_is_estimated(accuracy, monkeypatch, caplog):
    """Without the layers: errors of 0.2 to 26 degrees, the estimate within a factor of 3; and a warning."""
    monkeypatch.setattr(running, "layered", lambda mesh, *_: mesh)
    with caplog.at_level(logging.WARNING, "formingx"):
        run, errors = chilled(accuracy, 1e-3, 1000.0, ALUMINIUM, [0.05, 0.1, 0.2, 1.0])
    assert errors.min() > 0.1
    assert np.all(errors < 3 * run.errors_in_space) and np.all(run.errors_in_space < 3 * errors)
    assert "the error in space is about" in caplog.text


@pytest.mark.thorough
def test_a_deformed_sheet_has_layers_too():
    """Stretched to twice its radius it is a sheet of a quarter of the thickness."""
    mesh = fx.mesh.disc(radius=0.05, thickness=4e-3, accuracy="draft")
    X = ufl.SpatialCoordinate(mesh.domain)
    law = fx.Convection("top", h=500.0, air=20.0)
    run = fx.heat(mesh, SHEET, [law], start=150.0, times=[0.5, 1.0], unit="C", tolerance=0.02,
                  displacement=ufl.as_vector([X[0], -0.75 * X[1]]))
    x = np.linspace(0, 1, 9)
    exact = reference.series(reference.Slab(1e-3, 0.17, 1050 * 1800.0), 150.0, (500.0, 0.0), (20.0, 25.0),
                             1e-3 * x, [0.5, 1.0])
    found = run.at_points(np.column_stack([0 * x, 4e-3 * (1 - x)]))
    assert found == pytest.approx(exact, abs=running.WARNED_ERROR * 130)


def bodies():
    return {"two faces and a rim": (fx.mesh.disc(radius=4e-3, thickness={"a": 1e-3, "b": 1e-3}, elements=(4, (2, 1))),
                                    {"bottom": (1e-4, 1e-3), "top": (3e-4, 1e-3), "rim": (2e-4, 1e-3)}),
            "curved": (fx.mesh.sphere(inner_radius=1.0, thickness=0.3, elements=(6, 2)), {"inner": (0.02, 0.2)})}


@pytest.mark.parametrize("name", bodies())
def test_layers_are_the_same_body(name):
    """Area, boundaries and layers stay, elements below a face are as thin as was asked for, and edges are shared."""
    mesh, depths = bodies()[name]
    fine = layered(mesh, depths)
    fine.check()
    for m in (mesh, fine):
        assert set(m.boundaries) == set(mesh.boundaries)
    sizes = [[fem.assemble_scalar(_compat.compile_form(fem.Constant(m.domain, 1.0) * measure(tags)))
              for measure, names in
              ((ufl.Measure("dx", m.domain, subdomain_data=m.cells), m.layers),
               (ufl.Measure("ds", m.domain, subdomain_data=m.facets), m.boundaries)) for tags in names.values()]
             for m in (mesh, fine)]
    assert sizes[1] == pytest.approx(sizes[0], rel=1e-12)
    face, (first, _) = next(iter(depths.items()))
    grid = gathered(fine)
    a, b = grid.boundaries[face][0, :2]
    rows = np.concatenate(list(grid.layers.values()))[:, :3]
    p, q, r = grid.points[rows[np.isin(rows, (a, b)).sum(1) == 2][0]]
    area = abs((q - p)[0] * (r - p)[1] - (q - p)[1] * (r - p)[0])
    assert area / np.hypot(*(grid.points[b] - grid.points[a])) < 0.45 * first
    assert len(depths) > 1 or layered(fine, depths) is fine


def test_too_curved_elements_are_not_divided(caplog):
    mesh = fx.mesh.parison(inner_radius=1e-2, thickness=3e-3, length=2e-2, elements=(6, 2))
    with caplog.at_level(logging.WARNING, "formingx"):
        run = fx.heat(mesh, SHEET, [fx.ContactWithTool("outer", conductance=1000.0, tool=20.0)], start=100.0,
                      times=[0.1], unit="C", tolerance=0.1)
    assert run.mesh is mesh and "more elements along" in caplog.text


RANKS = """
import json
import numpy as np
import formingx as fx
from test_heat_layers import SHEET
mesh = fx.mesh.disc(radius=0.05, thickness=1e-3, elements=(2, 1))
laws = [fx.ContactWithTool("bottom", conductance=1e3, tool=20.0), fx.Convection("rim", h=50.0, air=30)]
run = fx.heat(mesh, SHEET, laws, start=100.0, times=[0.1, 0.5], unit="C", tolerance=1.0)
numbers = [*run.at_points([(0.0, 0.0), (0.03, 2e-4), (0.0499, 5e-4)]).ravel(), *run.errors_in_space]
if mesh.comm.rank == 0:
    print(json.dumps(list(map(float, numbers))))
"""


@pytest.mark.thorough
def test_ranks_agree():
    one, three = (run_json("import sys; sys.path.insert(0, 'tests')" + RANKS, ranks) for ranks in (1, 3))
    assert three == pytest.approx(one, rel=1e-7)


def chilled_from_below(layers, biot):
    """A sheet of equal layers that is 130 degrees above the air below it; conductivity 0.2, wall 1e-3."""
    polymer = fx.ThermalProperties(conductivity=0.2, density=1000.0, heat_capacity=2000.0)
    return fx.Scene(mesh=fx.mesh.disc(radius=4e-3, thickness=1e-3, elements=(4, layers)),
                    materials=fx.NeoHookean(c10=1e5), temperature=150.0,
                    heat=fx.Cooling(polymer, [fx.Convection("bottom", h=biot * 200.0, air=20.0)], unit="C"),
                    supports=[fx.Symmetry("axis"), fx.Symmetry("top", normal="z"),
                              fx.PrescribedDisplacement("rim", "r", name="grip")])


@pytest.mark.parametrize("layers, biot", [(1, 0.5), (2, 0.5), (1, 5.0), (2, 5.0), (4, 50.0), (8, 50.0), (4, 1e4)])
def test_error_of_few_layers(layers, biot):
    """The check's error of a chilled sheet is the measured one, within a factor of 2.5."""
    wall_time = 1e-6 / 1e-7
    path = fx.Process(chilled_from_below(layers, biot)).run([fx.Stage("chill", duration=0.3 * wall_time)],
                                                            progress=False)
    late = [state for state in path.states if state.time >= 0.01 * wall_time]
    error = path.problem.history.parts[-1].errors_in_space(late).max() / 130
    assert 1 / 2.5 < error / checks.error_of_layers(layers, biot) < 2.5


def test_coarse_layers_are_found():
    """With one layer the check asks for five, and with these it finds nothing."""
    said = [f for f in fx.check(chilled_from_below(1, 50.0)).findings if "layers" in f.text]
    assert [f.about for f in said] == ["boundary 'bottom'"] and "use 5 layers" in said[0].text
    assert checks.layers_needed(50.0) == 5 and checks.layers_needed(0.1) == 1
    assert not [f for f in fx.check(chilled_from_below(5, 50.0)).findings if "layers" in f.text]
    sizes = [float(size) for size in re.search(r"\(n, \[(.*?)\]\)", said[0].text)[1].split(",")]
    assert sizes == sorted(sizes) and sizes[0] / sum(sizes) == pytest.approx(1 / 5, abs=0.05)
