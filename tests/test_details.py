"""Single lines of code that hardly change whole runs, tested alone; `benchmarks/mutants.py` found them."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import ufl
from conftest import treloar
from mpi4py import MPI
from test_energy_balance import RELAXES, sheet
from test_heat import body_of

import formingx as fx
from formingx import Stage, tools
from formingx.contact.step_limit import TrialStep
from formingx.measures.targets import Amplitude
from formingx.problem.problem import Problem
from formingx.results.evaluate.part import _strips
from formingx.solve import branches, predictor, snap_through
from formingx.solve.arc_length import Curve
from formingx.solve.newton import Failure
from formingx.solve.progress import RunTargets
from formingx.solve.state import State


def moved(mesh, by):
    """The same mesh, its nodes at X + by(X)."""
    mesh.domain.geometry.x[:, :2] += np.column_stack(by(mesh.domain.geometry.x[:, :2].T))
    return mesh


def as_ufl(by, mesh):
    return ufl.as_vector(by(ufl.SpatialCoordinate(mesh.domain)))


@pytest.mark.parametrize("by", [lambda X: (0.7 * X[1], 0 * X[1]), lambda X: (0.3 * X[1], 0.4 * X[0] + 0.2 * X[1])],
                         ids=["sheared", "grown"])
def test_heat_flows_in_the_deformed_body(by):
    """A deformed body, pulled back, is the body that has that shape: conduction and what is absorbed in depth."""
    def sheet():
        return fx.mesh.disc(radius=0.01, thickness=0.004, elements=(4, 2))

    light, mesh = [fx.Absorption("top", flux=3000.0, coefficient=500.0)], sheet()
    kinematics = fx.PlaneStrain()
    bodies = [body_of(mesh, light, displacement=as_ufl(by, mesh), kinematics=kinematics),
              body_of(moved(sheet(), by), light, kinematics=kinematics)]
    rates = []
    for body in bodies:
        T = np.cos(300 * np.arange(len(body.points)) / len(body.points))     # the same at the same nodes
        found, _ = body.rates([T])
        rates.append(found[0] * body.capacity)
    assert np.abs(rates[0]).max() > 0
    assert rates[0] == pytest.approx(rates[1], abs=1e-9 * np.abs(rates[0]).max())


def test_an_inactive_tool_conducts_no_heat():
    plug = fx.Contact("top", tools.cylinder(radius=0.5, z=0.05), "none", direction=(0, -1), name="plug")
    scene = fx.Scene(mesh=fx.mesh.disc(radius=1.0, thickness=0.05, elements=(4, 1)), temperature=150.0, contacts=[plug],
                     materials=fx.NeoHookean(c10=1.0), supports=[fx.Symmetry("axis"), fx.Clamped("rim")],
                     heat=fx.Cooling(fx.ThermalProperties(conductivity=0.01, density=1.0, heat_capacity=1.0), [],
                                     unit="C", tools={"plug": (0.3, 30.0)}))
    path = fx.Process(scene).run([Stage("touch", duration=0.1), Stage("away", duration=0.5, inactive=["plug"])],
                                 progress=False)
    means = []
    for stage in ("touch", "away"):
        state = [s for s in path.states if s.stage == stage][-1]
        with path.problem.state_context(state) as problem:
            T, X = problem.temperature.T, ufl.SpatialCoordinate(scene.mesh.domain)
            dx = ufl.dx(scene.mesh.domain, metadata={"quadrature_degree": 4})
            means.append(problem.forms.integral(T * X[0] * dx))
    cold = 150.0 * 0.5 * 0.05
    assert means[0] < 0.99 * cold and means[1] == pytest.approx(means[0], rel=1e-8)


def test_area_of_the_node_on_the_axis():
    """L/24 times the weight at L, of which the middle of the facet gives twice as much: sums and moments stay."""
    scene = fx.Scene(mesh=fx.mesh.disc(radius=1.0, thickness=0.1, elements=(5, 1)), materials=fx.NeoHookean(c10=1.0),
                     supports=[fx.Symmetry("axis"), fx.Clamped("bottom")],
                     contacts=[fx.Contact("top", tools.plane(0.1), "none", direction=(0, -1))])
    contact, = Problem(scene).contacts
    order = np.argsort(contact.points[:, 0])
    R, area, lumped = contact.points[order, 0], contact.rule.area[order], contact.rule.lumped[order]
    L = R[2]
    assert area[0] == pytest.approx(2 * np.pi * L**2 / 24, rel=1e-12) and abs(lumped[0]) < 1e-14
    assert area - lumped == pytest.approx(2 * np.pi * L**2 / 24 * np.array([1, -2, 1, *[0] * (len(R) - 3)]), abs=1e-14)


def test_a_step_that_closes_a_whole_region_is_refused():
    scene = fx.Scene(mesh=fx.mesh.disc(radius=1.0, thickness=0.1, elements=(8, 1)), materials=fx.NeoHookean(c10=1.0),
                     supports=[fx.Symmetry("axis"), fx.Clamped("bottom")],
                     contacts=[fx.Contact("top", tools.plane(0.2), 0.3, direction=(0, -1))])
    problem = Problem(scene)
    x = np.zeros(problem.n_owned)
    near, far = (d / problem.forms.length for d in (0.05, 0.11))
    rest, close, deep = (TrialStep(x, control, x, 0.0, 1.0) for control in (0.0, near, far))
    limit = problem.contact.limit
    assert limit.check(rest, close, 1.0) is None and "too many" in limit.check(close, deep, 1.0).reason


def test_rest_is_free_of_stress_under_the_penalty():
    """The energy is split so that F = I is its minimum, which a pressure field would otherwise hide."""
    problem = Problem(fx.Scene(
        mesh=fx.mesh.disc(radius=1.0, thickness=0.1, elements=(4, 1)), materials=fx.MooneyRivlin(c10=1.0, c01=0.3),
        model=fx.DisplacementPenalty(eps=0.1), supports=[fx.Symmetry("axis"), fx.Clamped("rim")]))
    forces = problem.forces(problem.x.duplicate(), 0.0)
    forces[problem.constrained] = 0
    assert np.abs(forces).max() < 1e-14


@pytest.mark.parametrize("tool", [tools.sphere(radius=0.5, z=0.0), tools.cup(radius=2.0, depth=1.0, fillet=0.5)])
def test_derivative_of_slip_on_a_curved_tool_is_consistent(tool):
    """Where the point has gone into the tool, or out of it, since it touched, the tangent turns as it moves."""
    law = fx.Contact("top", tool, 0.3).law(1.0, 1.0, np.zeros((1, 2)))
    law.shift = 0.0
    start = tool.outline()[:: max(len(tool.outline()) // 12, 1)]
    old = law.start(start)._replace(distance=np.zeros(len(start)))                # they touch
    x, e = start + [0.03, 0.05], 1e-6
    for along in np.eye(2):
        slope = (law.motion(x + e * along, old).slip - law.motion(x - e * along, old).slip) / (2 * e)
        smooth = np.abs(law.nearest(x - e * along).curvature - law.nearest(x + e * along).curvature) < 1e-3
        assert smooth.sum() > 3
        assert (law.motion(x, old).along @ along)[smooth] == pytest.approx(slope[smooth], abs=1e-7)


def test_a_reactivated_tool_starts_without_contact_history():
    """What stuck to it before it left has moved since: it starts from where it is now."""
    scene = fx.Scene(mesh=fx.mesh.disc(radius=1.0, thickness=0.1, elements=(3, 1)), materials=fx.NeoHookean(c10=1.0),
                     supports=[fx.Symmetry("axis"), fx.Clamped("bottom")],
                     contacts=[fx.Contact("top", tools.plane(0.1), 0.3, direction=(0, -1))])
    problem = Problem(scene)
    contact, = problem.contacts
    x = np.random.default_rng(1).uniform(-0.01, 0.01, problem.n_owned)
    assert contact.history.position == pytest.approx(contact.points)
    contact.activate(x, -0.2)
    assert contact.history.position == pytest.approx(contact.positions(x, -0.2), rel=1e-12)
    assert not contact.history.slip.any()


def test_a_grey_face_radiates_with_the_fourth_power():
    law = fx.Radiation("top", emissivity=0.9, heater=400.0, view_factor=0.7)
    assert law.flux(100.0, -273.15, **law.parameters) == pytest.approx(
        0.7 * 0.9 * 5.670374419e-8 * (673.15**4 - 373.15**4), rel=1e-12)


def test_volume_between_two_lines_is_that_of_cones():
    """One piece from the axis: a frustum; from R = 1 to 2 a hollow one."""
    bottom, top = np.array([[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]]), np.array([[0.0, 3.0], [1.5, 3.0], [2.5, 3.0]])

    def frustum(a, b):
        return np.pi * (a * a + a * b + b * b)
    assert _strips(bottom, top, True) == pytest.approx([frustum(1, 1.5), frustum(2, 2.5) - frustum(1, 1.5)], rel=1e-12)
    assert _strips(bottom, top, False) == pytest.approx([3.75, 3.0], rel=1e-12)


def test_a_target_met_on_a_far_part_of_the_path_is_a_failure(monkeypatch):
    true, asked = Curve.progress, []

    def behind_at_first(self, old, new):
        asked.append(new)
        return -1.0 if len(asked) == 1 else true(self, old, new)
    monkeypatch.setattr(Curve, "progress", behind_at_first)
    monkeypatch.setattr(branches, "_orientation_changes", lambda curve, states: [])     # it measures progress, too
    path = fx.trace(treloar((6, 1)), until=fx.pole_height(0.3), progress=False)
    assert path.counts.failures == 1 and all(state is not asked[0] for state in path.states)


def test_no_predictor_uses_states_before_a_snap_through():
    def states(kind):
        return [State(np.array([s]), 0.0, np.ones(1), 0.0, kind=k) for s, k in enumerate(["step", kind, "step"])]

    def apart(a, b):
        return float(abs(b.x - a.x)[0])
    through, broken = states("step"), states("jump")
    assert [predictor.parabola_state(through, length, apart) for length in (3.0, 1.0)] == through[:2]
    assert predictor.parabola_state(broken, 3.0, apart) is None


def test_a_snap_through_does_not_pass_its_target():
    """How far the control goes on in it ends where something that is driven has its target value."""
    class Driven(Amplitude):
        is_controlled = True

        def __init__(self):
            pass
    targets = RunTargets(SimpleNamespace(value=lambda quantity, x, control: control), [(fx.travel(0.5), Driven())])
    near = State(np.zeros(1), 0.49, np.ones(1), 1.0)
    assert targets.short_of_targets(near, 0.1) == pytest.approx(0.01)
    assert targets.short_of_targets(near, 1e-3) == pytest.approx(1e-3)


def test_energy_lost_in_a_snap_through_is_work_of_the_mean_unbalanced_force():
    """Out of balance by 3 where it begins and by 1 where it ends; one that has turned since counts for nothing."""
    way = snap_through._Motion.__new__(snap_through._Motion)
    way.problem, way.dissipated, way._pull = SimpleNamespace(comm=MPI.COMM_SELF), 0.0, np.array([3.0, 0.0])
    way._add_dissipation(np.zeros(2), np.array([2.0, 5.0]), np.array([1.0, 0.0]))
    assert way.dissipated == pytest.approx((3 + 1) / 2 * 2)
    way._pull = np.array([-3.0, 0.0])
    way._add_dissipation(np.zeros(2), np.array([2.0, 5.0]), np.array([1.0, 0.0]))
    assert way.dissipated == pytest.approx(4 + 1 / 2 * 2)


def test_a_failed_snap_through_restores_history_variables():
    """One viscous solution has advanced it; that is no rest."""
    path = fx.Process(sheet(RELAXES, elements=(4, 1))).run(
        [Stage("blow", control="air", until=fx.pole_height(0.2), speed=0.1)], progress=False)
    with path.problem.state_context(path.last) as problem:
        before = problem.history.variables
        with pytest.raises(snap_through.NoEquilibrium):
            snap_through.snap_through(path.record.curve, path.last, 0.01, False, snap_through.SnapThrough(), 1)
        assert all(one is other for one, other in zip(problem.history.variables, before, strict=True))


def test_state_context_restores_history_variables():
    path = fx.Process(sheet(RELAXES, elements=(4, 1))).run(
        [Stage("blow", control="air", until=fx.pole_height(0.2), speed=0.1)], progress=False)
    problem, before = path.problem, path.problem.history.variables
    with problem.state_context(path.states[1]):
        assert any(inside is not outside for inside, outside in zip(problem.history.variables, before, strict=True))
    assert all(restored is held for restored, held in zip(problem.history.variables, before, strict=True))


def test_every_mutant_stands_in_its_file(monkeypatch):
    monkeypatch.syspath_prepend(Path(__file__).parents[1] / "benchmarks")
    from mutants import missing
    assert missing() == []


def test_a_state_with_an_inverted_element_is_refused(monkeypatch):
    path = fx.trace(treloar((4, 1)), until=fx.pole_height(0.2), progress=False)
    monkeypatch.setattr(Problem, "has_inverted_element", lambda *_: True)
    with path.problem.state_context(path.last), pytest.raises(Failure, match="inside out"):
        path.record.curve.step(path.last, 1e-3)


def test_a_step_of_a_flow_ends_at_the_first_of_two_targets():
    """Both lie within its first step; whichever is named first."""
    near, far = fx.pole_height(0.2), fx.pole_height(0.25)
    for through in ([near, far], [far, near]):
        stage = Stage("flow", control="air", amplitudes={fx.enclosed_volume: [(0, 0), (1, 1.0)]}, intermediate=through,
                      step=fx.StepControl(length=1.0))
        path = fx.Process(sheet(RELAXES, elements=(4, 1))).run([stage], progress=False, accuracy=0.5)
        assert path.target_state(near).time < path.target_state(far).time


def test_a_figure_is_the_current_one_of_pyplot(monkeypatch):
    """`plot_wall()` and then `plt.gcf().savefig(...)`, as scripts do."""
    import matplotlib
    matplotlib.use("Agg")
    from matplotlib import pyplot
    pyplot.close("all")
    axes = fx.NeoHookean(c10=0.4).plot()
    assert pyplot.gcf() is axes.figure and len(pyplot.gcf().axes[0].lines) == 3 and axes._repr_png_()
    pyplot.close("all")
