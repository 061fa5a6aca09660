"""Gap closures and reduced contact in C: the same values as array operations (`reference.reduced_contact`)."""

from types import SimpleNamespace

import numpy as np
import pytest
from mpi4py import MPI
from reference.reduced_contact import ReferencePoints

import formingx as fx
from formingx.extensions.contact_events.reduced_contact import CondensedPoints, ToolFrame
from formingx.physics.contact_law import ContactStatus, Law


def system(seed):
    """Points of one elastic body on curved tools, the reference, the tools, statuses and random vectors (m, 2)."""
    random = np.random.default_rng(seed)
    m = int(random.integers(2, 9))
    half, angle, stiff = random.uniform(-1, 1, (2 * m, 2 * m)), random.uniform(0, 6, m), random.uniform(0, 1)
    S = stiff * (random.random((m, 1, 1)) < 0.5) * random.uniform(-0.2, 0.2, (m, 2, 2))
    C = half @ half.T + np.eye(2 * m)
    if seed % 3 == 0:                                       # a point on a rigid support
        C[:2], C[:, :2] = 0.0, 0.0
    friction = random.choice([np.inf, 0.3, 0.1, 0.0], m)
    reference = ReferencePoints(friction, np.full(m, 1e-3), random.random(m) < 0.3, S, C)
    points = CondensedPoints([SimpleNamespace(comm=MPI.COMM_SELF, points=np.zeros((m, 2)))], 0, 0, None)
    points.friction, points.elastic_slip, points._pulls = friction, reference.elastic_slip, reference.pulls
    points._S, points._C = S, C
    normal = np.column_stack([np.cos(angle), np.sin(angle)])
    near = ToolFrame(normal, normal[:, ::-1] * (-1.0, 1.0), random.uniform(-0.1, 0.1, m) * (random.random(m) < 0.5),
                     random.uniform(-1, 1, m))
    status = np.where(np.isinf(friction), ContactStatus.STICKS, random.integers(-1, 2, m))
    status[random.random(m) < 0.2] = ContactStatus.FREE
    N = random.choice([0.0, 1.0], m) * random.uniform(0, 2, m)
    T = np.minimum(friction, 1.0) * N * np.where(status == 0, random.choice([1.0, 0.5], m), status)
    force = (N[:, None] * near.normal + T[:, None] * near.tangent) * (status != ContactStatus.FREE)[:, None]
    return points, reference, near, status, force, *random.uniform(-1, 1, (2, m, 2))


@pytest.mark.parametrize("seed", range(60))
def test_forces_rates_and_changes_are_those_of_array_operations(seed):
    points, reference, near, status, force, u, to = system(seed)
    with np.errstate(over="ignore"):
        for found, expected in ((points.forces_at_end(u, status, near, force, to),
                                 reference.forces_at_end(u, status, near, force, to)),
                                (points.change(status, near, force, u), reference.change(status, near, force, u))):
            for a, b in zip(found, expected, strict=True):
                np.testing.assert_allclose(a, b, rtol=1e-9, atol=1e-9)
        found, expected = points.rates(u, status, near, force), reference.rates(u, status, near, force)
    assert (found is None) == (expected is None)
    for a, b in zip(found or (), expected or (), strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-9, atol=1e-9)


def test_statuses_change_in_these_systems():
    """The comparison above is one of searches that open, stick and slide points, and fail now and then."""
    changed, failed = set(), 0
    for seed in range(60):
        points, _, near, status, force, u, _ = system(seed)
        found = points.rates(u, status, near, force)
        failed += found is None
        changed |= set() if found is None else {(int(a), int(b)) for a, b in zip(status, found[2]) if a != b}
    assert {(0, 2), (0, 1), (1, 0), (-1, 0), (1, 2)} <= changed and 0 < failed < 30


def test_forces_that_do_not_exist_are_not_numbers():
    """A stiffness that cancels the compliance of a point leaves no motion."""
    points, _, near, status, force, u, to = system(1)
    m = len(status)
    points._C, points._S = np.eye(2 * m), np.tile(np.eye(2), (m, 1, 1))
    near = near._replace(curvature=np.zeros(m))
    same, outside = points.forces_at_end(u, status, near, force, to)
    assert same is force and np.isnan(outside).all() and points.rates(u, status, near, force) is None


class _Arrays(Law):
    """Law whose distances are computed in array operations only."""

    profile = None


@pytest.mark.parametrize("shift", [0.0, "each"])
@pytest.mark.parametrize("tool", [fx.tools.cup(radius=1.0, depth=1.0, mouth=0.1, fillet=0.2),
                                  fx.tools.sphere(radius=0.5), fx.Tool([(0, 0), (1, 0), (1, 1), (0, 1)], closed=True)])
def test_gap_closures_are_those_of_array_operations(tool, shift):
    """To the last bit: of points that come, that are open or closed, inside or away, and of one point (`crossing`)."""
    random, n, theta = np.random.default_rng(2), 400, 1e-2
    x, w, free = random.uniform(-0.2, 1.3, (n, 2)), random.normal(size=(n, 2)), random.random(n) < 0.8
    shift = random.uniform(0, 0.1, n) if shift == "each" else shift
    laws = [kind(tool, np.inf, 1.0, theta, 1e-3, shift) for kind in (Law, _Arrays)]
    assert [law.profile for law in laws] == [tool, None]
    times, expected = (law.gap_closures(x, w, free, 0.3) for law in laws)
    np.testing.assert_array_equal(times, expected)
    came = np.flatnonzero(times < 0.3)
    assert 20 < len(came) < n and free[came].all()
    for i in came:
        there = x[i] + times[i] * w[i]
        found, again = (law.gap_closure(i, there, w[i], -0.01, 1e-3, 3) for law in laws)
        assert found == pytest.approx(again, rel=1e-12, abs=1e-15)


@pytest.mark.parametrize("pulls", [False, True])
def test_the_frame_of_points_is_that_of_array_operations(pulls):
    """Normals, curvatures and missing penetrations of points under pressure, little pressure and tension."""
    random, n = np.random.default_rng(3), 60
    tool = fx.tools.cup(radius=1.0, depth=1.0, mouth=0.1, fillet=0.2)
    x, force, scale = random.uniform(-0.2, 1.3, (n, 2)), random.normal(size=(n, 2)), random.uniform(1, 2, n)
    k, shift = random.choice([1.0, 50.0], n), random.uniform(0, 0.1, n)
    frames = []
    for kind in (Law, _Arrays):
        law = kind(tool, np.inf, k, 1e-2, 1e-3, shift, pulls)
        points = CondensedPoints([SimpleNamespace(comm=MPI.COMM_SELF, points=x, law=law, scale=scale)], 0, 0, None)
        points.choose([np.arange(n)])
        frames.append(points.tool_frame(x, force))
    for a, b in zip(*frames, strict=True):
        np.testing.assert_array_equal(a, b)
