"""Membranes in three dimensions: equations, exact solutions, sticking contact, tools, evaluation, errors."""

import shutil
from dataclasses import replace

import numpy as np
import pytest
import ufl
from conftest import run_json
from matplotlib.image import imread
from test_demos import summary
from test_derivatives import assert_derivatives, difference, random_state

import formingx as fx
from formingx import _compat
from formingx.__main__ import main
from formingx.extensions.space.lagged_corrections import LaggedCorrections
from formingx.extensions.space.part import _positive_share
from formingx.extensions.space.surface import relaxed
from formingx.io.stl import write_stl
from formingx.problem.problem import Problem
from formingx.results.files.fields import Fields
from formingx.results.show import views
from formingx.solve.arc_length import Curve
from formingx.solve.newton import Failure

MATERIALS = [fx.NeoHookean(c10=2.0), fx.MooneyRivlin(c10=1.5, c01=0.4), fx.Ogden(mu=(1.4, -0.3), alpha=(2.5, -2.0)),
             fx.Viscoelastic(fx.NeoHookean(c10=0.5), [(1.0, 1.0)])]
HELD = [fx.SimplySupported("rim"), fx.Symmetry("x0", "x"), fx.Symmetry("y0", "y")]


def disc(size=0.3, material=MATERIALS[0], on="bottom", model=None, **scene):
    """A quarter of a disc of radius 1 under a pressure."""
    sheet = fx.mesh.sheet(fx.mesh.circle(1.0, part="quarter"), size=size, **scene.pop("mesh", {}))
    return fx.Scene(mesh=sheet, thickness=scene.pop("thickness", 0.01), materials=material, model=model,
                    supports=scene.pop("supports", HELD), loads=scene.pop("loads", [fx.Pressure(on)]), **scene)


@pytest.mark.parametrize("material, wrinkles", [
    (MATERIALS[0], 0.01), (MATERIALS[0], None), (MATERIALS[3], None),
    *(pytest.param(material, 0.01, marks=pytest.mark.thorough) for material in MATERIALS[1:])])
def test_residual_and_tangent_are_derivatives(material, wrinkles):
    problem = Problem(disc(material=material, model=fx.Membrane(wrinkles=wrinkles)))
    assert_derivatives(problem, *random_state(problem, size=0.1 if wrinkles else 0.05))


@pytest.mark.parametrize("on", ["bottom", "top"])
def test_pressure_does_the_work_p_dV(on):
    problem = Problem(disc(on=on))
    forms, (x, d) = problem.forms, random_state(problem, size=0.05)
    volume, derivative = fx.enclosed_volume(1.0).bind(problem), problem.x.duplicate()
    problem.control_derivative(x, 0.0, derivative)
    work = -derivative.dot(d) * forms.stress * forms.volume * problem.scene.symmetry_factor / forms.control_scale
    assert work == pytest.approx(difference(lambda y: volume.value(y, 0.0), x, d, 1e-5), rel=1e-8)


def test_disc_converges_to_the_membrane_of_revolution(tmp_path):
    found = summary("disc_in_space", tmp_path, "--quick")
    fine = found["size_0.05"]
    for s, bound in (("1.5", 8e-4), ("2", 2e-3), ("3", 4e-3)):
        assert abs(fine["pressure_over_axisymmetric"][s] - 1) < bound
        assert found["order_of_pressure"][s] > 1.8
        assert abs(found["extrapolated"]["pressure_over_axisymmetric"][s] - 1) < 2e-4
        assert abs(fine["pole_thickness_over_axisymmetric"][s] - 1) < 4 * bound
    assert abs(fine["limit_pressure_over_axisymmetric"] - 1) < 2.5e-3
    assert fine["failures"] == 0 and fine["iterations"] <= 35


@pytest.mark.thorough
def test_layers_and_thickness_add_up():
    """Two layers give the same volume as one layer of their total thickness; a negative thickness is refused."""
    half = {"inner": 0.004, "outer": lambda x, y: 0.006 + 0 * x}
    one, two = (fx.solve(scene, to=0.005, increments=2).last.measures for scene in (
        disc(), disc(thickness=half, mesh={"layers": ["inner", "outer"]})))
    assert two["enclosed_volume"] == pytest.approx(one["enclosed_volume"], rel=1e-10)
    with pytest.raises(fx.InputError, match=r"thickness of 'sheet' = -0\.4.* at \(.*must be greater than 0"):
        disc(thickness=lambda x, y: 0.6 - x)


@pytest.mark.thorough
def test_tray_quick(tmp_path):
    """Walls of the quick run, of the trough against its exact law, and of the same tray read from an STL file."""
    found = summary("tray", tmp_path, "--quick")
    exact, stl, trough = found["size_0.1"], found["stl"]["size_0.1"], found["trough"]["size_0.1"]
    for place, ratio in (("floor", 0.480), ("long_wall", 0.4545), ("bottom_edge", 0.328)):       # of size 0.025
        assert exact[place] == pytest.approx(ratio, rel=0.02)
        assert stl[place] == pytest.approx(exact[place], rel=5e-3)
    assert stl["corner"] == pytest.approx(exact["corner"], rel=5e-3)
    assert exact["failures"] == 0 and exact["iterations"] <= 250
    assert abs(trough["wall_error"]) < 5e-3 and abs(trough["fillet_error"]) < 0.015


@pytest.mark.slow
def test_tray(tmp_path):
    """Trough within 0.2 % at 0.05, walls of 0.05 within 1 % (corner 4 %) of those of 0.025, no failures."""
    found = summary("tray", tmp_path)
    fine, middle = found["size_0.025"], found["size_0.05"]
    for place in ("floor", "long_wall", "bottom_edge", "corner"):
        assert middle[place] == pytest.approx(fine[place], rel=0.045 if place == "corner" else 0.01)
        for size in ("size_0.05", "size_0.025"):
            assert found["stl"][size][place] == pytest.approx(found[size][place], rel=5e-3)
    for numbers in (fine, middle):
        assert numbers["failures"] == 0 and numbers["iterations"] <= 250
    assert abs(found["trough"]["size_0.05"]["wall_error"]) < 2e-3


def trough(size=0.15, **more):
    """Return the scene of a strip that is pressed into a long trough, with coarse triangles."""
    sheet = fx.mesh.sheet([(0, 0), (1, 0), (1, 0.3), (0, 0.3)], size, names=["y0", "rim", "y1", "x0"])
    tool = fx.tools.extruded(fx.Tool([(3.0, 0.0), (1.0, 0.0), (1.0, -1.0), (0.0, -1.0)], [0.0, 0.0, 0.2, 0.0]))
    sides = [fx.Symmetry("x0", "x"), fx.Symmetry("y0", "y"), fx.Symmetry("y1", "y")]
    return fx.Scene(mesh=sheet, thickness=0.02, materials=fx.NeoHookean(c10=1.0), loads=[fx.Pressure("top")],
                    supports=[fx.SimplySupported("rim"), *sides],
                    contacts=[fx.Contact("bottom", tool, name="mould", **more)])


def test_a_reflected_mesh_is_symmetric():
    """A reflected mesh has four images of each triangle of the quarter, joined at the cuts, also at a new size."""
    outline = fx.mesh.rectangle(3.0, 2.0, corner=0.5, part="quarter")
    part = fx.mesh.sheet(outline, size=0.3)
    for size in (0.3, lambda x, y: 0.3 + 0.1 * x):
        part = part.of_size(size)
        whole = fx.mesh.sheet(outline, size=0.3, reflected=["y0", "x0"]).of_size(size)
        assert set(whole.boundaries) == {"rim", "bottom", "top"} and len(whole.facets_of("rim")) == 4 * len(
            part.facets_of("rim"))
        (X, cells), (x, few) = ((mesh.domain.geometry.x[:, :2], _compat.cell_nodes(mesh.domain))
                                for mesh in (whole, part))
        assert len(cells) == 4 * len(few)
        places = {tuple(row) for row in np.round(X, 9).tolist()}
        assert len(places) == len(X)
        for sign in ((1, 1), (-1, 1), (1, -1), (-1, -1)):
            assert {tuple(row) for row in (np.round(x, 9) * sign + 0.0).tolist()} <= places
        area, quarter = (np.abs(np.linalg.det(np.dstack([x[c], np.ones((*c.shape, 1))]))).sum()
                         for x, c in ((X, cells), (x, few)))
        assert area == pytest.approx(4 * quarter, rel=1e-9)


@pytest.mark.thorough
def test_triangles_refined_by_a_pilot_run_are_as_accurate():
    """With triangles that a pilot run refined, walls are as accurate as with small triangles everywhere."""
    path = fx.trace(trough(), until=fx.pressure(1.2), adapt_mesh={"error": 0.1}, progress=False)
    even = fx.trace(trough(size=0.075), until=fx.pressure(1.2), progress=False)
    errors = []
    for run in (path.pilot, even, path):
        wall = run.wall()
        there = (wall.middle[:, 0] > 0.8) & (wall.middle[:, 2] < -0.8)
        mean = np.average(wall.ratio[there], weights=wall.area[there])
        errors.append(abs(mean / (2 / np.pi * 0.2 ** (4 / np.pi - 1)) - 1))
    assert max(errors[1:]) < 4e-3 < errors[0] / 8
    assert len(path.wall().ratio) < 1.15 * len(even.wall().ratio) and path.counts.failures == 0
    assert path.problem.scene.mesh.boundaries.keys() == path.pilot.problem.scene.mesh.boundaries.keys()
    assert len(fx.mesh.adapted(path.pilot, max_rotation=None, error=1e9).nodes_of("rim")) < 5


@pytest.mark.thorough
def test_a_checkpoint_is_read_without_its_scene_and_checked_against_it(tmp_path):
    """A checkpoint is read without its scene, with its tools; a scene with another tool or thickness is refused."""
    at, floor = HELD, fx.tools.revolved(fx.tools.plane(-0.2).reversed())
    block_of = solid_of(tmp_path / "block.stl", block((-2, -2, -0.5), (2, 2, -0.2)))

    def scene(tool=floor, low=0.0, thickness=0.01):
        return disc(on="top", supports=at, contacts=[fx.Contact("bottom", tool.moved(z=low), name="floor")],
                    thickness=lambda x, y: thickness + 0.001 * x)
    for number, tool in enumerate((floor, block_of)):
        folder = tmp_path / f"run{number}"
        path = fx.trace(scene(tool), until=fx.pressure(0.02), progress=False, checkpoint=folder)
        assert main(["open", str(folder)]) == 0
        text = fx.report([path, folder], tmp_path / "both.html").read_text()
        assert text.count("its part and pictures are in the report of the path") == 2 and "No warnings" not in text
        assert "Sheet in three dimensions" in text
        assert main(["report", str(folder), "--density", "1"]) == 2                     # the density is not ignored
        assert "block.stl" in text if number else "revolved" in text
        for other in ({"low": -0.1}, {"thickness": 0.011}):
            with pytest.raises(fx.InputError, match="of another scene"):
                fx.load(folder, scene(tool, **other))
        assert len(fx.load(folder, scene(tool))) == len(path)
    with pytest.raises(fx.InputError, match="the pole needs a boundary named 'axis'"):
        fx.trace(scene(), until=fx.pole_height(0.1))


def test_a_run_in_three_dimensions_continues_from_a_checkpoint(tmp_path):
    scene, end = trough(), fx.pressure(0.4)
    whole = fx.trace(scene, until=end, progress=False, checkpoint=tmp_path / "run")
    on = fx.trace(scene, until=end, progress=False, start=fx.load(tmp_path / "run", scene, state=12))
    wall = whole.wall()
    assert len(on) == len(whole)
    np.testing.assert_allclose(on.wall().ratio, wall.ratio, rtol=1e-10)
    kept = (wall.wall * wall.area).sum()
    assert kept == pytest.approx(0.02 * 0.3, rel=1e-12)                             # the volume
    part = whole.part(density=1.0)
    assert part.volume == pytest.approx(2 * kept) and part.weight == pytest.approx(2 * kept)        # both sides
    assert part.min_wall == wall.wall.min() and part.draw_ratio == pytest.approx(wall.area.sum() / 0.3)
    cut = wall.section((0, 0.15, 0), (0, 1, 0))
    assert cut["arc_length"][-1] == pytest.approx(2.0, abs=0.25) and np.ptp(cut["y"]) < 1e-8   # met to 1e-9 of the size
    for normal in ((0, 1, 0), (0, -1, 0)):                                          # along a plane of symmetry
        edge = wall.section((0, 0, 0), normal)
        assert edge["arc_length"][-1] == pytest.approx(cut["arc_length"][-1], abs=0.05) and np.ptp(edge["y"]) < 1e-8
    assert wall.mean_ratio((0, 0, 0), 10.0) == pytest.approx((wall.ratio * wall.reference_area).sum() / 0.3)
    for far, message in ((lambda: wall.thickness_at(-0.5, 0.15), "not on the modelled sheet, X from 0 to 1 and Y"),
                         (lambda: wall.mean_ratio((0, 0, 9.0), 0.1), "is 9.* away from the modelled part")):
        with pytest.raises(fx.InputError, match=message):
            far()
    with pytest.raises(fx.InputError, match=r"normal = \(0, 0, 0\): must not be 0"):
        whole.wall().section((0, 0.15, 0), (0, 0, 0))
    whole.to_stl(tmp_path / "part.stl")
    assert fx.tools.solid(tmp_path / "part.stl").volume == pytest.approx(2 * kept, rel=0.005)
    whole.shell_model(tmp_path / "part.inp")
    assert (tmp_path / "part.inp").read_text().count("*SHELL SECTION") == len(wall.wall)
    filled = whole.filling()
    assert filled.touching[-1] > 0.9 and filled.gap[-1] < 1e-3 < filled.gap[0] == pytest.approx(1.0)


def test_trim_and_printed_squares_are_exact():
    """Trimmed triangles count by their share beyond the plane; undeformed printed lines are where they were printed."""
    d = np.array([(1, -1, -1), (-1, 1, 1), (3, -1, 3), (0, 1, 1), (1, 1, 1), (-1, 0, 0), (-1, -1, -1)], dtype=float)
    np.testing.assert_allclose(_positive_share(d), [1 / 4, 3 / 4, 15 / 16, 1, 1, 0, 0], atol=1e-15)
    path = fx.solve(disc(), to=0.001, increments=1)
    wall, z = path.wall(), path.wall().deformed_points[:, 2]
    low, high = (path.part(trim=share * z[np.argmax(np.abs(z))]) for share in (0.2, 0.6))
    assert path.part().volume > low.volume > high.volume > 0 and low.scrap < high.scrap
    assert low.scrap == pytest.approx(1 - low.volume / path.part().volume, rel=1e-12)
    lines = path.wall(path.states[0]).printed(0.25)
    assert len(lines) == 10 and sum(len(line) for line in lines) > 50
    for line, (axis, at) in zip(lines, [(axis, 0.25 * k) for axis in (0, 1) for k in range(5)]):
        np.testing.assert_allclose(line[:, axis], at, atol=1e-6)
    assert wall.printed(0.25)[1].shape[1] == 3
    for size in (1e-3, 1e-200):                                  # a size in metres, of a sheet in millimetres
        with pytest.raises(fx.InputError, match=f"size = {size}.* more than 500000 squares .* sides are 1 and 1"):
            wall.printed(size)


@pytest.mark.thorough
def test_ranks():
    script = """
import json, sys
sys.path.insert(0, "tests")
import formingx as fx
from formingx import _compat
from test_space import trough
path = fx.trace(trough(), until=fx.pressure(0.2), progress=False)
wall = path.wall()
if path.problem.comm.rank == 0:
    print(json.dumps([wall.ratio.tolist(), path["enclosed_volume"].tolist(), path["contact_area"].tolist()]))
"""
    for one, two in zip(*(run_json(script, ranks) for ranks in (1, 2))):
        np.testing.assert_allclose(two, one, rtol=1e-10, atol=1e-12)


def test_box_distance_is_exact():
    """Distances to floor, walls, fillets and corners of a box and a plug are exact, also of moved tools."""
    box = fx.tools.box(half=(1.0, 1.5), depth=1.0, corner=0.3, fillet=0.2)
    inside = [(0.9, 0, -0.5), (0.9, 1.4, -0.5), (0, 0, -0.9), (0.95, 0, -0.95), (0.75, 0.2, -0.9), (0.5, 0, -0.3)]
    corner = 0.3 - np.hypot(0.2, 0.2)
    expected = [0.1, corner, 0.1, 0.2 - np.hypot(0.15, 0.15), 0.1, 0.5]
    np.testing.assert_allclose(-box.signed_distance(inside), expected, atol=1e-12)
    assert box.signed_distance([(1.1, 0, -0.5)])[0] == pytest.approx(0.1)
    away = box.moved(x=1.0).moved(x=1.0, z=-2.0)
    np.testing.assert_allclose(-away.signed_distance(np.array(inside) + (2, 0, -2)), expected, atol=1e-12)
    np.testing.assert_allclose(away.bounds, box.bounds + (2, 0, -2), atol=1e-12)
    plug = fx.tools.box(half=(0.5, 0.8), depth=1.0, corner=0.2, mouth=1.0, plug=True)
    np.testing.assert_allclose(plug.signed_distance([(0, 0, -0.2), (0, 0, 0.1)]), [-0.2, 0.1], atol=1e-12)


def test_tools_from_stl_have_exact_distances_and_known_undercuts(tmp_path):
    box = fx.tools.box(half=(1.0, 1.5), depth=1.0, corner=0.3, fillet=0.2, draft=3.0)
    box.to_stl(tmp_path / "box.stl", wall=0.3)
    solid = fx.tools.solid(tmp_path / "box.stl")
    x = np.random.default_rng(1).uniform([-1, -1.5, -1.1], [1, 1.5, -0.1], (2000, 3))
    near = np.abs(box.signed_distance(x)) < 0.1
    np.testing.assert_allclose(solid.signed_distance(x)[near], box.signed_distance(x)[near], atol=1e-3)
    found = solid.undercuts()
    assert found["undercut_area"] == 0 and found["min_draft"] == pytest.approx(3.0, abs=0.01)
    behind = fx.tools.revolved(fx.Tool([(2.0, 0.0), (0.8, 0.0), (1.0, -1.0), (0.0, -1.0)]))     # wider below its mouth
    behind.to_stl(tmp_path / "behind.stl", wall=0.3)
    assert fx.tools.solid(tmp_path / "behind.stl").undercuts()["undercut_area"] == pytest.approx(
        np.pi * 1.8 * np.hypot(1.0, 0.2), rel=1e-3)
    with pytest.raises(fx.InputError, match="its profile to end at r = 0"):
        fx.tools.revolved(fx.Tool([(2.0, 0.0), (1.0, 0.0), (0.5, -1.0)])).to_stl(tmp_path / "hole.stl", wall=0.3)
    with pytest.raises(fx.InputError, match=r"along = \(0, 0, 0\): must not be 0"):
        solid.undercuts(along=(0, 0, 0))
    with pytest.raises(fx.InputError, match="inside out.*inverted=False"):
        fx.tools.solid(tmp_path / "box.stl", inverted=True)
    points, triangles = solid.surface()
    write_stl(points, triangles[1:], tmp_path / "open.stl")
    with pytest.raises(fx.InputError, match=r"open.stl' is open: 3 edges .* one at \("):
        fx.tools.solid(tmp_path / "open.stl")
    write_stl(points, np.vstack([triangles[:1, ::-1], triangles[1:]]), tmp_path / "turned.stl")
    with pytest.raises(fx.InputError, match="look the other way than their neighbours, at 3 edges"):
        fx.tools.solid(tmp_path / "turned.stl")
    with pytest.raises(fx.InputError, match="units of length the same"):
        disc(contacts=[fx.Contact("bottom", fx.tools.solid(tmp_path / "box.stl", scale=25.4).moved(z=-30))])
    large = fx.tools.solid(tmp_path / "box.stl", scale=1.25).moved(z=-0.1)
    for tool, told in ((large, True), (solid, False)):
        report = str(fx.check(disc(contacts=[fx.Contact("bottom", tool)])))
        assert ("times as wide as the sheet: is its file in another unit of length?" in report) == told
    assert r"Symmetry('y0', 'y')" in str(fx.check(disc(supports=HELD[:2]))) and fx.check(disc()).healthy
    floor = fx.tools.revolved(fx.tools.plane(-1.0).reversed())                   # a plane is 1 long in drawings
    fx.Scene(mesh=fx.mesh.sheet(fx.mesh.circle(50.0, part="quarter"), 20.0), thickness=0.5, materials=MATERIALS[0],
             supports=HELD, loads=[fx.Pressure("top")], contacts=[fx.Contact("bottom", floor)])


def block(low, high, inward=False):
    """Points and triangles of a block."""
    points = np.array(np.meshgrid(*zip(low, high), indexing="ij")).reshape(3, -1).T
    sides = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    triangles = np.array([t for a, b, c, d in sides for t in ((a, b, c), (a, c, d))])
    return points, triangles[:, ::-1] if inward else triangles


def solid_of(file, *blocks):
    write_stl(np.vstack([points for points, _ in blocks]),
              np.vstack([triangles + 8 * k for k, (_, triangles) in enumerate(blocks)]), file)
    return fx.tools.solid(file)


@pytest.mark.parametrize("low, high", [
    ((1, 0.5, 0.5), (2, 1.5, 3)), ((2, 0, 0), (6, 2, 1)), ((1, 0.8, -2), (1.4, 1.2, 3)), ((1, 0.5, 1), (2, 1.5, 2)),
    ((1, 0.5, 2), (2, 1.5, 3)), ((1, 0.5, 0.2), (2, 1.5, 0.8)), ((4, 0, 0), (6, 2, 1)), ((4, 2, 0), (5, 3, 1))],
    ids=["corner", "as wide", "bar", "upon", "apart", "within", "beside", "at an edge"])
def test_bodies_of_a_file_are_one_tool(low, high, tmp_path):
    """The distance to the union of two blocks is exact, whether they touch, overlap or are apart."""
    ends = np.array([[(0, 0, 0), low], [(4, 2, 1), high]], float)
    tool = solid_of(tmp_path / "two.stl", *(block(*ends[:, k]) for k in (0, 1)))
    x = np.random.default_rng(3).uniform(-1, 5, (4000, 3))
    off = np.maximum(ends[0][:, None] - x, x - ends[1][:, None])
    exact = -(np.linalg.norm(np.maximum(off, 0), axis=2) + np.minimum(off.max(2), 0)).min(0)
    np.testing.assert_allclose(tool.signed_distance(x), exact, atol=1e-6)


def test_hollows_and_turned_bodies_of_a_file(tmp_path):
    outer = block((0, 0, 0), (4, 2, 1))
    hollow = solid_of(tmp_path / "hollow.stl", outer, block((1, 0.5, 0.2), (2, 1.5, 0.8), inward=True))
    np.testing.assert_allclose(hollow.signed_distance([(1.5, 1, 0.5), (0.5, 1, 0.5)]), [-0.3, 0.5], atol=1e-6)
    with pytest.raises(fx.InputError, match=r"a body around \(1.5, 1, 2.5\) that is inside out"):
        solid_of(tmp_path / "turned.stl", outer, block((1, 0.5, 2), (2, 1.5, 3), inward=True))


def test_axes_of_a_sheet_in_three_dimensions_are_x_and_y(tmp_path):
    """Messages about functions of position, and columns of a temperature file, have the names x and y."""
    warm = fx.NeoHookean(c10=fx.of_temperature(lambda T: 1.0 + 0 * T))
    broken = lambda x, y: np.where(x > 0.3, np.nan, 1.0)  # noqa: E731
    for given in ({"material": fx.NeoHookean(c10=broken)}, {"material": warm, "temperature": broken}):
        with pytest.raises(fx.InputError, match=r"is nan, not a finite number, at \(x, y\) ="):
            disc(**given)
    (tmp_path / "T.csv").write_text("x,T\n0,100\n2,120\n")
    assert disc(material=warm, temperature=tmp_path / "T.csv").temperature.T.x.array.max() == pytest.approx(110)
    for text, words in (("R,T\n0,100\n2,120\n", "must have T, and x, y, z, one or more of them"),
                        ("x,T\n0,100\n2,120\n0,110\n", "two temperatures, 100 and 110, at x = 0")):
        (tmp_path / "T.csv").write_text(text)
        with pytest.raises(fx.InputError, match=words):
            disc(material=warm, temperature=tmp_path / "T.csv")


def plug_above(separates):
    plug = fx.tools.box(half=(0.4, 0.4), depth=0.9, corner=0.2, fillet=0.12, draft=5, mouth=1.2, plug=True)
    return fx.Contact("top", plug, direction=(0, 0, -1), name="plug", separates=separates)


@pytest.mark.parametrize("separates", [True, False])
def test_a_plug_goes_in_and_back_out(separates):
    """If points may separate, the withdrawn plug leaves the sheet flat and undeformed; else the sheet sticks to it."""
    scene = disc(size=0.15, contacts=[plug_above(separates)], model=fx.Membrane(wrinkles=0.01))
    path = fx.Process(scene).run([fx.Stage("in", control="plug", until=fx.travel(0.8)),
                                  fx.Stage("out", control="plug", until=fx.travel(0.0))], progress=False)
    end, begin = ([s for s in path.states if s.stage == stage][k].measures for stage, k in (("in", -1), ("out", 0)))
    assert begin["plug_force"] == pytest.approx(end["plug_force"], rel=1e-6) and end["plug_force"] > 0.01
    assert path.counts.failures < 3 and path.counts.iterations < 400
    height, last = path.wall().deformed_points[:, 2], path.last.measures
    if separates:
        assert np.abs(height).max() < 1e-9 and last["contact_area"] == last["plug_force"] == 0
        np.testing.assert_allclose(path.wall().ratio, 1.0, rtol=1e-9)
    else:
        assert height.max() > 0.3 and last["plug_force"] < -1e-4


def test_a_plug_is_withdrawn_without_force_from_a_sheet_held_by_vacuum():
    """After a vacuum has pressed the sheet onto the mould, the plug is withdrawn without force, and walls stay."""
    mould = fx.Contact("bottom", fx.tools.revolved(fx.Tool([(3.0, 0.0), (1.0, 0.0), (0.9, -0.7), (0.0, -0.7)],
                                                           [0.0, 0.0, 0.15, 0.0])), name="mould")
    scene = disc(size=0.15, loads=[fx.Pressure("top", name="vacuum")], contacts=[plug_above(True), mould],
                 model=fx.Membrane(wrinkles=0.01))
    path = fx.Process(scene).run([fx.Stage("in", control="plug", until=fx.travel(0.8)),
                                  fx.Stage("vacuum", control="vacuum", until=fx.pressure(0.6)),
                                  fx.Stage("out", control="plug", until=fx.travel(0.0))], progress=False)
    formed = next(s for s in path.states if s.stage == "out")
    np.testing.assert_allclose(path.wall().ratio, path.wall(formed).ratio, rtol=1e-8)
    assert path.last.measures["plug_force"] == 0 and path.filling("mould").touching[-1] > 0.9
    assert path.counts.failures == 0


def test_trough_without_friction():
    """A strip that slides has a constant wall, its width over the length of the profile, with second-order errors.

    A pressure normal to the chords would add p l^2/(4 R) to the tension p/17 on the fillet, which is 4 %.
    """
    errors, whole = [], 2 - (2 - np.pi / 2) * 0.2
    for size in (0.1, 0.05):
        path = fx.trace(trough(size, friction="none", nodes_per_step=0.03), until=fx.pressure(1.2), progress=False)
        wall, (x, _, z) = path.wall(), path.wall().middle.T
        assert np.average(wall.ratio, weights=wall.area) == pytest.approx(1 / whole, rel=0.2 * size**2)
        errors.append([np.average(wall.ratio[there], weights=wall.area[there]) * whole - 1
                       for there in (x < 0.75, z > -0.75, (x > 0.8) & (z < -0.8))])
        assert path.counts.failures == 0 and path.counts.iterations < 250
    coarse, fine = np.abs(errors)
    assert np.all(fine < (4e-3, 4e-3, 0.015)) and np.all(coarse > 2.5 * fine)


@pytest.mark.parametrize("value", [0.3, 0.5])
def test_states_at_targets_of_a_sliding_sheet_depend_on_no_steps(value):
    """`Path.state_at`, a run that stops there and one with many targets before agree while gaps close on the fillet."""
    end, target, column = fx.pressure(1.2), fx.pressure(value), "mould_force"
    before = np.linspace(0.05, value - 0.05, 10).round(3)
    path, stopped, fine = (fx.trace(trough(0.1, friction="none"), until=until, progress=False, intermediate=[
        fx.pressure(p) for p in given]) for until, given in ((end, []), (target, []), (end, [*before, value])))
    assert path.state_at(target).measures[column] == pytest.approx(stopped.last.measures[column], rel=1e-9)
    for other in (stopped.wall(), fine.wall(fine.target_state(target))):
        np.testing.assert_allclose(path.wall(path.state_at(target)).ratio, other.ratio, rtol=1e-5)
    np.testing.assert_allclose(path.wall().ratio, fine.wall().ratio, rtol=1e-8)


def test_a_target_whose_second_solution_fails_keeps_the_first(monkeypatch):
    """If Newton's method fails with the renewed contact pressure, the state at the target is the one before."""
    def run():
        path = fx.trace(trough(0.1, friction="none"), until=fx.pressure(0.4), progress=False)
        return path.wall().ratio
    renewed, renew, solve, fails = run(), LaggedCorrections.renew, Curve.solve_again, []

    def remember(limit, new):
        fails[:] = [1] if (found := renew(limit, new)) else []
        return found

    def failing(*args):
        if fails:
            fails.clear()
            raise Failure("on purpose", [])
        return solve(*args)
    monkeypatch.setattr(LaggedCorrections, "renew", remember)
    monkeypatch.setattr(Curve, "solve_again", failing)
    kept = run()
    monkeypatch.setattr(LaggedCorrections, "renew", lambda limit, new: False)
    np.testing.assert_array_equal(kept, run())
    assert np.abs(kept / renewed - 1).max() > 0.02


def test_a_target_whose_pressures_diverge_keeps_the_first_solution(monkeypatch):
    """If the difference of the pressures grows from one solution to the next, the state is the one before them."""
    def run():
        path = fx.trace(trough(0.1, friction="none"), until=fx.pressure(0.4), progress=False)
        return path.wall().ratio
    renew, differences = LaggedCorrections.renew, []

    def grow(limit, new):
        differences.append(0.1 * 1.1 ** len(differences))
        return renew(limit, new) or True
    monkeypatch.setattr(LaggedCorrections, "renew", grow)
    monkeypatch.setattr(LaggedCorrections, "_difference", lambda limit: differences[-1])
    kept = run()
    monkeypatch.setattr(LaggedCorrections, "renew", lambda limit, new: False)
    np.testing.assert_array_equal(kept, run())
    assert len(differences) > 10


@pytest.mark.thorough
def test_an_adapted_trough_without_friction():
    """The wall in the fillet is exact to 1 %, with fewer triangles than an even mesh whose error is 1.3 %."""
    path = fx.trace(trough(0.1, friction="none", nodes_per_step=0.03), until=fx.pressure(1.2), adapt_mesh=True,
                    progress=False)
    wall, (x, _, z) = path.wall(), path.wall().middle.T
    fillet = (x > 0.8) & (z < -0.8)
    mean = np.average(wall.ratio[fillet], weights=wall.area[fillet])
    assert mean == pytest.approx(1 / (2 - (2 - np.pi / 2) * 0.2), rel=0.01)
    assert len(wall.ratio) < len(fx.mesh.sheet([(0, 0), (1, 0), (1, 0.3), (0, 0.3)], 0.05).domain.geometry.dofmap)
    assert path.counts.failures == 0


def test_sliding_tractions_have_their_stiffness():
    """Tractions near floor, wall, fillet and corner of a box agree with k d n, their stiffness with differences."""
    law = fx.Contact("bottom", fx.tools.box(half=(1.0, 1.5), depth=1.0, corner=0.3, fillet=0.2), "none").law(
        100.0, 0.02, np.zeros((1, 3)))
    turn, off = np.radians(40.0), np.array([-1e-3, 2e-3, 1e-3, -2e-3])[:, None]
    ring = 0.1 + 0.2 * np.sin(turn)                          # of the fillet, round the corner
    at = np.array([(0.2, 0.1, -1.0), (1.0, 0.3, -0.5), (0.8 + 0.2 * np.sin(turn), 0.0, -0.8 - 0.2 * np.cos(turn)),
                   (0.7 + ring * np.sqrt(0.5), 1.2 + ring * np.sqrt(0.5), -0.8 - 0.2 * np.cos(turn))])
    outward = np.array([(0, 0, -1), (1, 0, 0), (np.sin(turn), 0, -np.cos(turn)),
                        (np.sin(turn) * np.sqrt(0.5), np.sin(turn) * np.sqrt(0.5), -np.cos(turn))])
    x = at + off * outward
    old = law.start(x)._replace(distance=np.zeros(4))                        # all are held
    found = law.tractions(x, old)
    np.testing.assert_allclose(found.force, 100.0 * off * outward, rtol=1e-3, atol=1e-6)
    for j, e in enumerate(1e-6 * np.eye(3)):
        quotient = (law.tractions(x + e, old).force - law.tractions(x - e, old).force) / 2e-6
        np.testing.assert_allclose(found.stiffness[:, :, j], quotient, atol=0.02)


def tray(friction, **more):
    """Return the scene of a quarter of a sheet that is pressed into a rounded tray."""
    sheet = fx.mesh.sheet(fx.mesh.rectangle(2.0, 3.0, corner=0.3, part="quarter"), size=0.1)
    tool = fx.tools.box(half=(1.0, 1.5), depth=1.0, corner=0.3, fillet=0.2)
    return fx.Scene(mesh=sheet, thickness=0.02, materials=fx.NeoHookean(c10=1.0), supports=HELD, loads=[
        fx.Pressure("top")], contacts=[fx.Contact("bottom", tool, friction, name="mould", **more)])


def on_ball(friction, pressure=0.02):
    """Return the scene of a quarter of a disc that a pressure holds on a ball which is pushed into it."""
    sheet = fx.mesh.sheet(fx.mesh.circle(1.0, part="quarter"), size=0.1)
    return fx.Scene(mesh=sheet, thickness=0.01, materials=fx.NeoHookean(c10=1.0), supports=HELD, loads=[
        fx.Pressure("bottom", value=pressure)], contacts=[fx.Contact("top", fx.tools.revolved(
            fx.tools.sphere(radius=0.5, z=0.0)), friction, direction=(0, 0, -1), name="mould")])


@pytest.mark.parametrize("angle", [0.0, 0.4, -1.1])
def test_relaxed_deformation_keeps_the_direction_of_the_larger_stretch(angle):
    """A sheet that wrinkles along its larger stretch of 1.5 is in simple tension in this direction."""
    t, across = np.array([np.cos(angle), np.sin(angle)]), np.array([-np.sin(angle), np.cos(angle)])
    F = np.linalg.cholesky(1.5**2 * np.outer(t, t) + 0.6**2 * np.outer(across, across)).T         # upper triangular
    given = ufl.as_tensor([[F[0, 0], F[0, 1], 0.0], [0.0, F[1, 1], 0.0], [0.0, 0.0, 1 / (1.5 * 0.6)]])
    U = relaxed(given)
    found = np.array([[float(U[i, j](())) for j in range(3)] for i in range(3)])
    l2 = 1.5**-0.5
    np.testing.assert_allclose(found[:2, :2], 1.5 * np.outer(t, t) + l2 * np.outer(across, across), atol=1e-12)
    assert found[2, 2] == pytest.approx(l2, rel=1e-12)


def test_a_half_filled_tray_without_friction_does_not_depend_on_steps():
    """The walls of two runs, one with steps three times as long, agree to 1e-6 at a target."""
    walls = [fx.trace(tray("none", nodes_per_step=share), until=fx.pressure(0.25), progress=False).wall().ratio
             for share in (0.01, 0.06)]
    np.testing.assert_allclose(walls[1], walls[0], rtol=1e-6)


def test_tray_without_friction():
    """The tray is filled in less than 250 iterations, and walls do not depend on the number of nodes per step.

    At the end all nodes touch. The last triangle then slides into the corner: its wall falls from .19 to .14 of the
    thickness while the pressure rises by 2 %. Newton's method may diverge in one step that reaches over this.
    """
    walls = []
    for share in (0.02, 0.06):
        path = fx.trace(tray("none", nodes_per_step=share), until=fx.pressure(1.2), progress=False)
        assert path.counts.failures < 2 and path.counts.iterations < 250 and path.filling().touching[-1] > 0.99
        walls.append(path.wall().ratio)
    np.testing.assert_allclose(walls[1], walls[0], rtol=1e-7)


@pytest.mark.parametrize("make, target, most, error", [
    (lambda: tray("none"), fx.pressure(0.1), 0.02, 1e-4),
    pytest.param(lambda: on_ball("none"), fx.travel(0.3), 0.03, 1e-4, marks=pytest.mark.thorough),
    pytest.param(lambda: tray("none"), fx.pressure(0.25), 0.02, 1e-6, marks=pytest.mark.slow),
    pytest.param(lambda: on_ball(0.3), fx.travel(0.6), 0.03, 5e-4, marks=pytest.mark.slow)],
    ids=["tray", "ball", "full tray", "rough ball"])
def test_states_at_targets_agree_with_shorter_steps(make, target, most, error):
    """Walls and reactions at a target are those of steps several times shorter; with friction, to its error in time."""
    (wall, force), (fine, exact) = ((path.wall().ratio, path.last.measures["mould_force"]) for path in (
        fx.trace(make(), until=target, step=step, progress=False) for step in (None, fx.StepControl(largest=most))))
    np.testing.assert_allclose(wall, fine, rtol=error)
    assert force == pytest.approx(exact, rel=error)


@pytest.mark.parametrize("move, direction, told", [
    ({}, None, False), ({"z": -0.1}, (0, 0, 1), False), ({"x": 0.1}, None, True), ({"y": -0.1}, None, True),
    ({}, (1, 0, 0), True), ({"x": 3.0}, None, False)])
def test_tools_across_a_plane_of_symmetry_are_found(move, direction, told):
    """A check finds a ball that lies across a plane of symmetry off its centre, or leaves it; not a ball beside it."""
    ball = fx.tools.revolved(fx.tools.sphere(radius=0.4, z=0.5)).moved(**move)
    scene = disc(contacts=[fx.Contact("top", ball.moved(z=0.5), direction=direction)])
    found = [f for f in fx.check(scene).findings if "not symmetric about the plane" in f.text]
    assert bool(found) == told
    if move and told:
        axis, = move
        assert f"the plane {axis} = 0 of Symmetry('{axis}0', '{axis}')" in found[0].text


@pytest.mark.parametrize("size, friction, told", [
    (0.15, "none", False), (0.3, "none", True), (0.3, 0.3, True), (0.3, "stick", True)])
def test_fillets_smaller_than_triangles_are_found(size, friction, told, caplog):
    """A check and a run warn of a fillet below the median edge of the triangles."""
    scene = trough(size, friction=friction)
    fx.trace(scene, until=fx.pressure(0.01), progress=False)
    for text in (str(fx.check(scene)), caplog.text):
        assert ("it has fillets of radius 0.2, and half of the edges of the triangles are longer" in text) == told


def _drafted():
    tool = fx.tools.box(half=(1.0, 1.5), depth=0.8, corner=0.4, fillet=0.15, draft=3.0)
    return (tool, fx.mesh.rectangle(2.0, 3.0, corner=0.4, part="quarter"),
            ((0, 0, -0.8), (0.95, 0, -0.4), (0.75, 1.2, -0.75)))


def _undercut():
    tool = fx.tools.revolved(fx.Tool([(2.0, 0.0), (0.9, 0.0), (1.0, -0.6), (0.0, -0.6)], [0.0, 0.05, 0.1, 0.0]))
    return tool, fx.mesh.circle(0.95, part="quarter"), ((0, 0, -0.6), (0.95, 0, -0.3), (0.93, 0, -0.55))


@pytest.mark.thorough
@pytest.mark.parametrize("make", [_drafted, _undercut])
def test_moulds_from_files_fill(make, tmp_path):
    """Walls in moulds from STL files, with draft or an undercut, agree with those of the exact tools to 0.5 %."""
    tool, outline, places = make()
    tool.to_stl(tmp_path / "mould.stl", wall=0.3)
    solid = fx.tools.solid(tmp_path / "mould.stl")
    assert (solid.undercuts()["undercut_area"] > 0.1) == (make is _undercut)
    walls = []
    for mould in (tool, solid):
        scene = fx.Scene(mesh=fx.mesh.sheet(outline, size=0.16), thickness=0.02, materials=fx.NeoHookean(c10=1.0),
                         supports=HELD, loads=[fx.Pressure("top")],
                         contacts=[fx.Contact("bottom", mould, name="mould")])
        path = fx.trace(scene, until=fx.pressure(1.2), progress=False)
        filled = path.filling()
        assert path.counts.failures == 0 and filled.touching[-1] > 0.98 and filled.gap[-1] < 2e-3
        walls.append([path.wall().mean_ratio(place, 0.1) for place in places])
    np.testing.assert_allclose(walls[1], walls[0], rtol=5e-3)


@pytest.mark.parametrize("make, words", [
    (lambda: trough(friction="none", separates=False), "a sheet in three dimensions that slides separates"),
    (lambda: trough(friction=0.3, separates=False), "a sheet in three dimensions that slides separates"),
    (lambda: disc(contacts=[fx.Contact("bottom", fx.tools.revolved(fx.tools.plane(-1.0).reversed()), "none",
                                       present_area=True)]), "present_area = True: is for sections"),
    (lambda: disc(model=fx.MixedPressure()), "a sheet in three dimensions is a Membrane"),
    (lambda: disc(on="rim"), "a pressure on its 'bottom' or its 'top'"),
    (lambda: disc(thickness=None), "needs a thickness"),
    (lambda: disc(loads=[fx.CentrifugalLoad(1.0)]), "spins about the axis"),
    (lambda: disc(supports=[*HELD, fx.PinnedNode(0.0, 0.0)]), "at its boundaries, not at nodes"),
    (lambda: fx.Scene(mesh=fx.mesh.disc(radius=1.0, thickness=0.1, elements=(2, 1)), materials=MATERIALS[0],
                      supports=[fx.Symmetry("axis"), fx.Symmetry("rim", "y")]), "a section has no component 'y'"),
    (lambda: disc(contacts=[fx.Contact("bottom", fx.tools.plane(1.0))]), "a sheet in three dimensions takes"),
    (lambda: disc(material=MATERIALS[3], contacts=[plug_above(True)]), "three dimensions that relaxes sticks"),
    (lambda: fx.trace(disc(), until=fx.pole_height(0.1), progress=False), r"take displacement\(..., at="),
    (lambda: fx.tools.box(half=(1.0, 1.0), depth=1.0, lip=0.1, plug=True), "lip = 0.1: a plug has no flange"),
    (lambda: fx.mesh.sheet([(0, 0), (1, 1), (1, 0), (0, 1)], 0.1), r"crosses or touches itself near \(0.5, 0.5\)"),
    (lambda: fx.mesh.sheet([(0, 0), (2, 0), (1, 0), (1, 1)], 0.1), "crosses or touches itself near"),
    (lambda: fx.mesh.sheet([(0, 0), (1, 0), (1, 0), (0, 1)], 0.1), r"the corner \(1, 0\) is there twice"),
    (lambda: fx.mesh.sheet(fx.mesh.circle(1.0), 0.3, names=["a"]), "1 names for 4 edges"),
    (lambda: fx.mesh.sheet(fx.mesh.circle(1.0), 0.3, layers=["a", "a"]), "layers.*each another"),
    (lambda: fx.mesh.sheet(fx.mesh.circle(1.0), 0.3, reflected=["x0"]), "reflected: boundary 'x0' is not known"),
    (lambda: fx.mesh.sheet(fx.mesh.circle(1.0, part="half"), 0.3, reflected=["x0", "x0"]), "known: 'rim'"),
    (lambda: fx.mesh.sheet(fx.mesh.circle(1.0, part="half"), 0.3, reflected=["rim"]), "'rim' is not straight"),
    (lambda: fx.mesh.sheet([(0, 0), (1, 0), (1, -1), (2, -1), (2, 1), (0, 1)], 0.3, names=[*"abcdef"],
                           reflected=["a"]), "'a': the sheet meets its line at other places"),
    (lambda: fx.mesh.sheet([(0, 0), (1, 0), (1, 0.5), (2, 0.5), (2, 0), (3, 0), (3, 1), (0, 1)], 0.3,
                           names=[*"abcdefgh"], reflected=["a"]), "'a': the sheet meets its line at other places"),
    (lambda: fx.mesh.sheet(fx.mesh.circle(1.0), lambda x, y: x), r"size at \(-.*: must be greater than 0"),
    (lambda: fx.mesh.sheet(fx.mesh.circle(1.0), lambda x: x), "the function fails: TypeError"),
    (lambda: fx.mesh.sheet(fx.mesh.circle(1.0), lambda x, y: 1e-5 + x * x), "more than 500000 triangles"),
    (lambda: fx.mesh.sheet(fx.mesh.circle(1.0), lambda x, y: np.nan if 1e-3 < x < 0.02 else 0.03), "size at.*nan"),
])
def test_unsupported_scenes_in_three_dimensions_are_refused(make, words):
    with pytest.raises(fx.InputError, match=words):
        make()


def test_results_of_sections_are_refused_for_sheets_in_three_dimensions(tmp_path):
    """A path of a sheet refuses results of sections in words; its fields of thickness agree with `Path.wall`."""
    path = fx.trace(trough(), until=fx.pressure(0.2), progress=False)
    for name in ("stability", "profile", "deformed_mesh", "springback", "contact"):
        with pytest.raises(fx.InputError, match="in three dimensions"):
            getattr(path, name)()
    with pytest.raises(fx.InputError, match="springback.*needs bending stiffness.*shell_model"):
        path.springback()
    with pytest.raises(fx.InputError, match="stability.*in three dimensions"):
        fx.trace(trough(), until=fx.pressure(0.2), stop_at=fx.instability(), progress=False)
    assert fx.check(path, targets=[fx.pressure(0.2)]).findings == []
    plug = fx.Contact("top", fx.tools.box(half=(0.3, 0.1), depth=0.2, mouth=0.5, plug=True), direction=(0, 0, 1))
    scene = fx.Scene(mesh=disc().mesh, thickness=0.02, materials=MATERIALS[0], supports=HELD, contacts=[plug])
    assert "must it be direction = (0, 0, -1)?" in str(fx.check(scene))
    fields = Fields(path).evaluate(path.last)
    np.testing.assert_allclose(np.sort(fields["thickness"][:, 0, 0]), np.sort(path.wall().wall), rtol=1e-12)
    np.testing.assert_allclose(fields["thickness_ratio"] * 0.02, fields["thickness"], rtol=1e-12)
    assert fields["displacement"].shape[-1] == 3 and fields["displacement"][..., 2].min() < -0.1
    path.to_vtk(tmp_path / "tray.pvd")
    assert (tmp_path / f"tray-{len(path) - 1}.vtu").exists()


def test_a_sheet_that_sticks_to_a_flange_is_not_in_compression():
    """Its points move by their elastic slip only."""
    sheet = fx.mesh.sheet(fx.mesh.rectangle(140, 100, corner=8, part="quarter"), size=12)
    mould = fx.tools.box(half=(60, 40), depth=18, corner=14, fillet=7, lip=3, draft=6)
    scene = fx.Scene(mesh=sheet, thickness=0.8, materials=fx.NeoHookean(c10=0.05), loads=[fx.Pressure("top")],
                     supports=[fx.SimplySupported("rim"), fx.Symmetry("x0", "x"), fx.Symmetry("y0", "y")],
                     contacts=[fx.Contact("bottom", mould)])
    path = fx.trace(scene, until=fx.pressure(0.05), progress=False)
    assert path.wall().stretches.min() < 1 - 1e-7 and not path.wall().wrinkled.any()
    assert not any("compression" in finding.text for finding in path.findings())     # its triangles are coarse


@pytest.mark.parametrize("wrinkles", [None, 0.01])
def test_report_warns_of_compression_without_relaxed_energy(tmp_path, monkeypatch, wrinkles):
    """The report warns of compression only without relaxed energy; without a screen it says that pictures lack."""
    path = fx.solve(disc(model=fx.Membrane(wrinkles=wrinkles)), to=0.001, increments=1)
    wall = path.wall()
    monkeypatch.setattr(path, "wall", lambda state=None: replace(wall, deformed_points=0.9 * wall.reference_points))
    monkeypatch.setattr(shutil, "which", lambda program: None)
    monkeypatch.setattr(views, "_window_without_screen", lambda: None)
    monkeypatch.delenv("DISPLAY", raising=False)
    text = path.report(tmp_path / "report.html", density=1.0, units=fx.Units("mm", "MPa")).read_text()
    assert ("<b>serious</b>: 100 % of the sheet is in compression" in text) == (wrinkles is None)
    assert bool(path.findings()) == (wrinkles is None)
    assert "Lengths in mm, stresses in MPa, forces in N." in text and "<h2>Made with</h2>" in text
    assert "No pictures: a 3-D view needs a screen" in text


@pytest.mark.thorough
def test_views_are_written(tmp_path):
    """The picture of a sheet has more than 100 colours, and its report has two pictures."""
    path = fx.solve(disc(), to=0.001, increments=1)
    path.view3d(tmp_path / "sheet.png", grid=0.25)
    path.report(tmp_path / "report.html")
    assert np.unique(imread(tmp_path / "sheet.png").reshape(-1, 4), axis=0).shape[0] > 100
    assert (tmp_path / "report.html").read_text().count("<img") == 2


def test_a_run_that_ends_early_names_the_reason():
    with pytest.raises(fx.ConvergenceError, match="max_steps = 3 were used up") as failure:
        fx.trace(trough(), until=fx.pressure(1.0), max_steps=3, progress=False)
    assert len(failure.value.path) == 4
    loose = fx.Scene(mesh=disc().mesh, thickness=0.01, materials=MATERIALS[0], supports=HELD[:1],
                     loads=[fx.Gravity(density=1e-3)])
    with pytest.raises(fx.ConvergenceError, match="Out-of-balance forces.* displacement"):
        fx.solve(loose, to=1.0, increments=2)


def test_relaxed_energy_gives_way_in_compression():
    """Below the width of simple tension, the energy grows with 1 % of the material's energy (wrinkles=0.01)."""
    forms = Problem(disc(model=fx.Membrane(wrinkles=0.01))).forms

    def energy(a, b):
        forms.w.sub(0).interpolate(lambda X: np.stack([(a - 1) * X[0], (b - 1) * X[1], 0 * X[2]]) / forms.length)
        return forms.integral(forms.potential)
    taut, natural = energy(2.0, 1.0), energy(2.0, 2**-0.5)
    assert natural < taut
    full = Problem(disc()).forms
    full.w.sub(0).interpolate(lambda X: np.stack([X[0], -0.5 * X[1], 0 * X[2]]) / full.length)
    assert energy(2.0, 0.5) - natural == pytest.approx(0.01 * (full.integral(full.potential) - natural), rel=1e-4)


@pytest.mark.thorough
def test_ribbed_tray_quick(tmp_path):
    found = summary("ribbed_tray", tmp_path, "--quick")
    coarse = found["size_16"]
    assert found["mould"]["undercut_area"] == 0 and coarse["touching"] > 0.95
    assert coarse["weight_g"] == pytest.approx(27.57, rel=0.02) and 0.4 < coarse["least_wall_mm"] < 0.8
    assert coarse["least_wall_mm"] <= coarse["least_wall_around_mm"] < 0.9
    assert (tmp_path / "part.stl").stat().st_size > 1000


def deep_tray(size, half=(80, 50), depth=30, corner=20, fillet=8, draft=5):
    """A quarter of a tray under stick."""
    sheet = fx.mesh.sheet(fx.mesh.rectangle(2 * half[0], 2 * half[1], corner=20, part="quarter"), size=size)
    mould = fx.tools.box(half=half, depth=depth, corner=corner, fillet=fillet, draft=draft)
    scene = fx.Scene(mesh=sheet, thickness=1.0, materials=fx.NeoHookean(c10=0.05), loads=[fx.Pressure("top")],
                     supports=[fx.SimplySupported("rim"), fx.Symmetry("x0", "x"), fx.Symmetry("y0", "y")],
                     contacts=[fx.Contact("bottom", mould, name="mould")])
    return fx.trace(scene, until=fx.pressure(0.05), progress=False)


@pytest.mark.thorough
@pytest.mark.parametrize("size, box", [
    (12, {}), (8, {}), (10, {"half": (60, 60), "depth": 40, "corner": 25, "fillet": 12})])
def test_error_of_the_minimum_wall_of_a_tray(size, box):
    """The estimate lies between half and three times the difference to triangles of a quarter of the size."""
    path = deep_tray(size, **box)
    part, fine = path.part(), deep_tray(size / 4, **box).part()
    assert 0.5 < part.min_wall_error / (part.min_wall - fine.min_wall) < 3.0
    assert "too large by about" in str(part) and fine.min_wall_error < 0.6 * part.min_wall_error
    warned = [finding for finding in path.findings() if finding.about == "wall"]
    assert bool(warned) == (part.min_wall_error > 0.2 * part.min_wall)
