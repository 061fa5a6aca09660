"""Contact events: several gap closures in one step, predicted; the core without this extension."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from conftest import printed_by
from mpi4py import MPI
from test_contact import cup, form
from without import run_without

import formingx as fx
from formingx.contact.step_limit import TrialStep
from formingx.extensions.contact_events.event_sequence import ContactEventSequence, PathSegment
from formingx.extensions.contact_events.reduced_contact import BodyResponse, CondensedPoints, ToolFrame
from formingx.physics.contact_law import ContactStatus
from formingx.problem.problem import Problem

tools = fx.tools
WITHOUT = """
import formingx as fx
mould = fx.tools.cup(radius=10.0, depth=5.0, mouth=0.3, fillet=1.0)
scene = fx.Scene(mesh=fx.mesh.disc(radius=10.0, thickness=0.3, elements=(20, 1)),
                 materials=fx.MooneyRivlin(c10=50.0, c01=15.0), loads=[fx.Pressure("bottom")],
                 supports=[fx.Symmetry("axis"), fx.Clamped("rim")], contacts=[fx.Contact("top", mould, "stick")])
path = fx.trace(scene, until=fx.pressure(30.0), progress=False)
assert not path.problem.contact.limit.predicts_events
print(fx.__file__, path.counts.steps, *path.profile().thickness)
"""


def response_at(curve, state):
    """Return the linearised response of the body ahead of a state of a curve."""
    assert curve.factorise_one_sided(state)
    return BodyResponse(curve, state, *(curve.problem.x.duplicate() for _ in range(2)))


def test_contact_events_in_one_step():
    """A step with many gap closures gives the walls of one closure a step, in a third of the states."""
    many, one = (form(cup("stick", (30, 1), nodes_per_step=n), 30.0, largest=largest)
                 for n, largest in ((None, np.inf), (1, 0.02)))
    single = form(cup("stick", (30, 1), nodes_per_step=1), 30.0)
    inside = many.profile().reference_radius < 9.7
    off = np.abs(many.profile().thickness / one.profile().thickness - 1)[inside]
    assert off.max() < 6e-4             # 3.7e-3 where one may slide by 1e-2 of its length of face before it sticks
    assert 3 * many.counts.steps < 1.2 * single.counts.steps and many.counts.failures < 0.1 * single.counts.steps


def test_points_that_would_slip_before_the_end_of_a_step_stick():
    """A step in which several gaps close is not repeated because the last but one of these points slipped."""
    path = form(cup("stick", (60, 2)), 30.0)
    assert path.counts.failures <= 1                        # 3 where all closures of the last 5 % carry no friction


def test_a_predicted_step_ends_near_its_state():
    """The bent path ends nearer to the state found than the tangent; unit forces reproduce the compliance columns."""
    path = form(cup("stick", (30, 1)), 8.0)
    problem, curve = path.problem, path.record.curve
    k = max(range(2, len(path.states)), key=lambda k: path["contact_length"][k] - path["contact_length"][k - 1])
    old, new = path.states[k - 1], path.states[k]
    touching = problem.contacts[0].touching(old.x, old.control)
    point = int(np.flatnonzero(~touching & (problem.contacts[0].rule.area > 0))[0])
    with problem.state_context(old):
        length = curve.progress(old, new)
        limit = problem.contact.limit
        trial = TrialStep(old.x, old.control, old.direction, old.slope, length, limit.predictor.predict(curve, old))
        limit.length(trial)
        dx, dc = limit.prepare(trial)
        V, steps = response_at(curve, old).solve(problem.contact.unit_forces([np.array([point])]))
        F = problem.x.duplicate()
        x = problem.x.duplicate()
        h = 1e-6
        x.array_w[:] = old.x
        before = _residual(problem, x, old.control, F)
        x.array_w[:] = old.x + h * V[:, 1]
        after = _residual(problem, x, old.control + h * steps[1], F)
    forces = np.zeros_like(problem.contacts[0].points)
    forces[point, 1] = 1.0
    unit = np.zeros(len(before))
    problem.contacts[0].add(unit, forces)
    free = np.ones(len(before), dtype=bool)                  # of kinks: points that touch are as in the step ahead
    free[problem.contacts[0].rule.dofs[touching]] = False
    assert np.abs((after - before) / h - unit)[free].max() < 1e-4
    straight = replace(new, x=old.x + length * old.direction, control=old.control + length * old.slope)
    bent = replace(straight, x=straight.x + dx, control=straight.control + dc)
    assert curve.distance(new, bent) < 0.5 * curve.distance(new, straight)


def test_sliding_points_move_as_in_the_tangent():
    """Sliding points of the reduced problem move as in the tangent; no point moves in a step of no length."""
    mould = tools.cup(radius=38.0, depth=60.0, mouth=1.2, draft=6.0, fillet=5.0, lip=2.0)
    plug = tools.male(radius=22.0, height=120.0, base=-120.0, draft=3.0, fillet=6.0)
    scene = fx.Scene(mesh=fx.mesh.disc(radius=40.0, thickness=1.2, elements=(20, 1)), materials=fx.NeoHookean(c10=0.4),
                     supports=[fx.Symmetry("axis"), fx.Clamped("rim")],
                     contacts=[fx.Contact("top", mould, "stick", separates=False),
                               fx.Contact("bottom", plug, 0.3, direction=(0, 1))])
    path = fx.trace(scene, until=fx.travel(30.0), step=fx.StepControl(target=8), progress=False)
    problem, curve, n = path.problem, path.record.curve, path.problem.n_owned
    assert path.counts.failures <= 3                        # from rest, with 16 nodes flat on the plug, it took 6
    sliding = 0
    for old in path.states[2:-1]:
        with problem.state_context(old):
            faces = problem.contact.faces
            ahead = ContactEventSequence(faces, n, old.x, old.control, old.direction, old.slope,
                                         response_at(curve, old), 4)
            law = faces[1].tractions(old.x[:n], old.control)
            nothing = ahead.bend(1e-12)
            assert nothing is not None and np.abs(nothing[0]).max() < 1e-8
            if len(law.sense[law.normal > 0]) > 1 and np.all(law.sense[law.normal > 0] != 0):
                speed = faces[1].relative_motion(old.direction[:n], old.slope)
                change = np.abs(np.subtract(ahead.positions(1e-6)[1], ahead.positions(0.0)[1]) / 1e-6 - speed).max()
                assert change < 1e-3 * np.abs(speed).max()
                sliding += 1
    assert sliding > 3


@pytest.mark.parametrize("before, force, moves, after, rate", [
    (1, (1.0, 0.3), (0.0, 1.0), 1, (0.0, 0.0)),             # slides on
    (1, (1.0, 0.3), (0.0, -1.0), ContactStatus.STICKS, (0.0, -1.0)),      # turns back
    (ContactStatus.STICKS, (1.0, 0.3), (0.0, 1.0), 1, (0.0, 0.0)),        # is at the limit of friction
    (ContactStatus.STICKS, (1.0, 0.3), (0.0, -1.0), ContactStatus.STICKS, (0.0, -1.0)),
    (ContactStatus.STICKS, (0.0, 0.0), (-1.0, 0.0), ContactStatus.FREE, (0.0, 0.0))])   # goes away
def test_status_rates_of_a_point_that_sticks_slides_or_separates(before, force, moves, after, rate):
    """A point of unit compliance with mu = 0.3; forces, motions and rates are (normal, tangential)."""
    face = SimpleNamespace(comm=MPI.COMM_SELF, points=np.zeros((1, 2)))
    points = CondensedPoints([face], 0, 0, None)
    points._C, points._S, points._pulls = np.eye(2), np.zeros((1, 2, 2)), np.zeros(1, dtype=bool)
    points.friction, points.elastic_slip = np.array([0.3]), np.zeros(1)
    near = ToolFrame(np.array([[1.0, 0.0]]), np.array([[0.0, 1.0]]), np.zeros(1), np.zeros(1))
    found = points.rates(np.array([moves]), np.array([before]), near, np.array([force]))
    assert found is not None and found[2] == [after] and found[0][0] == pytest.approx(rate)


def _residual(problem, x, control, F):
    problem.residual(x, control, F)
    return F.array_r.copy()


def test_events_of_sliding_beside_sticking_points(monkeypatch):
    """A plug with friction beside a rough mould takes fewer steps to the same wall; no event precedes its step."""
    mould = fx.tools.cup(radius=38.0, depth=60.0, mouth=1.2, draft=6.0, fillet=5.0, lip=2.0)
    tool = fx.tools.male(radius=22.0, height=120.0, base=-120.0, draft=3.0, fillet=6.0)
    times, find = [], ContactEventSequence.next

    def recorded(sequence, k, length):
        closure = find(sequence, k, length)
        times.append(sequence.ends if closure is None else closure.arc_length)
        return closure

    monkeypatch.setattr(ContactEventSequence, "next", recorded)
    many, one = (fx.trace(fx.Scene(
        mesh=fx.mesh.disc(radius=40.0, thickness=1.2, elements=(30, 1)), materials=fx.MooneyRivlin(c10=0.35, c01=0.05),
        supports=[fx.Symmetry("axis"), fx.Clamped("rim")], contacts=[
            fx.Contact("top", mould, "stick", separates=False, nodes_per_step=n),
            fx.Contact("bottom", tool, 0.3, direction=(0, 1), nodes_per_step=n)]),
        until=fx.travel(48.0), step=fx.StepControl(target=8), progress=False) for n in (None, 1))
    assert many.counts.steps < 0.7 * one.counts.steps and min(times) >= 0
    assert many.profile().thickness == pytest.approx(one.profile().thickness, rel=2e-3)


@pytest.mark.thorough
def test_events_of_coulomb_friction_on_a_mould():
    """A deep cup with friction has the wall of one gap closure a step in short steps, in a fraction of the states."""
    many, one = (fx.trace(fx.Scene(
        mesh=fx.mesh.disc(radius=10.0, thickness=0.3, elements=(30, 1)), materials=fx.MooneyRivlin(c10=50.0, c01=15.0),
        supports=[fx.Symmetry("axis"), fx.Clamped("rim")], loads=[fx.Pressure("bottom")], contacts=[fx.Contact(
            "top", tools.cup(radius=10.0, depth=10.0, mouth=0.3, draft=5.0, fillet=2.0), 0.3, nodes_per_step=n)]),
        until=fx.pressure(30.0), step=step, progress=False)
        for n, step in ((None, fx.StepControl(target=8)), (1, fx.StepControl(length=0.02, largest=0.02))))
    inside = many.profile().reference_radius < 9.7
    off = np.abs(many.profile().thickness / one.profile().thickness - 1)[inside]
    assert off.max() < 8e-4             # 1.2e-3 if points of a mould may miss their closure by 1e-2 of their length
    assert many.counts.steps < 30                           # 61 with one gap closure a step, in steps of any length


def vacuum_formed(nodes_per_step):
    """Return the path of the sheet of demos/male_mould.py with friction up to 20 psi."""
    wide = 4.0 + 3.0 * np.tan(np.radians(10.0))
    mould = tools.Tool([(10.0, 0.0), (10.0, -3.05), (wide, -3.05), (4.0, -0.05), (0.0, -0.05)], [0, 1.0, 1.0, 1.5, 0])
    scene = fx.Scene(mesh=fx.mesh.disc(radius=10.0, thickness=0.3, elements=(20, 1)),
                     materials=fx.MooneyRivlin(c10=50.0, c01=15.0), supports=[fx.Symmetry("axis"), fx.Clamped("rim")],
                     loads=[fx.Pressure("top")],
                     contacts=[fx.Contact("bottom", mould, 0.3, nodes_per_step=nodes_per_step)])
    return fx.trace(scene, until=fx.pressure(20.0), intermediate=[fx.pressure(p) for p in (2.0, 5.0, 10.0)],
                    step=fx.StepControl(target=8, length=0.1), progress=False)


@pytest.mark.thorough
def test_a_step_ends_where_points_stick_after_they_slipped():
    """A sheet slips over the top of a male mould, sticks there, and has the wall of one gap closure a step."""
    many, one = (vacuum_formed(nodes_per_step) for nodes_per_step in (None, 1))
    assert many.counts.steps < 0.8 * one.counts.steps
    assert many.profile().thickness[0] == pytest.approx(one.profile().thickness[0], rel=1e-3)


def test_a_plug_with_friction_takes_one_gap_closure_a_step():
    """With a mould and a plug under Coulomb friction, several gaps close in one step on the mould alone."""
    mould = fx.tools.cup(radius=38.0, depth=60.0, mouth=1.2, draft=6.0, fillet=5.0, lip=2.0)
    tool = fx.tools.male(radius=22.0, height=120.0, base=-120.0, draft=3.0, fillet=6.0)
    scene = fx.Scene(mesh=fx.mesh.disc(radius=40.0, thickness=1.2, elements=(30, 1)),
                     materials=fx.MooneyRivlin(c10=0.35, c01=0.05), supports=[fx.Symmetry("axis"), fx.Clamped("rim")],
                     contacts=[fx.Contact("top", mould, 0.3), fx.Contact("bottom", tool, 0.3, direction=(0, 1))])
    predictor = Problem(scene).contact.limit.predictor
    assert predictor.active and predictor.allowed == [3, 1]


@pytest.mark.parametrize("friction", ["none", 0.3])
def test_no_events_are_predicted_for_a_plug_without_stick(friction):
    """Contact of a ball at Gauss points without stick: few steps fail (200 of 450 with predicted events)."""
    ball = fx.Contact("top", fx.tools.sphere(radius=4.0, z=0.3), friction, direction=(0, -1), points=3)
    scene = fx.Scene(mesh=fx.mesh.disc(radius=10.0, thickness=0.3, elements=(100, 2)),
                     materials=fx.MooneyRivlin(c10=17.0, c01=1.0), contacts=[ball],
                     supports=[fx.Symmetry("axis"), fx.Clamped("rim")])
    path = fx.trace(scene, until=fx.travel(8.0 if friction == "none" else 0.5), progress=False)
    assert not path.problem.contact.limit.predicts_events and path.counts.failures < 0.2 * path.counts.steps


@pytest.mark.thorough
def test_the_core_without_contact_events(tmp_path):
    """Without the folder the package is imported, and a stuck cup takes a step a gap closure to the same walls."""
    file, steps, *walls = run_without(tmp_path, ["contact_events"], "-c", WITHOUT).split()
    path = form(cup("stick", (20, 1)), 30.0)
    assert file.startswith(str(tmp_path)) and int(steps) > 2 * path.counts.steps
    np.testing.assert_allclose(path.profile().thickness, [float(t) for t in walls], rtol=4e-3)


ON_RANKS = """
import sys
sys.path.insert(0, "tests")
from test_contact import cup, form
path = form(cup("stick", (10, 1), points=3), 20.0)
print(path.problem.contact.limit.predicts_events, path.profile().thickness[0])
"""


@pytest.mark.thorough
def test_events_at_points_between_nodes_on_two_ranks():
    """Points whose nodes are on another rank: all ranks evaluate the contact law together, also where none sticks."""
    (active, one), = (printed.split() for printed in printed_by(ON_RANKS))
    others = [printed.split() for printed in printed_by(ON_RANKS, ranks=2, timeout=200)]
    assert active == "True" and [float(t) for _, t in others] == pytest.approx(2 * [float(one)], rel=1e-6)


def test_anderson_mixing_converges_where_iterations_oscillate():
    """Two coordinates, by an iteration -3 and -0.5 times as far from a fixed point: three find it (Anderson)."""
    fixed, grows = np.array([0.4, -0.2]), np.array([-3.0, -0.5])

    def piece(x):
        none = np.zeros((0, 2))
        return PathSegment(x[0], x[None], np.zeros((1, 2)), np.zeros(0), none, none, none, none, none, (x, x[1]))
    starts = [fixed + offset for offset in ([0.1, 0.3], [-0.3, -0.1], [0.2, 0.05])]
    tried = [(piece(x), piece(fixed + grows * (x - fixed))) for x in starts]
    found = ContactEventSequence._anderson_mixture(SimpleNamespace(_comm=MPI.COMM_SELF), tried)
    np.testing.assert_allclose(found.positions[0], fixed, atol=1e-9)
    np.testing.assert_allclose(found.correction[0], fixed, atol=1e-9)
    np.testing.assert_allclose([found.begins, found.correction[1]], fixed, atol=1e-9)


def test_forces_of_sticking_sliding_and_open_points_together():
    """Five points on tilted tools, of one elastic body: prescribed motions, Coulomb's law and the compliance hold."""
    random = np.random.default_rng(4)
    angle, half = random.uniform(0, 6, 5), random.uniform(-1, 1, (10, 10))
    points = CondensedPoints([SimpleNamespace(comm=MPI.COMM_SELF, points=np.zeros((5, 2)))], 0, 0, None)
    points._C, points._S, points._pulls = half @ half.T + np.eye(10), np.zeros((5, 2, 2)), np.zeros(5, dtype=bool)
    points.friction, points.elastic_slip = np.array([np.inf, 0.3, 0.2, 0.0, 0.3]), np.full(5, 1e-3)
    near = ToolFrame(np.column_stack([np.cos(angle), np.sin(angle)]), np.column_stack([-np.sin(angle), np.cos(angle)]),
                     np.zeros(5), random.uniform(-1, 1, 5))
    status = np.array([ContactStatus.STICKS, ContactStatus.STICKS, -1, 1, ContactStatus.FREE])
    u, to, force = random.uniform(-1, 1, (5, 2)), random.uniform(-1, 1, (5, 2)), near.normal * 2.0
    F, change = points.forces_at_end(u, status, near, force, to)
    dx = u - (points._C @ change.ravel()).reshape(5, 2)
    N, T = (np.einsum("ni,ni->n", F, d) for d in (near.normal, near.tangent))
    assert change == pytest.approx(F - force) and F[4] == pytest.approx(0.0, abs=1e-12)
    assert dx[0] == pytest.approx(to[0])                    # it sticks; the next one after its elastic slip
    slip = 1e-3 * T[1] / (0.3 * (force[1] @ near.normal[1]))
    assert dx[1] == pytest.approx(to[1] + slip * near.tangent[1])
    assert [dx[i] @ near.normal[i] for i in (2, 3)] == pytest.approx(near.beyond[2:4])
    assert T[2:4] == pytest.approx([-0.2 * N[2], 0.0])
