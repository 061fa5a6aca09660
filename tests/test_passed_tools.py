"""No tool passes through a sheet in three dimensions: neither between its nodes, nor through them in a long step."""

from time import process_time

import numpy as np
import pytest
from conftest import run_json

import formingx as fx
from formingx.extensions.space.lagged_steps import LaggedApproach
from formingx.extensions.space.passed_tools import _C, far_off, surface_points
from formingx.extensions.space.surface_mesh import closest_points

MATERIAL = fx.NeoHookean(c10=1.0)
HELD = [fx.SimplySupported("rim"), fx.Symmetry("x0", "x"), fx.Symmetry("y0", "y")]
WRINKLES = fx.Membrane(wrinkles=0.01)


def pushed(tool, friction, size=7.0, travel=25.0):
    sheet = fx.mesh.sheet(fx.mesh.rectangle(100.0, 80.0), size=size)
    scene = fx.Scene(mesh=sheet, thickness=1.0, materials=MATERIAL, supports=[fx.Clamped("rim")], model=WRINKLES,
                     contacts=[fx.Contact("top", tool, friction, direction=(0, 0, -1), name="pin")])
    try:
        return fx.trace(scene, until=fx.travel(travel), progress=False), ""
    except fx.ConvergenceError as error:
        return error.path, str(error)


def pin(half):
    return fx.tools.revolved(fx.Tool([(0.0, 0.0), (half, 0.0), (half, 30.0)])).moved(x=2.3, y=1.7, z=0.5)


def blade(half):
    profile = fx.Tool([(-half, 30.0), (-half, 0.0), (half, 0.0), (half, 30.0)])
    return fx.tools.extruded(profile).moved(x=2.4, z=0.5)


@pytest.mark.parametrize("make, half, friction", [
    pytest.param(pin, 1.6, "stick", marks=pytest.mark.thorough), (pin, 4.5, 0.2), (blade, 1.4, "none")])
def test_pin_that_is_narrower_than_the_triangles_ends_the_run(make, half, friction):
    """Nodes bound the depth of a pin between them: it stays below 0.4 of an edge, and the message says where."""
    path, text = pushed(make(half), friction)
    deepest = (0.5 - path["travel"][-1]) - path.wall().deformed_points[:, 2].min()
    assert deepest > -0.45 * 8.5
    if text:
        assert "the tool of 'pin' passes through the sheet at (x, y, z) = (" in text and "smaller triangles" in text
    else:
        assert deepest > -0.05                               # nodes met it, and the sheet followed


def ribbed(draft, height=4.0):
    """A plug of radius 28 with a narrow rib round its middle, of a height and a draft."""
    wide = 0.2 + height * np.tan(np.radians(draft))
    profile = fx.Tool([(0.0, height), (15.0 - wide, height), (14.8, 0.0), (15.2, 0.0), (15.0 + wide, height),
                       (28.0, height), (28.0, 30.0)])
    return fx.tools.revolved(profile).moved(z=0.5)


def test_triangles_bridge_a_rib_whose_foot_they_meet_and_the_run_says_so():
    """A sheet sticks to a rib that is narrower than its triangles, and to the plug beside it; a higher rib passes."""
    path, text = pushed(ribbed(20.0), "stick", travel=12.0)
    assert not text and path["travel"][-1] == pytest.approx(12.0)
    warned, = (found for found in path.findings() if "bridge" in found.text)
    assert warned.severity == "warning" and warned.about == "pin" and "smaller triangles" in warned.text
    path, text = pushed(ribbed(0.0, height=15.0), "stick", travel=12.0)
    assert "passes through the sheet" in text


@pytest.mark.thorough
def test_pins_are_held_by_small_triangles():
    path, text = pushed(pin(4.5), "stick", size=3.0, travel=8.0)
    assert not text and path.wall().deformed_points[:, 2].min() == pytest.approx(-7.5, abs=0.01)


def cavity(floor, friction, nodes_per_step, pressure=0.4):
    """A sheet over a cone with a thin floor, 14 below."""
    plate = fx.tools.revolved(fx.Tool([(0.0, -14.0 - floor), (27.0, -14.0 - floor), (27.0, -14.0), (0.0, -14.0)]))
    cone = fx.tools.revolved(fx.Tool([(60.0, 0.0), (32.0, 0.0), (26.0, -14.0), (26.0, -14.0 - floor), (60.0, -20.0)]))
    tool = fx.tools.union(cone, plate)
    sheet = fx.mesh.sheet(fx.mesh.circle(35.0, part="quarter"), size=6.0)
    contact = fx.Contact("bottom", tool, friction, name="mould", nodes_per_step=nodes_per_step)
    scene = fx.Scene(mesh=sheet, thickness=1.0, materials=MATERIAL, supports=HELD, model=WRINKLES,
                     loads=[fx.Pressure("top")], contacts=[contact])
    return fx.trace(scene, until=fx.pressure(pressure), progress=False, step=fx.StepControl(length=1.0))


@pytest.mark.parametrize("floor, friction, nodes_per_step", [
    (0.15, "stick", 0.1), *(pytest.param(*case, marks=pytest.mark.thorough) for case in (
        (1.2, "none", 0.1), (1.2, "stick", 0.1), (0.15, "none", 0.01), (2.5, 0.3, 0.1)))])
def test_thin_floor_is_not_passed_in_long_steps(floor, friction, nodes_per_step):
    path = cavity(floor, friction, nodes_per_step)
    assert path.wall().deformed_points[:, 2].min() > -14.05 and path.filling("mould").touching[-1] > 0.3


def test_points_on_the_tool_are_on_its_surface_and_dense():
    sheet = fx.mesh.sheet(fx.mesh.rectangle(2.0, 2.0), size=0.2).domain.geometry.x
    rib = fx.tools.extruded(fx.Tool([(0.3, -0.7), (0.1, -0.3), (-0.1, -0.3), (-0.3, -0.7)]), "x")
    for tool in (fx.tools.revolved(fx.tools.sphere(radius=0.8)), fx.tools.union(
            fx.tools.box(half=(0.9, 0.9), depth=0.5, corner=0.3, fillet=0.2), rib)):
        points = surface_points(tool, 0.1, sheet, 0.2)
        assert np.abs(tool.signed_distance(points)).max() < 1e-3
        from scipy.spatial import cKDTree
        near = points[np.abs(points[:, 2]) < 0.5]
        assert np.quantile(cKDTree(points).query(near, 2)[0][:, 1], 0.99) < 0.1


@pytest.mark.thorough
def test_test_of_passed_tools_takes_a_tenth_of_the_time(monkeypatch):
    spent, passed = [0.0], LaggedApproach.passed

    def timed(*arguments):
        begin = process_time()
        found = passed(*arguments)
        spent[0] += process_time() - begin
        return found
    monkeypatch.setattr(LaggedApproach, "passed", timed)
    begin = process_time()
    cavity(2.5, 0.3, 0.01)
    assert 0 < spent[0] < 0.1 * (process_time() - begin)


def tube_and_pin(half, on, part):
    """A tube with air inside, and a blade along y or a vertical finger inside that moves along x by 8."""
    if on == "outer":
        tool, way = fx.tools.extruded(fx.Tool([(60.0, half), (16.6, half), (16.6, -half), (60.0, -half)])), -1
    else:
        finger = [(0.0, -20.0), (half, -20.0), (half, 20.0), (0.0, 20.0)]
        tool, way = fx.tools.revolved(fx.Tool(finger)).moved(x=15.0 - half, y=2.3), 1
    supports = [fx.Symmetry(name, name[0]) for name in {"quarter": ("x0", "y0"), "half": ("x0",)}.get(part, ())]
    columns = {"quarter": 5, "half": 10, "whole": 20}[part]
    scene = fx.Scene(mesh=fx.mesh.tube(radius=16.0, length=80.0, elements=(20, columns), part=part), thickness=1.0,
                     materials=MATERIAL, supports=[fx.Clamped("neck"), fx.Clamped("end"), *supports], model=WRINKLES,
                     loads=[fx.Pressure("inner", name="air")],
                     contacts=[fx.Contact(on, tool.moved(z=-41.7), "stick", direction=(way, 0, 0), name="pin")])
    stages = [fx.Stage("air", control="air", until=fx.pressure(0.01)),
              fx.Stage("push", control="pin", until=fx.travel(8.0))]
    try:
        return fx.Process(scene).run(stages, progress=False), ""
    except fx.ConvergenceError as error:
        return error.path, str(error)


@pytest.mark.parametrize("on, part", [("inner", "half"), *(pytest.param(
    *case, marks=pytest.mark.thorough) for case in (("outer", "quarter"), ("outer", "whole"), ("inner", "whole")))])
def test_blade_does_not_pass_between_the_nodes_of_a_tube(on, part):
    path, text = tube_and_pin(0.5, on, part)
    assert "the tool of 'pin' passes through the sheet at (x, y, z) = (" in text and "smaller triangles" in text
    assert path["pin_travel"][-1] < 8.0
    wide, text = tube_and_pin(6.0, on, part)
    assert not text and wide["pin_travel"][-1] == 8.0
    assert not [finding for finding in wide.findings() if finding.about == "forces"]       # loads without a resultant
    x = wide.wall().deformed_points[np.abs(wide.wall().reference_points[:, 2] + 41.7) < 3.0, 0]
    if on == "inner":
        assert x.max() == pytest.approx(15.0 + 6.0 - 6.0 + 8.0, abs=1.0)
    elif part == "quarter":
        assert x.max() == pytest.approx(16.6 - 8.0, abs=0.1)


@pytest.mark.thorough
def test_blade_stops_at_the_same_place_on_two_ranks():
    script = """
import json, sys
sys.path.insert(0, "tests")
from test_passed_tools import tube_and_pin
path, text = tube_and_pin(0.5, "outer", "quarter")
found = path["pin_travel"].tolist()
if path.problem.comm.rank == 0:
    print(json.dumps(found))
"""
    one, two = run_json(script, 1), run_json(script, 2)
    assert two == pytest.approx(one, rel=1e-9) and one[-1] < 8.0


def test_far_points_and_nearest_triangles_are_those_of_all_pairs():
    rng = np.random.default_rng(5)
    x, points, distance = rng.uniform(size=(200, 3)), rng.uniform(size=(30, 3)), 0.2
    assert far_off(x, points, distance).tolist() == [
        bool(np.linalg.norm(points - y, axis=1).min() > distance) for y in x]
    assert far_off(x, points[:0], 1.0).all() and far_off(x[:0], points, 1.0).shape == (0,)
    cells = np.array([rng.choice(30, 3, replace=False) for _ in range(40)])
    depth, longest, nearest = np.empty(200), np.empty(200), np.empty(200, dtype=int)
    _C.distances(200, x, 40, points, cells, np.empty((40, 4)), depth, longest, nearest)
    away = closest_points(x, points[cells])[2]
    edges = points[cells] - np.roll(points[cells], 1, axis=1)
    assert depth == pytest.approx(away)
    assert depth == pytest.approx([closest_points(y[None], points[cells[[k]]])[2][0] for y, k in zip(x, nearest)])
    assert longest == pytest.approx(np.linalg.norm(edges, axis=2).max(1)[nearest])
