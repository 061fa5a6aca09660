"""Layers of a sheet in three dimensions that meet: the run ends before they pass through each other."""

from itertools import product
from time import process_time

import numpy as np
import pytest
from conftest import run_json
from test_tubes import scene

import formingx as fx
from formingx.extensions.space.crossing import SelfPenetration, crossings


def of_all_pairs(points, triangles, depth):
    """Depths of the edges of all pairs of triangles without a common vertex, each pair compared."""
    found = []
    for s, t in product(triangles, triangles):
        A = points[t]
        normal = np.cross(A[1] - A[0], A[2] - A[0])
        normal /= np.linalg.norm(normal)
        for p, q in () if set(s) & set(t) else zip(points[s], points[np.roll(s, -1)]):
            d, e = (p - A[0]) @ normal, (q - A[0]) @ normal
            if d * e < 0 and min(abs(d), abs(e)) > depth:
                x = p + d / (d - e) * (q - p)
                if all(np.cross(A[k - 2] - A[k], x - A[k]) @ normal > 0 for k in range(3)):
                    found.append(min(abs(d), abs(e)))
    return sorted(found)


def test_crossings_are_those_of_all_pairs():
    rng = np.random.default_rng(4)
    points = rng.uniform(size=(60, 3))
    triangles = np.array([rng.choice(60, 3, replace=False) for _ in range(45)])
    found = crossings(points, triangles, 0.03)
    assert len(found) > 100 and sorted(found[:, 3]) == pytest.approx(of_all_pairs(points, triangles, 0.03))


def test_depth_of_an_edge_counts_from_half_the_wall_or_from_the_edges():
    points = np.array([[0, 0, 0], [4, 0, 0], [0, 4, 0], [1, 1, -1], [1, 1, 1], [2, 1, 1.0]])
    pair = np.array([[0, 1, 2], [3, 4, 5]])
    assert crossings(points, pair, 0.1) == pytest.approx(np.array([[1, 1, 0, 1], [1.5, 1, 0, 1]]))
    assert len(crossings(points, pair, 0.1, wall=0.9)) == 2 and len(crossings(points, pair, 1.1)) == 0
    assert len(crossings(points, pair, 0.1, wall=1.05)) == 2                # 0.4 of the longest edge is less
    near, far = points + 0.0, points + np.repeat([[0.0, 0, 0], [9, 0, 0]], 3, axis=0)       # reference positions
    assert len(crossings(points, pair, 0.1, 1.05, near, crease=5.0)) == 0   # a crease within the wall
    assert len(crossings(points, pair, 0.1, 1.05, far, crease=5.0)) == 2
    assert len(crossings(points, pair, 0.1, 0.9, near, crease=5.0)) == 2    # deeper than the wall
    assert len(crossings(points * [1, 1, 0.1], pair, 0.05, wall=0.2)) == 0  # as flat as layers at a pinch
    assert len(crossings(points + np.repeat([[0.0, 0, 0], [0, 0, 3]], 3, axis=0), pair, 0.1)) == 0


def test_states_that_cross_have_a_reason(monkeypatch):
    """A tube whose nodes are moved through each other, or through a plane of symmetry."""
    path = fx.trace(scene(), until=fx.enclosed_volume(1e3), progress=False)
    surface, x = path.problem.forms, path.last.x
    check, X = SelfPenetration(surface), surface.whole.reference
    assert list(check.reasons(x)) == []
    low, positions = X[:, 2] < -60, surface.whole.positions(x)
    for moved, words in ((positions - [20.0, 0, 0], "crosses the plane of symmetry x = 0"),
                         (positions * [1, 1, -1] + [2.0, 1, -120], "passes through itself at (x, y, z) = (")):
        monkeypatch.setattr(surface.whole, "positions", lambda fields, moved=moved: np.where(
            low[:, None], moved, positions))
        (found,) = check.reasons(x)
        assert words in found


def balloons(size=0.3, waist=0.25):
    """Two balloons side by side, joined by a waist, as one whole sheet."""
    turn = np.pi - np.arcsin(waist)
    t = np.linspace(-turn, turn, 30)[:-1]
    side = np.column_stack([np.cos(t) - np.cos(turn), np.sin(t)])
    outline = np.concatenate([side, -side])
    sheet = fx.mesh.sheet(outline.tolist(), size=size, names=["rim"] * len(outline))
    return fx.Scene(mesh=sheet, thickness=0.01, materials=fx.MooneyRivlin(c10=1.0, c01=0.2), model=fx.Membrane(),
                    supports=[fx.SimplySupported("rim")], loads=[fx.Pressure("bottom")])


def blown(height=2.2, **more):
    return fx.trace(balloons(), until=fx.displacement(height, at=(0.97, 0.0), component="z"), progress=False, **more)


def test_two_balloons_end_where_they_meet():
    with pytest.raises(fx.ConvergenceError, match=r"the sheet passes through itself at \(x, y, z\) = \(.*before they"
                                                  r" meet.*allow_inadmissible=True") as caught:
        blown()
    path = caught.value.path
    wall = path.wall()
    assert len(path) > 3 and path.last.measures["pressure"] > 0
    assert len(of_all_pairs(wall.deformed_points, wall.triangles, 0.01)) == 0


def test_check_of_layers_takes_a_twentieth_of_the_time(monkeypatch):
    spent, reasons = [0.0], SelfPenetration.reasons

    def timed(check, fields):
        begin = process_time()
        found = list(reasons(check, fields))
        spent[0] += process_time() - begin
        return iter(found)
    monkeypatch.setattr(SelfPenetration, "reasons", timed)
    begin = process_time()
    with pytest.raises(fx.ConvergenceError):
        blown()
    assert 0 < spent[0] < 0.05 * (process_time() - begin)


@pytest.mark.thorough
def test_balloons_end_in_the_same_state_on_two_ranks():
    script = """
import json, sys
sys.path.insert(0, "tests")
import formingx as fx
from test_layers import blown
try:
    found = []
    blown()
except fx.ConvergenceError as error:
    found = error.path["pressure"].tolist()
    if error.path.problem.comm.rank == 0:
        print(json.dumps(found))
"""
    one, two = run_json(script, 1), run_json(script, 2)
    assert two == pytest.approx(one, rel=1e-8)
