"""Relaxation of a body: stress over its value in equilibrium, elastic stretches of branches, cost of steps."""

import csv

import numpy as np
import pytest
import ufl
from conftest import run as run_python

import formingx as fx
from formingx import Stage, _compat
from formingx.results.files.fields import Fields
from formingx.solve import predictor
from formingx.solve.newton import Tolerances
from formingx.solve.state import State

RUBBER = fx.NeoHookean(c10=0.05)
BRANCHES = [(0.3, 0.5), (0.4, 5.0)]
POLYMER = fx.Viscoelastic(RUBBER, BRANCHES)
AT_ONCE = Stage("at once", control="pull", until=fx.travel(1.0))


def block(material=POLYMER, mesh=None):
    """A cylinder of radius and height 1, pulled at its top."""
    return fx.Scene(mesh=mesh or fx.mesh.disc(radius=1.0, thickness=1.0, elements=(1, 1)), materials=material,
                    supports=[fx.Symmetry("axis"), fx.Symmetry("bottom", "z"),
                              fx.PrescribedDisplacement("top", name="pull")])


def run(scene, *stages, **options):
    return fx.Process(scene).run(stages, progress=False, **options)


@pytest.mark.parametrize("law", [fx.Viscoelastic, fx.TransientNetwork])
def test_stress_at_the_pole_relaxes_to_equilibrium(law, tmp_path):
    material = law(RUBBER, BRANCHES)
    path = run(block(material), AT_ONCE, Stage("hold", duration=1.0), Stage("later", duration=1e9), accuracy=1e-4)
    found = path["pole_stress_ratio"]
    held = [state for state in path.states if state.stage == "hold"]
    assert found[0] == pytest.approx(material.shear_modulus / RUBBER.shear_modulus, rel=1e-9)       # of moduli, at rest
    assert held[0].measures["pole_stress_ratio"] == pytest.approx(8.0, rel=1e-9)
    expected = material.relaxation("uniaxial", 2.0, [1.0])[0] / RUBBER.stress("uniaxial", 2.0)
    assert held[-1].measures["pole_stress_ratio"] == pytest.approx(expected, rel=1e-4)
    assert found[-1] == pytest.approx(1.0, abs=1e-9)
    path.to_csv(tmp_path / "run.csv")
    with open(tmp_path / "run.csv") as file:
        rows = list(csv.DictReader(line for line in file if not line.startswith("#")))
    assert float(rows[-1]["pole_stress_ratio"]) == pytest.approx(1.0, abs=1e-9)
    path.report(tmp_path / "run.html")
    assert "pole stress ratio" in (tmp_path / "run.html").read_text()


@pytest.mark.thorough
def test_no_stress_ratio_without_equilibrium_stress():
    once = Stage("at once", control="pull", until=fx.travel(0.1))
    assert "pole_stress_ratio" not in run(block(RUBBER), once).columns
    assert "pole_stress_ratio" not in run(block(fx.Viscoelastic(None, BRANCHES)), once).columns


@pytest.mark.thorough
def test_ratio_of_a_membrane_with_layers():
    """Layers have weights by thickness; at a sudden stretch of 2 each has its own moduli."""
    mesh = fx.mesh.disc(radius=1.0, thickness={"stiff": 0.01, "soft": 0.03}, elements=(4, 1))
    other = fx.NeoHookean(c10=0.1)
    scene = fx.Scene(mesh=mesh, materials={"stiff": POLYMER, "soft": other}, model=fx.Membrane(),
                     supports=[fx.Symmetry("axis"), fx.SimplySupported("rim")],
                     loads=[fx.Pressure("bottom", name="air")])
    path = run(scene, Stage("blow", control="air", until=fx.pole_stretch(1.5)))
    assert path.last.measures["pole_stress_ratio"] == pytest.approx(
        (0.01 * 0.4 + 0.03 * 0.1) / (0.01 * 0.05 + 0.03 * 0.1), rel=1e-9)


@pytest.mark.parametrize("law", [fx.Viscoelastic, fx.TransientNetwork])
def test_elastic_stretch_of_branches(law):
    """It is the stretch of the body at first and 1 in the end; the branch with the shorter time relaxes first."""
    path = run(block(law(RUBBER, BRANCHES)), AT_ONCE, Stage("hold", duration=1.0), Stage("later", duration=1e9),
               accuracy=1e-4)
    fields, at_once = Fields(path), next(s for s in path.states if s.stage == "hold")
    first, last = fields.evaluate(at_once), fields.evaluate(path.last)
    for k in (1, 2):
        assert first[f"elastic_stretch_{k}"] == pytest.approx(first["stretches"][..., :1], rel=1e-9)
        assert last[f"elastic_stretch_{k}"] == pytest.approx(1.0, abs=1e-9)
    held = fields.evaluate([s for s in path.states if s.stage == "hold"][-1])
    assert 1.001 < held["elastic_stretch_1"].max() < held["elastic_stretch_2"].min() < 1.999


@pytest.mark.thorough
def test_a_layer_without_branches_has_no_elastic_stretch():
    mesh = fx.mesh.disc(radius=1.0, thickness={"relaxing": 0.5, "rubber": 0.5}, elements=(1, 1))
    path = run(block({"relaxing": POLYMER, "rubber": RUBBER}, mesh), AT_ONCE)
    fields = Fields(path)
    found, low = fields.evaluate(path.last)["elastic_stretch_1"][..., 0], fields.points[..., 1].mean(axis=1) < 0.5
    assert np.isnan(found[~low]).all() and np.all(found[low] > 1)


def test_a_cubic_in_time_is_predicted_exactly():
    """The prediction uses states that are far enough apart, and no state before a jump."""
    def state(time, **kind):
        return State(np.array([time**3 - time, 2.0]), 0.0, np.zeros(2), 1.0, time=time, **kind)
    states = [state(t) for t in (0.0, 0.3, 0.7, 1.2, 1.2 + 1e-9)]
    past = predictor.recent_states(states, 1.6, degree=3)
    assert [s.time for s in past] == [0.0, 0.3, 0.7, 1.2 + 1e-9]
    assert predictor.weights(past, 1.6) @ [s.x for s in past] == pytest.approx([1.6**3 - 1.6, 2.0], rel=1e-12)
    states[2] = state(0.7, kind="jump")
    assert [s.time for s in predictor.recent_states(states, 1.6, degree=3)] == [0.7, 1.2 + 1e-9]


@pytest.mark.thorough
def test_tangents_that_are_kept_change_no_result():
    """A sheet inflated to a constant volume: fewer tangents than states, and the results of tighter tolerances."""
    scene = fx.Scene(mesh=fx.mesh.disc(radius=1.0, thickness=0.05, elements=(8, 1)), materials=POLYMER,
                     supports=[fx.Symmetry("axis"), fx.SimplySupported("rim")],
                     loads=[fx.Pressure("bottom", name="air")])
    stage = Stage("flow", control="air", amplitudes={fx.enclosed_volume: [(0, 0), (1, 1.0), (6, 1.0)]},
                  step=fx.StepControl(length=0.02, largest=0.02))
    kept, exact = (run(scene, stage, accuracy=0.5, tolerances=Tolerances(correction=c, residual=r))
                   for c, r in ((1e-10, 1e-8), (1e-13, 1e-11)))
    held = [state for state in kept.states if state.time > 2]
    assert sum(not i.chord for state in held for i in state.history[:-1]) < 0.7 * len(held)
    assert max(state.history[-1].residual for state in kept.states[1:]) < 1e-8
    for column in ("pressure", "pole_stretch", "dissipated_energy"):
        assert kept[column] == pytest.approx(exact[column], rel=1e-7, abs=1e-12)


CONSTANTS = """
import sys
from formingx import _jit
sys.path.insert(0, "tests")
from test_relaxed import *
c10, mu, tau, known = map(float, sys.argv[1:])
if known:
    _jit.compile_c = lambda *_: sys.exit("a form is compiled")
other = fx.Viscoelastic(fx.NeoHookean(c10=c10), [(mu, tau), (3.0, 4.0)])
path = run(block(other), AT_ONCE, Stage("hold", duration=1.0))
print(path["pole_stress_ratio"][0])
"""


@pytest.mark.thorough
def test_nothing_is_compiled_for_other_constants():
    """Each runs in its own process: UFL sorts terminals by numbers as text, so 9 and 10 would make another form."""
    run_python("-c", CONSTANTS, 0.05, 0.3, 0.5, 0)
    assert float(run_python("-c", CONSTANTS, 0.2, 1.0, 2.0, 1).split()[-1]) == pytest.approx(11.0, rel=1e-9)


def test_an_expression_is_compiled_once():
    """Once for all problems of a process, independently of the number of UFL variables before."""
    domain = fx.mesh.disc(radius=1.0, thickness=1.0, elements=(1, 1)).domain
    x = ufl.SpatialCoordinate(domain)[0]
    places = np.array([[0.5, 0.25]])

    def slope():
        v, _ = ufl.variable(x), ufl.variable(x)
        return _compat.compile_expression(ufl.diff(v**2, v), places)
    one, two = slope(), slope()
    assert one.ufcx_expression == two.ufcx_expression
    where = _compat.compile_expression(x, places).eval(domain, [0])
    assert two.eval(domain, [0]) == pytest.approx(2 * where, rel=1e-14)
