"""Runs that fail for a known cause: the diagnosis names this cause, with numbers and place."""

import math
import subprocess
import sys

import numpy as np
import pytest
from conftest import ROOT, drawn, run_json, treloar
from test_contact import cup

import formingx as fx
from formingx.checks import failed_run
from formingx.solve import diagnose


def failure(attempt):
    with pytest.raises(fx.ConvergenceError) as caught:
        attempt()
    error = caught.value
    assert str(error.diagnosis) in str(error)
    return error, error.diagnosis


def test_limit_point_under_fixed_control():
    """The limit pressure is told from the slopes of the path: that of `trace`, without having passed it."""
    error, found = failure(lambda: fx.solve(treloar(), to=1.0, increments=5))
    limit = fx.trace(treloar(), until=fx.pole_stretch(3.0), progress=False).limit_points[0].measures["pressure"]
    assert found.next_limit_point == pytest.approx(limit, rel=1e-6)
    assert found.control < found.next_limit_point < found.aimed
    assert "a limit point lies ahead" in str(error) and "trace" in found.advice[0]
    assert found.step == len(error.path) and found.turned == () and found.smallest_J > 0.99


def test_target_beyond_a_limit_point():
    error, found = failure(lambda: fx.trace(treloar(), until=fx.pressure(0.6), max_steps=30, progress=False))
    assert found.limit_points == (error.path.limit_points[0].measures["pressure"],)
    assert "the pressure has its maximum, 0.493279, at a limit point that was passed, and the target 0.6" in str(error)


def test_target_below_a_limit_point():
    """A sheet that is drawn down by suction has a limit point at a minimum of the pressure."""
    error, found = failure(lambda: fx.trace(treloar(), until=fx.pressure(-0.6), max_steps=30, progress=False))
    assert "the pressure has its minimum, -0.49" in str(error) and "the target -0.6 lies below it" in str(error)


def test_an_earlier_limit_point_is_not_named_as_cause():
    """It rose above the first maximum again."""
    facts = {"what": "travel", "limit_points": (0.54, 0.51)}
    for control, is_cause in ((0.53, True), (0.73, False)):
        run = diagnose.FailedRun({**facts, "control": control}, None, None, target=0.9)
        assert bool(list(failed_run.limit_point_findings(run))) is is_cause


@pytest.mark.thorough
def test_a_pressure_in_time_beyond_its_maximum():
    """The maximum is that of what is driven, and the singular tangent there no bifurcation."""
    scene = fx.Scene(mesh=fx.mesh.disc(radius=1.25, thickness=0.082, elements=(10, 1)), loads=[fx.Pressure("bottom")],
                     materials=fx.Viscoelastic(fx.NeoHookean(c10=0.2), branches=[(3.6, 1.0)]), model=fx.Membrane(),
                     supports=[fx.Symmetry("axis"), fx.SimplySupported("rim")])
    stage = fx.Stage("blow", control=scene.loads[0], until=fx.pressure(1.0), duration=0.1)
    error, found = failure(lambda: fx.Process(scene).run([stage], progress=False, accuracy="draft"))
    cause, = found.causes
    assert f"the control reaches a maximum, a limit point, at process time {found.control:.6g}" in cause
    assert "bifurcation" not in str(error) and "enclosed_volume" in found.advice[0]


def test_an_inadmissible_state_names_its_own_remedy():
    """Of a face that sinks into its mould: the penalty; no other cause is sought, nothing else advised."""
    scene = cup("stick", (10, 1), penalty=1.0)
    error, _ = failure(lambda: fx.trace(scene, until=fx.pressure(50.0), progress=False))
    assert "give Contact a penalty of" in str(error) and "Cause" not in str(error) and "Try" not in str(error)


def test_too_few_steps():
    """The predicted number of steps is enough, and no other cause is named."""
    error, found = failure(lambda: fx.trace(treloar(), until=fx.pole_stretch(3.0), max_steps=5, progress=False))
    assert len(found.causes) == 1 and "max_steps = 5 were used up at" in found.causes[0]
    more = int(found.causes[0].split("about ")[1].split()[0])
    fx.trace(treloar(), until=fx.pole_stretch(3.0), max_steps=5 + more, progress=False)


def test_limit_of_a_material():
    """A volume that would need more than Gent's limit allows: the largest I1 of the sheet is at the pole."""
    scene = fx.Scene(
        mesh=fx.mesh.disc(radius=1.25, thickness=0.082, elements=(10, 1)), materials=fx.Gent(mu=4.0, Jm=10.0),
        supports=[fx.Symmetry("axis"), fx.SimplySupported("rim")], loads=[fx.Pressure("bottom")])
    _, found = failure(lambda: fx.trace(scene, until=fx.enclosed_volume(1e4), max_steps=60, progress=False))
    assert 0.9 < found.I1 < 1
    assert "a material is stretched nearly to its limit" in found.causes[0]
    assert "used up" not in str(found)


def pressed(**change):
    """A block glued to its base, pressed flat from above: its foot flows out and folds."""
    return fx.Scene(mesh=fx.mesh.disc(radius=1.0, thickness=1.0, elements=(6, 6)), materials=fx.NeoHookean(c10=1.0),
                    supports=[fx.Symmetry("axis"), fx.Clamped("bottom"), fx.PrescribedDisplacement("top")], **change)


def test_element_about_to_turn_inside_out(tmp_path):
    _, found = failure(lambda: fx.trace(pressed(), until=fx.travel(-0.95), max_steps=100, progress=False,
                                        allow_inadmissible=True))
    assert "an element is about to turn inside out" in found.causes[0]
    assert found.smallest_J < 0.1 and found.what == "travel"
    assert found.at_J.R > 0.6 and found.at_J.Z < 0.4 and found.at_J.layer == "sheet"      # the outer foot
    assert "smaller elements around (R, Z) = (0.8" in found.advice[0]
    found.picture(tmp_path / "a" / "last.png")
    assert drawn(tmp_path / "a" / "last.png")


def test_buckling():
    """The tangent of a column in plane strain loses definiteness at Euler's load, where the run goes straight on.

    Ends clamped, one free to move sideways: strain pi^2 (h / L)^2 / 12.
    """
    thickness, length = 0.2, 2.0
    scene = fx.Scene(mesh=fx.mesh.disc(radius=thickness, thickness=length, elements=(2, 16)),
                     kinematics=fx.PlaneStrain(), materials=fx.NeoHookean(c10=1.0),
                     supports=[fx.Clamped("bottom"), fx.PrescribedDisplacement("top")])
    step = fx.StepControl(length=0.001, growth=1.0)
    _, found = failure(lambda: fx.trace(scene, until=fx.travel(-0.3), max_steps=14, step=step, progress=False))
    euler = length * math.pi**2 * (thickness / length) ** 2 / 12
    before, after = found.turned[0]
    assert len(found.turned) == 1 and 0.9 * euler < -before < -after < 1.25 * euler
    assert "such as buckling" in found.causes[0] and found.limit_points == ()


def test_contact_converges_where_nodes_slide_off_an_edge():
    """A plug whose edge (fillet 0.05) falls between the nodes (0.44 apart): they slide off it one by one."""
    plug = fx.tools.male(radius=1.905, height=30.0, base=-30.0, fillet=0.05).mirrored().moved(z=0.6985)
    scene = fx.Scene(mesh=fx.mesh.disc(radius=8.89, thickness=0.6985, elements=(20, 1)),
                     materials=fx.NeoHookean(c10=0.448), supports=[fx.Symmetry("axis"), fx.Clamped("rim")],
                     contacts=[fx.Contact("top", plug, 0.3, direction=(0, -1))])
    path = fx.trace(scene, until=fx.travel(10.0), step=fx.StepControl(target=8), progress=False)
    assert path["travel"][-1] == pytest.approx(10.0) and np.all(np.diff(path["travel"]) > 0)
    assert all(state.jump["dissipated"] > 0 for state in path.jumps)


def test_no_first_state_and_a_membrane(tmp_path):
    """Without a good state, or without elements across the thickness, what can be said is said."""
    scene = fx.Scene(mesh=fx.mesh.disc(radius=1.25, thickness=0.082, elements=(10, 1)),
                     materials=fx.NeoHookean(c10=2.0), supports=[fx.Symmetry("axis"), fx.SimplySupported("rim")],
                     loads=[fx.Pressure("bottom"), fx.Pressure("top", -5.0)])
    _, found = failure(lambda: fx.trace(scene, until=fx.pressure(0.6), progress=False))
    assert found.step == 0 and str(found).startswith("No equilibrium was found at the start")
    _, found = failure(lambda: fx.solve(treloar(model=fx.Membrane()), to=1.0, increments=5))
    assert found.smallest_J is None and "a limit point lies ahead" in str(found)
    with pytest.raises(fx.InputError, match="no elements to draw"):
        found.picture(tmp_path / "x.png")


def test_condition_number():
    """The estimate against NumPy's 1-norm condition number of the same matrix, and the sign of its determinant."""
    from scipy.sparse import csr_matrix

    from formingx.problem.problem import Problem
    from formingx.solve.linear import DirectSolver, condition
    problem = Problem(treloar(elements=(4, 1)))
    x = problem.x.duplicate()
    x.set(0)
    rows, columns, values = problem.tangent(x, 0.0).getValuesCSR()
    dense = csr_matrix((values, columns, rows)).toarray()
    solver = DirectSolver(problem.matrix, problem.symmetric, determinant=True)
    assert solver.factorise() and solver.sign() == np.linalg.slogdet(dense)[0]
    exact = np.linalg.cond(dense, 1)
    assert exact / 3 <= condition(problem.matrix, solver) <= exact * (1 + 1e-6)


@pytest.mark.parametrize("able", [True, False], ids=["kept", "MUMPS cannot"])
def test_solutions_with_stored_scaling_agree_to_round_off(able, monkeypatch):
    """Of another tangent, to round-off; a MUMPS that cannot keep one makes another."""
    from formingx.problem.problem import Problem
    from formingx.solve import linear
    problem = Problem(treloar(elements=(4, 1)))
    x, found = problem.x.duplicate(), problem.x.duplicate()
    x.set(0)
    problem.tangent(x, 0.0)
    solver = linear.DirectSolver(problem.matrix, problem.symmetric)
    assert solver.factorise()
    if not able:
        monkeypatch.setattr(linear.DirectSolver, "scaling", 0)
    x.array_w[:] = 0.01 * np.random.default_rng(1).standard_normal(len(x.array_r))
    rhs = problem.tangent(x, 0.0) * x
    assert solver.factorise(rescale=False)
    monkeypatch.undo()
    assert solver.scaling == (-1 if able else 7)
    solver.solve(rhs, found)
    assert np.abs(found.array_r - x.array_r).max() < 1e-10 * np.abs(x.array_r).max()


SCRIPT = """
import json, sys
from mpi4py import MPI
sys.path.insert(0, "tests")
from conftest import treloar
import formingx as fx
try:
    fx.solve(treloar(), to=1.0, increments=5)
except fx.ConvergenceError as error:
    d = error.diagnosis
    if MPI.COMM_WORLD.rank == 0:
        print(json.dumps([d.next_limit_point, d.smallest_J, d.condition, d.at_J.R, len(d.causes)]))
"""


@pytest.mark.thorough
def test_ranks_give_the_same_diagnosis():
    one, two = run_json(SCRIPT, 1), run_json(SCRIPT, 2)
    assert two == pytest.approx(one, rel=1e-4)


@pytest.mark.thorough
def test_a_script_that_stops_in_an_error_ends():
    """Objects that Python frees while an error is on its way must not lock up the end of the program."""
    script = ("import sys; sys.path.insert(0, 'tests')\nfrom conftest import treloar\nimport formingx as fx\n"
              "for scene in [treloar(), treloar()]:\n    fx.trace(scene, until=fx.pressure(1.0), max_steps=1)\n")
    done = subprocess.run([sys.executable, "-c", script], cwd=ROOT, capture_output=True, text=True, timeout=120)
    assert done.returncode == 1 and "ConvergenceError: pressure = 1 was not reached" in done.stderr
    assert "Exception ignored" not in done.stderr


@pytest.mark.parametrize("grown, named", [(1000.0, True), (10.0, False)])
def test_a_tangent_that_becomes_singular_is_named(grown, named):
    """Its condition number has grown within a few states, and no limit point explains it."""
    facts = {"what": "pressure", "condition_before": 1e10, "condition": grown * 1e10}
    found = list(failed_run.branch_findings(diagnose.FailedRun(facts, None, None)))
    assert any("becomes singular, and there is no limit point" in cause.text for cause in found) == named
