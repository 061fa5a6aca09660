"""Contact at Gauss points of the facets: areas, derivatives, ranks, comparison with contact at the nodes."""

import numpy as np
import pytest
from conftest import run_script
from test_contact import cup
from test_derivatives import difference, random_state, residual

import formingx as fx
from formingx.problem.problem import Problem
from formingx.results.files.fields import Fields


@pytest.mark.quick
@pytest.mark.parametrize("points", [1, 3, 4])
def test_areas_are_those_of_the_face(points):
    contact = Problem(cup("none", elements=(5, 1), points=points)).contacts[0]
    assert len(contact.points) == 5 * points
    assert contact.rule.area.sum() == pytest.approx(np.pi * 10.0**2, rel=1e-12)
    assert contact.rule.lengths.sum() == pytest.approx(10.0, rel=1e-12)
    assert contact.points[:, 1] == pytest.approx(0.3, rel=1e-12)


@pytest.mark.quick
@pytest.mark.parametrize("friction", ["none", "stick", 0.3])
def test_tangent_is_derivative_of_residual(friction):
    """A face all over the floor of a flat cup, some of its points in the ramp."""
    problem = Problem(cup(friction, elements=(4, 1), depth=0.05, fillet=0.0, points=3, ramp=0.5, penalty=3.0))
    x, d = random_state(problem, size=2e-3)
    assert np.sum(problem.contacts[0].tractions(x.array_r, 0.1).normal > 0) > 3
    out = problem.x.duplicate()
    problem.tangent(x, 0.1).mult(d, out)
    free = np.setdiff1d(np.arange(len(out.array_r)), problem.constrained)
    found = difference(residual(problem, 0.1), x, d, 1e-6)
    np.testing.assert_allclose(out.array_r[free], found[free], atol=2e-6 * np.abs(found).max())


@pytest.mark.parametrize("points", ["nodes", pytest.param(3, id="3 Gauss points")])
def test_unit_forces_are_added_forces(points):
    """A column for each component of each point: what such a force in place of the law's adds to the residual."""
    problem = Problem(cup("none", elements=(4, 1), points=points))
    face, x = problem.contacts[0], random_state(problem)[0]
    chosen = np.arange(len(face.points))[1:-1:2]
    found, before = problem.contact.unit_forces([chosen]), residual(problem, 0.1)(x)
    columns = []
    for point in chosen:
        for way in range(2):
            forces = np.full(face.points.shape, np.nan)             # NaN: the law acts; away from the tool, with 0
            forces[point] = np.eye(2)[way]
            face.applied = forces
            columns.append(residual(problem, 0.1)(x) - before)
            face.applied = None
    assert found.shape == (len(before), 2 * len(chosen)) and np.sum(np.abs(found).max(0) > 0.1) >= len(chosen)
    np.testing.assert_allclose(found, np.transpose(columns), atol=1e-12 * max(1.0, np.abs(before).max()))


def test_forces_are_those_of_contact_at_nodes():
    """A cup blown with friction: with as many elements, tool forces and thickness agree."""
    found = []
    for points in ("nodes", 3):
        path = fx.trace(cup(0.3, points=points), until=fx.pressure(8.0), step=fx.StepControl(target=8), progress=False)
        found.append((path.last.measures["tool_force"], path.profile().thickness_ratio.min()))
        assert path.counts.failures < 10 and len(path) < 80, path.counts
    assert found[1] == pytest.approx(found[0], rel=1e-2)


def test_table_is_that_of_contact_at_nodes():
    """A cup's floor takes the pressure of the air; both tables are of one face, and so are the fields for ParaView."""
    tables = []
    for points in ("nodes", 3):
        path = fx.trace(cup("none", depth=1.5, points=points), until=fx.pressure(8.0), progress=False)
        tables.append(path.contact())
        shown = Fields(path).evaluate(path.last)["contact_pressure"]
        assert shown.max() == pytest.approx(tables[-1].pressure.max(), rel=1e-12) and np.mean(shown == 0) > 0.4
    nodes, gauss = tables
    flat = gauss.reference_points[:, 0] < 5
    assert flat.sum() > 25 and gauss.pressure[flat] == pytest.approx(np.full(flat.sum(), 8.0), rel=2e-3)
    height = np.interp(gauss.reference_points[:, 0], nodes.reference_points[:, 0], nodes.points[:, 1])
    assert height == pytest.approx(gauss.points[:, 1], abs=1e-2)


@pytest.mark.parametrize("points", [0, 10**9])
def test_no_points_and_too_many_are_refused(points):
    with pytest.raises(fx.InputError, match="points"):
        cup("none", points=points)


def plugged():
    """A ball with friction, pushed into a clamped sheet.

    Round-off of a position, 1e-16 of 10, is 3e-11 of the ramp 1e-4 h0 that tractions grow over; in one of 1e-5 h0 the
    force differed between ranks by 2e-10 to 1e-9. (Solved to less than 1e-9, round-off would decide how often some
    ranks iterate.)
    """
    plug = fx.tools.sphere(radius=5.0, z=0.3)
    return fx.Scene(mesh=fx.mesh.disc(radius=10.0, thickness=0.3, elements=(12, 1)),
                    materials=fx.MooneyRivlin(c10=50, c01=15), supports=[fx.Symmetry("axis"), fx.Clamped("rim")],
                    contacts=[fx.Contact("top", plug, 0.3, direction=(0, -1), points=3, ramp=1e-4)])


def numbers(path):
    """At both targets. (How far other steps go is decided by tangents, which are known less well than states.)"""
    table, columns = path.contact(), ("tool_force", "pole_height", "contact_length")
    met = [path.target_state(fx.travel(t)).measures[c] for t in (2.5, 3.0) for c in columns]
    return np.concatenate([met, table.pressure, table.friction, table.points.ravel()])


def push(folder, start=None):
    """Make, or go on with, a run that leaves its states in a folder."""
    scene = plugged()
    path = fx.trace(scene, until=fx.travel(3.0), intermediate=[fx.travel(2.5)], progress=False,
                    tolerances=fx.Tolerances(residual=1e-9), start=start and fx.load(start, scene, state=4))
    path.save(folder)
    return path


ON_RANKS = """
import sys
sys.path.insert(0, "tests")
from test_contact_points import push
push(*sys.argv[1:])
"""


@pytest.mark.thorough
def test_ranks_agree_and_continue_runs_of_other_ranks(tmp_path):
    """A facet's points are on one rank, its nodes may be on another."""
    one, two, three, end = (tmp_path / name for name in ("one", "two", "three", "end"))
    path = push(one)
    expected = numbers(path)
    assert np.sum(path.contact().friction != 0) > 5
    run_script(ON_RANKS, two, ranks=2)
    run_script(ON_RANKS, three, two, ranks=3)
    for path in (fx.load(two, plugged()), fx.load(three, plugged()), push(end, three)):
        np.testing.assert_allclose(numbers(path), expected, rtol=1e-9, atol=1e-9 * np.abs(expected).max())


def test_saved_histories_belong_to_their_points():
    """Rows in another order are found, and moved points are refused."""
    history = Problem(plugged()).history.parts[0]
    data = history.save(history.get())
    data["penalty"] = np.arange(float(len(data["points"])))[::-1]
    data["points"] = np.array(data["points"])[::-1]
    assert np.array_equal(history.load(data).penalty, data["penalty"][::-1])
    data["points"] = data["points"] + 1e-6
    with pytest.raises(fx.InputError, match="a contact point of the scene is not in it"):
        history.load(data)
