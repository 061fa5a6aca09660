"""Moulds of several parts in three dimensions: intersections, half moulds, pressure on a part, capacity, pinch-off."""

import re

import numpy as np
import pytest
from test_tubes import CAPPED, SYMMETRIES, scene

import formingx as fx
from formingx.extensions.space.surface_mesh import below
from formingx.extensions.space.tool_checks import stopped_at_a_ridge
from formingx.mesh.triangles import place
from formingx.solve.diagnose import FailedRun

BODY = fx.tools.swept(fx.Tool([(0, -16), (10, -16), (35, -46), (35, -180), (0, -180)], [0, 0, 12, 6, 0]),
                      half=(35.0, 35.0), corner=12.0)
NECK = fx.tools.revolved(fx.Tool([(17, 10), (17, -60), (0, -60)]))
BOTTLE = fx.tools.intersection(BODY, NECK, fillet=4.0)


def test_cavity_of_an_intersection_is_the_union_of_the_cavities():
    x = np.random.default_rng(2).uniform((-40, -40, -185), (40, 40, 5), (4000, 3))
    body, neck, both = (tool.signed_distance(x) for tool in (BODY, NECK, BOTTLE))
    outside = np.maximum(-body, -neck) > 0
    assert np.all((both < 0) | ~outside)
    far = np.maximum(np.abs(body), np.abs(neck)) > 4.0
    sharp = np.minimum(body, neck)
    assert np.abs((both - sharp)[far & (sharp > 4)]).max() < 1e-12
    assert (both <= sharp + 1e-12).all()


def test_edge_of_an_intersection_of_normal_planes_is_an_exact_fillet():
    side = fx.tools.extruded(fx.Tool([(0.0, 50.0), (0.0, -50.0)]))              # solid x > 0
    top = fx.tools.extruded(fx.Tool([(50.0, 0.0), (-50.0, 0.0)]))               # solid z < 0
    assert side.signed_distance([[1.0, 0, 0]])[0] == 1.0 and top.signed_distance([[0, 0, -2.0]])[0] == 2.0
    edge = fx.tools.intersection(side, top, fillet=3.0)
    angle = np.linspace(0.1, 1.4, 7)
    points = np.column_stack([3 - 3 * np.cos(angle), 0 * angle, -3 + 3 * np.sin(angle)])
    assert edge.signed_distance(points) == pytest.approx(0 * angle, abs=1e-12)
    away = np.column_stack([3 - 3.5 * np.cos(angle), 0 * angle, -3 + 3.5 * np.sin(angle)])
    assert edge.signed_distance(away) == pytest.approx(0 * angle - 0.5, abs=1e-12)


BALL = fx.tools.revolved(fx.tools.sphere(radius=5.0))


@pytest.mark.parametrize("apart", [fx.tools.intersection(BALL, BALL.moved(x=11.0)), fx.tools.half(BALL, position=6.0)])
def test_an_intersection_without_a_surface_is_refused(apart):
    with pytest.raises(fx.InputError, match="has no surface: the surface of neither tool lies in"):
        apart.surface()


def side(along):
    """The section of the bottle's body, extruded along an axis."""
    line = [(0, -16), (10, -16), (35, -46), (35, -180), (0, -180)]
    return fx.tools.extruded(fx.Tool(line, [0, 0, 12, 10, 0]), along=along)


ROUNDED = fx.tools.union(side("x"), side("y"), fillet=12.0)


def test_edge_of_a_union_of_normal_planes_is_an_exact_fillet():
    """The concave edge of a wall x > 0 and a floor z < 0: a quarter of a cylinder in front of it."""
    wall = fx.tools.extruded(fx.Tool([(0.0, 50.0), (0.0, -50.0)]))
    floor = fx.tools.extruded(fx.Tool([(50.0, 0.0), (-50.0, 0.0)]))
    edge, angle = fx.tools.union(wall, floor, fillet=3.0), np.linspace(0.1, 1.4, 7)
    for radius in (3.0, 2.0, 3.4):
        points = np.column_stack([-3 + radius * np.cos(angle), 0 * angle, 3 - radius * np.sin(angle)])
        assert edge.signed_distance(points) == pytest.approx(0 * angle + radius - 3, abs=1e-12)
    assert edge.signed_distance([[-9.0, 0, 1.0], [-1.0, 0, 9.0]]).tolist() == [-1.0, -1.0]
    with pytest.raises(fx.InputError, match="union: fillet"):
        fx.tools.union(wall, floor, fillet=-1.0)


@pytest.mark.parametrize("tool", [BOTTLE, ROUNDED])
def test_derivatives_of_rounded_tools_are_difference_quotients(tool):
    x = np.random.default_rng(3).uniform((-30, -30, -60), (30, 30, -2), (400, 3))
    x = x[np.abs(tool.signed_distance(x)) < 8]
    found, h = tool.distances(x), 1e-5
    steps = h * np.eye(3)
    gradient = np.stack([(tool.signed_distance(x + e) - tool.signed_distance(x - e)) / (2 * h) for e in steps], 1)
    hessian = np.stack([(tool.distances(x + e).normal - tool.distances(x - e).normal) / (2 * h) for e in steps], 2)
    smooth = np.abs(hessian).max((1, 2)) < 1.0                                  # not across an edge
    assert smooth.mean() > 0.95
    assert np.abs(found.normal - gradient)[smooth].max() < 1e-6
    assert np.abs(found.hessian - hessian)[smooth].max() < 1e-5


def test_half_moulds_fill_the_whole_mould_and_stand_apart():
    x = np.random.default_rng(4).uniform((-40, -40, -185), (40, 40, 5), (2000, 3))
    halves = [fx.tools.half(BOTTLE, normal=normal) for normal in ("x", "-x")]
    assert np.max([half.signed_distance(x) for half in halves], axis=0) == pytest.approx(np.minimum(
        BOTTLE.signed_distance(x), np.abs(x[:, 0])))
    opened = halves[0].moved(x=25.0)
    assert opened.signed_distance(x + [25, 0, 0]) == pytest.approx(halves[0].signed_distance(x))
    assert opened.surface()[0][:, 0].min() > 24.9
    with pytest.raises(fx.InputError, match="half: normal"):
        fx.tools.half(BOTTLE, normal="r")


def test_surface_of_an_intersection_is_cut_where_the_parts_meet():
    """The neck of the bottle, whose long triangles pass the edge, belongs to it; no triangle stands in the cavity."""
    points, triangles = BOTTLE.surface()
    middle = points[triangles].mean(1)
    neck = np.abs(np.hypot(*middle[:, :2].T) - 17) < 0.5            # down to z = -18.4 at the edges, -24.4 at the faces
    area = np.linalg.norm(np.cross(*(points[triangles][:, k] - points[triangles][:, 0] for k in (1, 2))), axis=1) / 2
    assert 28.4 < area[neck].sum() / (2 * np.pi * 17) < 34.4
    assert np.abs(BOTTLE.signed_distance(middle)).max() < 2.0                   # in the fillet, and off by chords
    right = fx.tools.half(BOTTLE)
    corners, cells = right.surface()
    assert corners[:, 0].min() > -1e-9
    halved = np.linalg.norm(np.cross(*(corners[cells][:, k] - corners[cells][:, 0] for k in (1, 2))), axis=1).sum() / 2
    assert 2 * halved == pytest.approx(area.sum(), rel=1e-3)


def test_pressure_above_a_height_acts_on_this_part_alone():
    mesh = fx.mesh.tube(radius=16.0, length=60.0, elements=(12, 4), part="quarter")
    found = fx.Scene(mesh=mesh, thickness=2.0, materials=fx.NeoHookean(c10=0.5),
                     loads=[fx.Pressure("inner", above=-30)],
                     supports=[fx.Clamped("neck"), fx.Clamped("end"), *SYMMETRIES["quarter"]])
    assert repr(found.loads[0]) == "Pressure('inner', above=-30)"
    path = fx.trace(found, until=fx.enclosed_volume(2000.0), progress=False)
    wall = path.wall()
    grown = np.hypot(*wall.deformed_points[:, :2].T) - np.hypot(*wall.reference_points[:, :2].T)
    z = wall.reference_points[:, 2]
    assert grown[z > -25].max() > 3 * np.abs(grown[z < -40]).max()
    section = fx.Scene(mesh=fx.mesh.parison(inner_radius=10, thickness=2, length=60, elements=(20, 1)),
                       materials=fx.NeoHookean(c10=0.5), loads=[fx.Pressure("inner", above=20.0)],
                       supports=[fx.Symmetry("axis"), fx.Clamped("neck")])
    bent = fx.trace(section, until=fx.enclosed_volume(1000.0), progress=False)
    assert bent.last.measures["pressure"] > 0


def test_capacity_to_the_brim_and_to_a_fill_height():
    path = fx.trace(scene(), until=fx.enclosed_volume(3e4), progress=False)
    wall, part = path.wall(), path.part()
    first = 4 * path.problem.scene.mesh.enclosed_volume()
    assert part.capacity == pytest.approx(first + 3e4 - part.volume)
    levels = np.linspace(-95, 0, 20)
    volumes = [wall.capacity(level) for level in levels]
    assert np.all(np.diff(volumes) > 0) and volumes[-1] == pytest.approx(part.capacity)
    points, triangles, owner = below(wall.deformed_points, wall.triangles, -50.0)
    assert points[:, 2].max() == pytest.approx(-50.0) and owner.max() < len(wall.triangles)
    lid = wall.section((0, 0, -50), (0, 0, 1))
    angle = np.argsort(np.arctan2(lid["y"], lid["x"]))
    x, y = lid["x"][angle], lid["y"][angle]
    area = 2 * np.sum(x[:-1] * y[1:] - x[1:] * y[:-1])
    slope = (wall.capacity(-49.5) - wall.capacity(-50.5)) / 1.0
    assert slope == pytest.approx(area - 2 * np.pi * np.hypot(x, y).mean() * lid["wall"].mean(), rel=0.03)
    upper, weight = path.part(trim=-50.0, density=0.95), path.part(density=0.95).weight
    assert upper.capacity == pytest.approx(part.capacity - wall.capacity(-50.0))
    assert upper.weight == pytest.approx((1 - upper.scrap) * weight) and 0.3 < upper.scrap < 0.7
    with pytest.raises(fx.InputError, match="capacity: level"):
        wall.capacity(5.0)


def test_unrolled_wall_of_an_axisymmetric_part_depends_on_the_height_alone():
    path = fx.trace(scene(thickness=lambda x, y, z: 1 - z / 100), until=fx.enclosed_volume(3e4), progress=False)
    wall = path.wall()
    found = wall.unrolled(angles=9, levels=12)
    assert found["wall"].shape == (12, 9) and np.isfinite(found["wall"]).all()
    assert found["angle"][[0, -1]] == pytest.approx([0, 90], abs=1e-9)
    assert np.ptp(found["wall"], axis=1).max() < 0.05 and np.all(np.diff(found["wall"].mean(1))[2:] < 0)
    assert found["wall"][6, 0] == pytest.approx(wall.section((0, 0, found["z"][6]), (0, 0, 1))["wall"][0], rel=0.02)


@pytest.mark.thorough
def test_halves_pinch_an_open_tube_flat():
    mesh = fx.mesh.tube(radius=16.0, length=210.0, elements=(30, 5), part="quarter")
    closing = fx.Scene(
        mesh=mesh, thickness=2.5, materials=fx.MooneyRivlin(c10=0.05, c01=0.015), model=fx.Membrane(wrinkles=0.01),
        supports=[fx.Clamped("neck"), fx.Symmetry("end", "z", guide=True), *SYMMETRIES["quarter"]],
        loads=[fx.Pressure("inner", name="air", above=-180.0)],
        contacts=[fx.Contact("outer", fx.tools.half(BOTTLE).moved(x=40.0), "stick", direction=(-1, 0, 0),
                             name="mould")])
    path = fx.Process(closing).run([fx.Stage("pre-blow", control="air", until=fx.pressure(0.002)),
                                    fx.Stage("close", control="mould", until=fx.travel(40.0))], progress=False)
    wall = path.wall()
    tail = wall.deformed_points[(wall.reference_points[:, 2] < -185)]
    assert tail[:, 0].max() < 0.05
    assert 0.95 < tail[:, 1].max() / (np.pi / 2 * 16) < 1.01


def test_a_checkpoint_restores_an_intersection(tmp_path):
    half = fx.tools.half(BOTTLE).moved(x=30.0)
    mesh = fx.mesh.tube(**CAPPED)
    held = scene(mesh, contacts=[fx.Contact("outer", half, "stick", direction=(-1, 0, 0), name="mould")],
                 loads=[fx.Pressure("inner", name="air")])
    path = fx.Process(held).run([fx.Stage("blow", control="air", until=fx.pressure(1e-3))],
                                progress=False, checkpoint=tmp_path / "run")
    from formingx.contact.tooling import tool_of
    from formingx.results.files.description import plain
    x = np.random.default_rng(5).uniform(-40, 40, (50, 3))
    assert tool_of(plain(half)).signed_distance(x) == pytest.approx(half.signed_distance(x))
    assert len(path) > 1


SQUARE = fx.tools.swept(fx.Tool([(35.0, 50.0), (35.0, -400.0)]), half=(35.0, 35.0), corner=12.0)
"""Long square tube, open at both ends."""
MELT = fx.MooneyRivlin(c10=0.05, c01=0.015)


def blown(mesh, supports, tool=BOTTLE, part="quarter", volume=480e3, friction="stick", thickness=2.5):
    """A tube that is blown by its volume, then by its pressure."""
    found = fx.Scene(mesh=mesh, thickness=thickness, materials=MELT, model=fx.Membrane(wrinkles=0.01),
                     supports=[*supports, *SYMMETRIES[part]], loads=[fx.Pressure("inner", name="air")],
                     contacts=[fx.Contact("outer", tool, friction, name="mould")])
    return found, [fx.Stage("air", control="air", amplitudes={fx.enclosed_volume: [(0, 0), (1, volume)]}),
                   fx.Stage("hold", control="air", until=fx.pressure(0.6))]


def run(scene_and_stages):
    return fx.Process(scene_and_stages[0]).run(scene_and_stages[1], progress=False)


@pytest.mark.thorough
def test_middle_of_a_long_square_bottle_is_in_plane_strain():
    """A tube whose ends are held bulges in its middle, which so is stretched along the axis: its wall is thinner by
    this stretch, 1.083, than the wall of a ring in plane strain, and by nothing else."""
    long = fx.mesh.tube(radius=16.0, length=320.0, elements=(40, 10), part="quarter")
    wall = run(blown(long, [fx.Clamped("neck"), fx.Clamped("end")], SQUARE, volume=1.1e6)).wall()
    ring = fx.mesh.tube(radius=16.0, length=8.0, elements=(1, 10), part="quarter", z=-156.0)
    strip = run(blown(ring, [fx.Symmetry(name, "z", guide=True) for name in ("neck", "end")], SQUARE,
                      volume=1.1e6 / 40)).wall()
    Z, z = wall.reference_points[:, 2], wall.deformed_points[:, 2]
    middle = np.abs(Z + 160.0) < 20.0
    stretch = np.polyfit(Z[middle], z[middle], 1)[0]
    assert stretch == pytest.approx(1.083, abs=0.01)
    cuts = [w.section((0, 0, -160.1), (0, 0, 1)) for w in (wall, strip)]
    for angle in (0, 22.5, 45):
        x, y = np.cos(np.radians(angle)), np.sin(np.radians(angle))
        three, plane = (np.interp(0.0, *np.array(sorted(zip(cut["x"] * y - cut["y"] * x, cut["wall"]))).T)
                        for cut in cuts)
        assert stretch * three == pytest.approx(plane, rel=0.02)


@pytest.mark.thorough
def test_quarter_half_and_whole_of_a_square_bottle():
    parts = {}
    for part, columns in (("quarter", 4), ("half", 8), ("whole", 16)):
        mesh = fx.mesh.tube(radius=16.0, length=172.0, elements=(16, columns), part=part, end="closed")
        path = run(blown(mesh, [fx.Clamped("neck")], part=part))
        found = path.part(density=0.95, units=fx.Units(length="mm"))
        parts[part] = np.array([found.weight, found.capacity, found.mean_wall, found.min_wall])
    for part in ("half", "whole"):
        assert parts[part] == pytest.approx(parts["quarter"], rel=0.01)


def test_work_of_the_air_is_the_energy_of_the_wall():
    found = scene(material=MELT, thickness=2.5)
    volumes = np.linspace(0, 8e4, 41)
    path = fx.trace(found, until=fx.enclosed_volume(8e4), progress=False,
                    intermediate=[fx.enclosed_volume(v) for v in volumes[1:-1]])
    p, V = path["pressure"], path["enclosed_volume"]
    work = np.sum((p[1:] + p[:-1]) / 2 * np.diff(V))
    assert path["strain_energy"][-1] == pytest.approx(work, rel=3e-3)


@pytest.mark.thorough
def test_work_of_the_air_in_a_mould():
    """What the air does in the mould is stored in the wall: contact that sticks dissipates nothing but in its steps."""
    mesh = fx.mesh.tube(radius=16.0, length=172.0, elements=(20, 5), part="quarter", end="closed")
    path = run(blown(mesh, [fx.Clamped("neck")]))
    p, V = path["air_pressure" if "air_pressure" in path.columns else "pressure"], path["enclosed_volume"]
    work = np.sum((p[1:] + p[:-1]) / 2 * np.diff(V))
    assert path["strain_energy"][-1] == pytest.approx(work, rel=0.01)


@pytest.mark.thorough
def test_programme_of_the_wall_gives_the_wanted_minimum_wall():
    def build(wall):
        mesh = fx.mesh.tube(radius=16.0, length=172.0, elements=(20, 5), part="quarter", end="closed")
        length = float(mesh.arc_length([0.0], [0.0], [-172.0])[0])
        return blown(mesh, [fx.Clamped("neck")],
                     thickness=lambda x, y, z: wall(mesh.arc_length(x, y, z) / length))
    found = fx.wall_programme(build, 0.7, start=2.5, low=1.0, high=6.0)
    assert found.converged and found.min_walls[-1] == pytest.approx(0.7, rel=0.02) and len(found.tried) <= 6
    assert found.path.part().volume < 4.3e4 and "wanted minimum wall" in str(found)
    with pytest.raises(fx.InputError, match="start = 9.0: must be from"):
        fx.wall_programme(build, 0.7, start=9.0, low=1.0, high=6.0)


def test_a_programme_whose_bounds_are_too_low_ends_at_them():
    tube = fx.mesh.tube(radius=10.0, length=40.0, elements=(6, 2), part="quarter", end="closed")

    def build(wall):
        given = fx.Scene(mesh=tube, thickness=lambda x, y, z: wall(tube.arc_length(x, y, z) / 45.7),
                         materials=fx.NeoHookean(c10=0.5), loads=[fx.Pressure("inner")],
                         supports=[fx.Clamped("neck"), fx.Symmetry("x0", "x"), fx.Symmetry("y0", "y")])
        return given, fx.enclosed_volume(6000.0)
    found = fx.wall_programme(build, 5.0, start=1.0, low=0.5, high=2.0, knots=3)
    assert found.bounded and not found.converged and len(found.tried) <= 4 and np.all(found.thickness == 2.0)
    assert "not converged: the thickness is at its bounds" in str(found)


def test_a_sharp_ridge_is_named_before_a_sheet_slides():
    """The shoulder of a square bottle is narrower than the centres of its corners: its sides meet sharply."""
    mesh = fx.mesh.tube(radius=16.0, length=172.0, elements=(40, 10), part="quarter", end="closed")
    scenes = {friction: blown(mesh, [fx.Clamped("neck")], tool, friction=friction)[0]
              for friction, tool in ((0.3, fx.tools.half(BOTTLE).moved(x=2.0)), ("stick", BOTTLE))}
    (found,) = [f for f in fx.check(scenes[0.3]).findings if "sharp ridge" in f.text]
    ends = np.array([[float(v) for v in place.split(", ")] for place in re.findall(r"\((-?\d[^()]*)\)", found.text)])
    assert found.severity == "serious" and "corner = 21.67" in found.text
    assert ends[:, 0] - 2 == pytest.approx(ends[:, 1]) and 12 < ends[0, 1] < 14 and 21.5 < ends[1, 1] < 23
    assert ends[:, 2] == pytest.approx(-16 - 1.2 * (ends[:, 1] - 10), abs=0.02)             # of the profile
    assert not [f for f in fx.check(scenes["stick"]).findings if "ridge" in f.text]


@pytest.mark.parametrize("friction, z, told", [(0.3, -18.0, True), *(pytest.param(
    *case, marks=pytest.mark.thorough) for case in ((0.3, -120.0, False), ("stick", -18.0, False)))])
def test_a_failed_run_names_a_sharp_ridge(friction, z, told):
    """The node with the largest out-of-balance force is on the diagonal, below the neck or far below it."""
    mesh = fx.mesh.tube(radius=16.0, length=172.0, elements=(24, 4), part="quarter", end="closed")
    bottle, stages = blown(mesh, [fx.Clamped("neck")], friction=friction, volume=500.0)
    path = fx.Process(bottle).run(stages[:1], progress=False)
    x = 16 / np.sqrt(2)
    found = list(stopped_at_a_ridge(FailedRun({"worst": place(mesh, (x, x, z))}, path.problem, path.last)))
    assert len(found) == told and all("corner = 21.67" in finding.advice for finding in found)


def test_small_fillets_where_parts_meet_are_named_before_a_sheet_slides():
    """The fillet of 4 between body and neck is below the triangles, which matters to a sheet that slides."""
    mesh = fx.mesh.tube(radius=16.0, length=172.0, elements=(34, 9), part="quarter", end="closed")
    tool = fx.tools.intersection(ROUNDED, NECK, fillet=4.0)
    found = {friction: [f.text for f in fx.check(blown(mesh, [fx.Clamped("neck")], tool, friction=friction)[
        0]).findings if "fillets of radius" in f.text] for friction in (0.3, "stick")}
    assert len(found[0.3]) == 1 and "fillets of radius 4," in found[0.3][0] and not found["stick"]
    assert "may not converge" in found[0.3][0]


@pytest.mark.thorough
def test_melt_slides_into_a_square_bottle_whose_ridges_have_fillets():
    """The bottle of the demos with all edges round: with a sharp ridge the run ends at three fifths of the volume."""
    tool = fx.tools.intersection(ROUNDED, NECK, fillet=4.0)
    mesh = fx.mesh.tube(radius=16.0, length=172.0, elements=(40, 10), part="quarter", end="closed")
    path = run(blown(mesh, [fx.Clamped("neck")], tool, friction="none"))
    assert path.filling("mould").touching[-1] > 0.98 and path.part().min_wall == pytest.approx(0.478, rel=0.02)


@pytest.mark.slow
def test_melt_slides_into_a_square_bottle_with_fillets():
    """Fillets larger than the triangles: sharp edges of a tool stop a sliding membrane."""
    body = fx.tools.swept(fx.Tool([(0, -16), (10, -16), (35, -46), (35, -180), (0, -180)], [0, 0, 14, 12, 0]),
                          half=(35.0, 35.0), corner=24.0)
    tool = fx.tools.intersection(body, NECK, fillet=10.0)
    found = {}
    for friction in ("stick", 0.3, "none"):
        mesh = fx.mesh.tube(radius=16.0, length=172.0, elements=(48, 12), part="quarter", end="closed")
        path = run(blown(mesh, [fx.Clamped("neck")], tool, friction=friction))
        assert path.filling("mould").touching[-1] > 0.98
        found[friction] = path.part().min_wall
    assert found["stick"] < found[0.3] < found["none"]


def test_a_hanging_tube_sags_by_its_weight():
    """rho g L^2 / (2 E) with E = 3 mu, up to the clamped neck."""
    mesh = fx.mesh.tube(radius=16.0, length=210.0, elements=(21, 4), part="quarter")
    hanging = fx.Scene(mesh=mesh, thickness=2.5, materials=fx.NeoHookean(c10=0.06),
                       supports=[fx.Clamped("neck"), *SYMMETRIES["quarter"]],
                       loads=[fx.Gravity(density=0.76e-9, value=9810.0)])
    path = fx.Process(hanging).run([fx.Stage("hang", duration=1.0)], progress=False)
    assert path["sag"][-1] == pytest.approx(0.76e-9 * 9810 * 210**2 / 2 / (3 * 0.12), rel=0.02)


def test_half_of_a_mould_from_an_stl_file_is_that_of_its_profile(tmp_path):
    whole = fx.tools.revolved(fx.tools.bottle(
        radius=30.0, height=96.0, neck=18.0, shoulder=20.0, neck_height=20.0, base=-136.0, fillet=10.0,
        shoulder_fillet=10.0))
    whole.to_stl(tmp_path / "mould.stl", wall=8.0)
    halves = [fx.tools.half(tool, normal="x").moved(x=5.0) for tool in (fx.tools.solid(tmp_path / "mould.stl"), whole)]
    x = np.random.default_rng(3).uniform((3, -30, -136), (35, 30, -8), (2000, 3))
    found, expected = (half.signed_distance(x) for half in halves)
    near = np.abs(expected) < 3                              # the solid of the file is 8 thick
    assert found[near] == pytest.approx(expected[near], abs=0.2) and near.sum() > 500


@pytest.mark.slow
def test_halves_from_an_stl_file_pinch_and_form_as_those_of_the_profile(tmp_path):
    whole = fx.tools.revolved(fx.tools.bottle(
        radius=30.0, height=96.0, neck=18.0, shoulder=20.0, neck_height=20.0, base=-136.0, fillet=10.0,
        shoulder_fillet=10.0))
    whole.to_stl(tmp_path / "mould.stl", wall=8.0)
    walls = []
    for tool in (whole, fx.tools.solid(tmp_path / "mould.stl")):
        mesh = fx.mesh.tube(radius=16.0, length=150.0, elements=(22, 5), part="quarter")
        closing = fx.Scene(
            mesh=mesh, thickness=2.5, materials=MELT, model=fx.Membrane(wrinkles=0.01),
            supports=[fx.Clamped("neck"), fx.Symmetry("end", "z", guide=True), *SYMMETRIES["quarter"]],
            loads=[fx.Pressure("inner", name="air", above=-136.0)],
            contacts=[fx.Contact("outer", fx.tools.half(tool).moved(x=32.0), "stick", direction=(-1, 0, 0),
                                 name="mould")])
        path = fx.Process(closing).run([
            fx.Stage("pre-blow", control="air", until=fx.pressure(0.002)),
            fx.Stage("close", control="mould", until=fx.travel(32.0)),
            fx.Stage("blow", control="air", until=fx.pressure(0.3))], progress=False)
        walls.append(path.part().min_wall)
        tail = path.wall().deformed_points[path.wall().reference_points[:, 2] < -140]
        assert tail[:, 0].max() < 0.01 and 1.5 < tail[:, 1].max() / 16 < np.pi / 2
    assert walls[1] == pytest.approx(walls[0], rel=0.01)


@pytest.mark.thorough
def test_base_is_pushed_up_after_the_blow():
    """The middle of the base is a tool of its own, in a hole of the mould: it carries p times its area, and moves."""
    radius, way, p = 16.5, 12.0, 0.4
    mould = fx.tools.intersection(BOTTLE, fx.tools.revolved(fx.Tool([(17.0, -150.0), (17.0, -400.0)])), fillet=3.0)
    base = fx.tools.revolved(fx.Tool([(radius, -225.0), (radius, -180.0), (0.0, -180.0)], [0.0, 8.0, 0.0]))
    mesh = fx.mesh.tube(radius=16.0, length=172.0, elements=(24, 6), part="quarter", end="closed")
    bottle = fx.Scene(
        mesh=mesh, thickness=2.5, materials=MELT, model=fx.Membrane(wrinkles=0.01),
        supports=[fx.Clamped("neck"), *SYMMETRIES["quarter"]], loads=[fx.Pressure("inner", name="air")],
        contacts=[fx.Contact("outer", mould, "stick", name="mould"),
                  fx.Contact("outer", base, "stick", direction=(0, 0, 1), name="base")])
    path = fx.Process(bottle).run([
        fx.Stage("air", control="air", amplitudes={fx.enclosed_volume: [(0, 0), (1, 480e3)]}),
        fx.Stage("hold", control="air", until=fx.pressure(p)),
        fx.Stage("push-up", control="base", until=fx.travel(way))], progress=False)
    hold = path.state(stage="hold").measures
    assert hold["base_force"] == pytest.approx(p * np.pi * radius**2, rel=0.25)
    assert path["base_force"][-1] > hold["base_force"] and path["base_travel"][-1] == way
    wall = path.wall()
    middle = np.hypot(*wall.deformed_points[:, :2].T) < 8.0
    assert wall.deformed_points[middle & (wall.deformed_points[:, 2] < -100), 2] == pytest.approx(-180 + way, abs=0.01)
    displaced = hold["enclosed_volume"] - path["enclosed_volume"][-1]
    assert 0.9 < displaced / (np.pi * radius**2 * way) < 1.4


RELAXING = fx.Viscoelastic(fx.NeoHookean(c10=0.004), [(0.08, 0.3), (0.03, 3.0)])


@pytest.mark.thorough
def test_relaxed_energy_leaves_simple_tension_of_a_relaxing_tube_as_it_is():
    """In simple tension the relaxed energy is that of the membrane. Its internal variables have the same axes."""
    sags = []
    for wrinkles in (None, 0.1):
        mesh = fx.mesh.tube(radius=16.0, length=210.0, elements=(12, 3), part="quarter")
        hanging = fx.Scene(mesh=mesh, thickness=2.5, materials=RELAXING, model=fx.Membrane(wrinkles=wrinkles),
                           supports=[fx.Clamped("neck"), *SYMMETRIES["quarter"]],
                           loads=[fx.Gravity(density=0.76e-9, value=9810.0)])
        sags.append(fx.Process(hanging).run([fx.Stage("hang", duration=1.0)], progress=False)["sag"][-1])
    assert sags[1] == pytest.approx(sags[0], rel=1e-3) and sags[0] > 1.1


def hung_closed_and_blown(**hang):
    """A relaxing tube that hangs, with the arguments of that stage, is pinched by the halves and blown into them."""
    mesh = fx.mesh.tube(radius=16.0, length=210.0, elements=(21, 4), part="quarter")
    chain = fx.Scene(
        mesh=mesh, thickness=2.5, materials=RELAXING, supports=[fx.Clamped("neck"), *SYMMETRIES["quarter"]],
        loads=[fx.Pressure("inner", name="air", above=-180.0), fx.Gravity(density=0.76e-9, value=9810.0)],
        contacts=[fx.Contact("outer", fx.tools.half(BOTTLE).moved(x=40.0), "stick", direction=(-1, 0, 0),
                             name="mould")])
    return fx.Process(chain).run([
        fx.Stage("hang", **hang), fx.Stage("close", control="mould", until=fx.travel(40.0), duration=1.0),
        fx.Stage("blow", control="air", until=fx.pressure(0.6), duration=1.0)], progress=False)


@pytest.mark.slow
def test_tube_sags_then_halves_close_then_air_blows():
    """One process of a relaxing tube: it hangs for two seconds, is pinched, and fills the mould."""
    path = hung_closed_and_blown(duration=2.0)
    assert path.state(stage="hang").measures["sag"] == pytest.approx(1.66, abs=0.05)
    assert path["process_time"][-1] == pytest.approx(4.0) and path.filling("mould").touching[-1] > 0.95
    assert path["enclosed_volume"][-1] == pytest.approx(5.44e5, rel=0.02)


@pytest.mark.thorough
def test_tube_sags_with_support_air_then_halves_close_then_air_blows():
    """The same with a little air from the first half second on, which the hanging tube keeps while the halves close."""
    path = hung_closed_and_blown(amplitudes={"air": [(0, 0), (0.5, 5e-4), (2.0, 5e-4)]})
    closed = path.state(stage="close").measures
    assert closed["air_pressure"] == pytest.approx(5e-4) and closed["mould_travel"] == 40.0
    assert path["process_time"][-1] == pytest.approx(4.0) and path.filling("mould").touching[-1] > 0.93
    assert path["enclosed_volume"][-1] == pytest.approx(5.44e5, rel=0.03)


@pytest.mark.slow
def test_parts_that_are_blown_round_the_eye_of_a_handle_end_the_run():
    """A pillar pinches the tube at its side; what is blown above and below it meets behind it."""
    pillar = fx.tools.swept(fx.Tool([(0, -22), (3.5, -22), (3.5, 22), (0, 22)], [0, 3, 3, 0]), half=(40.0, 3.5),
                            corner=3.0).moved(x=40.0, y=11.5, z=-100.0)
    tool = fx.tools.union(fx.tools.half(BOTTLE), pillar).moved(x=40.0)
    mesh = fx.mesh.tube(radius=16.0, length=210.0, elements=(52, 24), part="half")
    closing = fx.Scene(
        mesh=mesh, thickness=2.5, materials=MELT, model=fx.Membrane(wrinkles=0.01),
        supports=[fx.Clamped("neck"), fx.Symmetry("end", "z", guide=True), *SYMMETRIES["half"]],
        loads=[fx.Pressure("inner", name="air", above=-180.0)],
        contacts=[fx.Contact("outer", tool, "stick", direction=(-1, 0, 0), name="mould")])
    stages = [fx.Stage("pre-blow", control="air", until=fx.pressure(0.002)),
              fx.Stage("close", control="mould", until=fx.travel(40.0)),
              fx.Stage("blow", control="air", until=fx.pressure(0.3))]
    with pytest.raises(fx.ConvergenceError, match="the sheet passes through itself at"):
        fx.Process(closing).run(stages, progress=False)


@pytest.mark.parametrize("part, travel, depth", [
    ("whole", 50.0, "8.08 beyond"), ("whole", 30.0, ""), ("half", 50.0, "")])
def test_a_tool_that_reaches_the_opposite_layer_is_named(part, travel, depth):
    """A plate closes on a tube of radius 16. A half tube has no opposite layer; its plane of symmetry stands for it."""
    plate = fx.tools.extruded(fx.Tool([(0.0, 50.0), (0.0, -250.0)])).moved(x=30.0)
    closing = fx.Scene(mesh=fx.mesh.tube(radius=16.0, length=60.0, elements=(6, 8), part=part), thickness=2.5,
                       materials=MELT, supports=[fx.Clamped("neck"), *SYMMETRIES[part]],
                       contacts=[fx.Contact("outer", plate, "stick", direction=(-1, 0, 0), name="plate")])
    found = [f.text for f in fx.check(closing, targets=[fx.travel(travel)]).findings if "opposite layer" in f.text]
    assert len(found) == bool(depth) and all(depth in text and "(-11.92, 11.92, 0)" in text for text in found)


@pytest.mark.thorough
def test_k_bkz_tube_is_the_solid_ring_in_plane_strain():
    """A ring of a thin wall in plane strain, blown by a constant flow: the pressure by time of the solid, H/R apart."""
    melt, H = fx.KBKZ([(0.10, 0.01), (0.06, 0.1), (0.03, 1.0)], fx.PSM(alpha=10.0, beta=0.05)), 0.01
    guided = [fx.Symmetry(name, "z", guide=True) for name in ("neck", "end")]
    ring = fx.Scene(mesh=fx.mesh.tube(radius=1.0, length=0.2, elements=(2, 6), part="quarter"), thickness=H,
                    materials=melt, supports=[*guided, *SYMMETRIES["quarter"]], model=fx.Membrane(),
                    loads=[fx.Pressure("inner", name="air")])
    lines = [[(1 + side * H / 2, z) for z in (0.0, 0.2)] for side in (-1, 1)]
    solid = fx.Scene(mesh=fx.mesh.from_lines(*lines, elements=(1, 1)), materials=melt,
                     supports=[fx.Symmetry(name, "z", guide=True) for name in ("start", "end")],
                     loads=[fx.Pressure("inner", name="air")])
    volume = 0.2 * np.pi * (1.4**2 - 1)
    found = [fx.Process(one).run([fx.Stage("blow", control="air", amplitudes={
        fx.enclosed_volume: [(0.0, 0.0), (0.5, volume)]})], progress=False) for one in (ring, solid)]
    pressures = [np.interp([0.2, 0.35, 0.5], path["process_time"], path["pressure"]) for path in found]
    assert pressures[0] == pytest.approx(pressures[1], rel=5e-3)


@pytest.mark.thorough
def test_two_halves_on_a_whole_tube():
    mesh = fx.mesh.tube(radius=16.0, length=210.0, elements=(30, 12))
    halves = [fx.Contact("outer", fx.tools.half(BOTTLE, normal).moved(x=opening), "stick",
                         direction=(-np.sign(opening), 0, 0), name=name)
              for normal, opening, name in (("x", 40.0, "right"), ("-x", -40.0, "left"))]
    closing = fx.Scene(mesh=mesh, thickness=2.5, materials=MELT, model=fx.Membrane(wrinkles=0.01), contacts=halves,
                       supports=[fx.Clamped("neck"), fx.Symmetry("end", "z", guide=True)],
                       loads=[fx.Pressure("inner", name="air", above=-180.0)])
    path = fx.Process(closing).run([
        fx.Stage("pre-blow", control="air", until=fx.pressure(0.002)),
        fx.Stage("close", amplitudes={"left": [(0, 0), (1, 40.0)], "right": [(0, 0), (1, 40.0)]})], progress=False)
    wall = path.wall()
    tail = wall.deformed_points[wall.reference_points[:, 2] < -185]
    assert np.abs(tail[:, 0]).max() < 0.05 and 1.5 < tail[:, 1].max() / 16 < np.pi / 2
    assert path["left_force"][-1] == pytest.approx(path["right_force"][-1], rel=1e-3)
