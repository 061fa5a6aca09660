"""Curved surfaces in three dimensions: meshes, files, forms, walls, and inflation against membrane theory."""

import numpy as np
import pytest
from conftest import run_json
from membrane_of_revolution import LENGTH, limit_point
from test_derivatives import assert_derivatives, difference, random_state

import formingx as fx
from formingx.io.stl import write_stl
from formingx.problem.problem import Problem

CAPPED = {"radius": 16.0, "length": 100.0, "elements": (12, 4), "part": "quarter", "end": "closed"}
SYMMETRIES = {"quarter": [fx.Symmetry("x0", "x"), fx.Symmetry("y0", "y")], "half": [fx.Symmetry("x0", "x")],
              "whole": []}


def scene(mesh=None, part="quarter", material=None, thickness=0.5, **more):
    """A closed tube that hangs from its neck under a pressure inside."""
    mesh = fx.mesh.tube(**CAPPED | {"part": part}) if mesh is None else mesh
    return fx.Scene(mesh=mesh, thickness=thickness, materials=material or fx.NeoHookean(c10=0.5),
                    supports=[fx.Clamped("neck"), *SYMMETRIES[part]],
                    **{"loads": [fx.Pressure("inner")]} | more)


def held_tube(elements, part="quarter", thickness=0.025):
    """A tube of radius 1 and length 4 whose ends are held."""
    mesh = fx.mesh.tube(radius=1.0, length=LENGTH, elements=elements, part=part)
    return fx.Scene(mesh=mesh, thickness=thickness, materials=fx.NeoHookean(c10=0.5),
                    supports=[fx.Clamped("neck"), fx.Clamped("end"), *SYMMETRIES[part]], loads=[fx.Pressure("inner")])


def limit_of(elements, part="quarter"):
    """Limit pressure R / (mu H), and the volume there over the first one, of the tube in three dimensions."""
    path = fx.trace(held_tube(elements, part), until=fx.enclosed_volume(30.0), progress=False)
    (limit,) = path.limit_points
    first = path.problem.scene.mesh.enclosed_volume() * path.problem.scene.symmetry_factor
    return limit.measures["pressure"] / 0.025, 1 + limit.measures["enclosed_volume"] / first


def test_free_inflation_converges_to_membrane_theory():
    """A ring of chords of half angle a that encloses the area of its circle carries p sqrt(a tan a) / a = 1 + a^2/6.

    The rest, of chords along the meridian, is of second order, too. Nodes on the circle give 1/cos(a), and a pressure
    that is 0.66 % too large at 27 x 8.
    """
    pressure, volume = limit_point()
    assert (pressure, volume) == (pytest.approx(0.91071, abs=1e-5), pytest.approx(2.7368, abs=2e-4))
    coarse, fine = (np.array(limit_of(elements)) / (pressure, volume) - 1 for elements in ((14, 4), (27, 8)))
    assert 0 < fine[0] < 5e-3 and abs(fine[1]) < 1e-3
    assert np.log2(coarse[0] / fine[0]) == pytest.approx(2, abs=0.2)


@pytest.mark.parametrize("length, elements, material, volume", [
    (5.0, (27, 8), fx.MooneyRivlin(c10=0.4, c01=0.012), 37.5),            # the path turns within a long step
    (6.0, (14, 4), fx.MooneyRivlin(c10=0.3, c01=0.03), 54.0)])            # a long step passes maximum and minimum
def test_limit_point_is_found_within_a_long_step(length, elements, material, volume):
    """Shorter steps have the same maximum."""
    tube = fx.Scene(mesh=fx.mesh.tube(radius=1.0, length=length, elements=elements, part="quarter"), thickness=0.03,
                    materials=material, supports=[fx.Clamped("neck"), fx.Clamped("end"), *SYMMETRIES["quarter"]],
                    loads=[fx.Pressure("inner")])
    path = fx.trace(tube, until=fx.enclosed_volume(volume), progress=False)
    (limit,) = path.limit_points
    shorter = fx.trace(tube, until=fx.enclosed_volume(volume), progress=False, step=fx.StepControl(largest=0.01))
    assert limit.measures["pressure"] == pytest.approx(shorter["pressure"].max(), rel=1e-6)


@pytest.mark.thorough
def test_free_inflation_on_a_fine_mesh_and_parts():
    pressure, volume = limit_point()
    fine = np.array(limit_of((53, 16))) / (pressure, volume) - 1
    assert 0 < fine[0] < 1.1e-3 and abs(fine[1]) < 2e-4
    quarter, half, whole = (limit_of((20, columns), part) for columns, part in (
        (6, "quarter"), (12, "half"), (24, "whole")))
    assert half == pytest.approx(quarter, rel=1e-6) and whole == pytest.approx(quarter, rel=1e-6)


@pytest.mark.parametrize("material", [fx.NeoHookean(c10=2.0), pytest.param(
    fx.Viscoelastic(fx.NeoHookean(c10=0.5), [(1.0, 1.0)]), marks=pytest.mark.thorough)])
def test_residual_and_tangent_are_derivatives(material):
    mesh = fx.mesh.tube(radius=1.0, length=2.0, elements=(3, 3), part="quarter", end="closed")
    problem = Problem(scene(mesh, material=material, thickness=0.1, model=fx.Membrane(wrinkles=0.01)))
    assert_derivatives(problem, *random_state(problem, size=0.05))


@pytest.mark.parametrize("on", ["inner", "outer"])
def test_pressure_does_the_work_p_dV(on):
    problem = Problem(scene(loads=[fx.Pressure(on)]))
    forms, (x, d) = problem.forms, random_state(problem, size=0.05)
    volume, derivative = fx.enclosed_volume(1.0).bind(problem), problem.x.duplicate()
    problem.control_derivative(x, 0.0, derivative)
    work = -derivative.dot(d) * forms.stress * forms.volume * problem.scene.symmetry_factor / forms.control_scale
    assert work == pytest.approx(difference(lambda y: volume.value(y, 0.0), x, d, 1e-5), rel=1e-8)


def test_swept_volume_is_the_change_of_the_volume_with_flat_lids():
    path = fx.trace(held_tube((8, 4)), until=fx.enclosed_volume(5.0), progress=False)
    wall, mesh = path.wall(), path.problem.scene.mesh
    from formingx.extensions.space.surface_mesh import volume_within
    assert 4 * volume_within(wall.reference_points, wall.triangles) == pytest.approx(4 * mesh.enclosed_volume())
    assert 4 * (volume_within(wall.deformed_points, wall.triangles) - mesh.enclosed_volume()) == pytest.approx(5.0)


def test_meshes_of_parts_have_named_edges_and_faces():
    for part, edges in (("whole", []), ("half", ["x0"]), ("quarter", ["x0", "y0"])):
        mesh = fx.mesh.tube(radius=2.0, length=9.0, elements=(6, 8), part=part, z=1.0)
        assert list(mesh.boundaries) == ["neck", "end", *edges, "inner", "outer"] and not mesh.flat
        assert np.ptp(mesh.nodes_of("neck")[:, 2]) == 0 and mesh.nodes_of("end")[0, 2] == -8.0
        for edge in edges:
            assert np.abs(mesh.nodes_of(edge)[:, "xy".index(edge[0])]).max() < 1e-12
        points, normals = mesh.outward("outer")
        assert np.einsum("ni,ni->n", points[:, :2], normals[:, :2]).min() > 1.9
        n = 8 * {"whole": 1, "half": 2, "quarter": 4}[part]
        assert mesh.enclosed_volume() * n / 8 == pytest.approx(9 * np.pi * 4)
    closed = fx.mesh.tube(**CAPPED)
    assert list(closed.boundaries) == ["neck", "x0", "y0", "inner", "outer"]
    points, normals = closed.outward("inner")
    assert normals[np.argmin(points[:, 2]), 2] > 0.8
    assert fx.mesh.sheet([(0, 0), (1, 0), (1, 1)], size=0.5).flat


def test_ring_in_plane_strain_has_the_pressure_of_its_circle():
    """p R / (mu H) = (1 - l^-4) (sin a / a) sqrt(2 a / sin 2 a) at the stretch l of a ring of chords, p = dW / dV."""
    for columns in (2, 4):
        mesh = fx.mesh.tube(radius=1.0, length=0.5, elements=(4, columns), part="quarter")
        ring = fx.Scene(mesh=mesh, thickness=0.01, materials=fx.NeoHookean(c10=0.5), loads=[fx.Pressure("inner")],
                        supports=[fx.Symmetry("neck", "z", guide=True), fx.Symmetry("end", "z", guide=True),
                                  *SYMMETRIES["quarter"]])
        stretch, a = 1.5, np.pi / 4 / columns
        path = fx.trace(ring, until=fx.enclosed_volume(0.5 * np.pi * (stretch**2 - 1)), progress=False)
        share = np.sin(a) / a * np.sqrt(2 * a / np.sin(2 * a))
        assert 0.85 < (path["pressure"][-1] / (0.01 * (1 - stretch**-4)) - 1) / (share - 1) < 1
        assert share == pytest.approx(1 + a**2 / 6, abs=a**4)


def test_points_of_the_curved_surface_are_on_its_triangles():
    mesh = fx.mesh.tube(radius=16.0, length=40.0, elements=(8, 4), part="quarter")
    path = fx.trace(scene(mesh), until=fx.displacement(
        1.0, at=(16 * np.cos(0.5), 16 * np.sin(0.5), -21.0), component="x"), progress=False)
    assert path.columns[-1] or path.last.measures
    found = mesh.nearest(np.array([[16.0, 0.0, -20.0], [30.0, 0.0, -20.0]]))
    assert np.hypot(*found[0, :2]) == pytest.approx(16.0, abs=0.25) and found[1].tolist() == [30.0, 0.0, -20.0]
    with pytest.raises(fx.InputError, match=r"\(30, 0, -20\) is not in the mesh"):
        fx.trace(scene(mesh), until=fx.displacement(1.0, at=(30.0, 0.0, -20.0), component="x"), progress=False)


def test_rows_and_columns_may_be_lists_of_places():
    mesh = fx.mesh.tube(radius=2.0, length=9.0, elements=([0, 0.5, 0.6, 1], [0, 40, 45, 90]), part="quarter")
    neck = mesh.nodes_of("neck")
    assert np.sort(np.degrees(np.arctan2(neck[:, 1], neck[:, 0]))) == pytest.approx([0, 40, 45, 90])
    assert np.sort(mesh.nodes_of("x0")[:, 2]) == pytest.approx([-9, -5.4, -4.5, 0])
    assert mesh.enclosed_volume() == pytest.approx(9 * np.pi)
    closed = fx.mesh.tube(radius=2.0, length=9.0, elements=(np.linspace(0, 1, 13), 4), part="quarter", end="closed")
    like = fx.mesh.tube(radius=2.0, length=9.0, elements=(12, 4), part="quarter", end="closed")
    assert np.array_equal(closed.whole()[0], like.whole()[0])


def test_arc_length_of_a_meridian_gives_a_thickness():
    mesh = fx.mesh.revolved([(10, 0), (10, -20), (4, -28), (0, -28)], elements=(17, 6), part="quarter")
    assert mesh.arc_length([10.0, 10.0, 4.0], [0, 0, 0], [-7, -20, -28]) == pytest.approx([7, 20, 30], abs=0.05)
    path = fx.trace(scene(mesh, thickness=lambda x, y, z: 1 + 0.1 * mesh.arc_length(x, y, z)), progress=False,
                    until=fx.enclosed_volume(1.0))
    wall = path.wall()
    assert wall.thickness_at(10.0, 0.0, 0.0) < wall.thickness_at(0.0, 0.0, -28.0)
    assert wall.reference_thickness.max() == pytest.approx(1 + 0.1 * (34 - 4 / 3), rel=0.002)
    with pytest.raises(fx.InputError, match="not flat in the reference configuration"):
        wall.thickness_at(10.0, 0.0)
    with pytest.raises(fx.InputError, match="has no meridian"):
        fx.mesh.sheet([(0, 0), (1, 0), (1, 1)], size=0.5).arc_length([0.0], [0.0], [0.0])


def test_surfaces_from_files_and_arrays_equal_the_mesh(tmp_path):
    mesh = fx.mesh.tube(**CAPPED)
    points, triangles = mesh.whole()
    fx.mesh.write(mesh, tmp_path / "tube.msh")
    write_stl(points, triangles, tmp_path / "tube.stl")
    for found in (fx.mesh.read(tmp_path / "tube.msh"), fx.mesh.read(tmp_path / "tube.stl"),
                  fx.mesh.surface(points, triangles)):
        assert sorted(found.boundaries) == sorted(mesh.boundaries)
        for name in mesh.boundaries:
            assert found.nodes_of(name) == pytest.approx(mesh.nodes_of(name), abs=1e-5)
        assert found.enclosed_volume() == pytest.approx(mesh.enclosed_volume(), rel=1e-6)
    large = fx.mesh.read(tmp_path / "tube.stl", scale=25.4)
    assert large.enclosed_volume() == pytest.approx(25.4**3 * mesh.enclosed_volume(), rel=1e-6)
    fx.mesh.write(fx.mesh.disc(radius=2.0, thickness=0.5, elements=(3, 1)), tmp_path / "disc.msh")
    text = (tmp_path / "disc.msh").read_text().replace("\n3 0.0 0.0 0\n", "\n3 0.0 0.0 0.5\n")
    (tmp_path / "disc.msh").write_text(text)
    with pytest.raises(fx.InputError, match="not a plane section: z goes from 0 to 0.5.* triangles of three nodes"):
        fx.mesh.read(tmp_path / "disc.msh")
    low = fx.mesh.tube(radius=1.0, length=4.0, elements=(4, 8))
    assert list(fx.mesh.surface(*low.whole()).boundaries) == ["neck", "end", "inner", "outer"]


P = [(1, 0, 0), (0, 1, 0), (-1, 0, 0), (0, -1, 0), (0, 0, -1)]
CONE = [(4, 1, 0), (4, 2, 1), (4, 3, 2), (4, 0, 3)]


@pytest.mark.parametrize("make, words", [
    (lambda: fx.mesh.tube(radius=-1.0, length=4.0, elements=(4, 8)), "tube: radius = -1.0"),
    (lambda: fx.mesh.tube(radius=1.0, length=0.5, elements=(4, 8), end="closed"), "at least the radius"),
    (lambda: fx.mesh.tube(radius=1.0, length=4.0, elements=(4, 2)), "at least 3 for the whole"),
    (lambda: fx.mesh.tube(radius=1.0, length=4.0, elements=(4, [0, 50, 40, 90]), part="quarter"), "increases from 0"),
    (lambda: fx.mesh.tube(radius=1.0, length=4.0, elements=(4, [0, 100, 200])), "increases from 0 to 360"),
    (lambda: fx.mesh.tube(radius=1.0, length=4.0, elements=(4, [0, 150, 250, 360])), "150 degrees wide"),
    (lambda: fx.mesh.tube(radius=1.0, length=4.0, elements=(4,), end="closed"), "along the meridian, and round"),
    (lambda: fx.mesh.revolved([(1, 0), (0, -1), (1, -2)], elements=(None, 8)), "only the last point may lie on"),
    (lambda: fx.mesh.surface(P, [*CONE[:3], (4, 3, 0)]), "look to different sides of the surface at"),
    (lambda: fx.mesh.surface(P, [*CONE[:3], (4, 0, 9)]), "three numbers of points each, from 0 to 4"),
    (lambda: fx.mesh.surface([*P, (0, 0, -1)], [*CONE[:3], (5, 0, 3)]), "two nodes lie at"),
    (lambda: fx.mesh.surface([*P, (5, 5, 5), (6, 5, 5), (5, 6, 5)], [*CONE, (5, 6, 7)]), "the body is in pieces"),
    (lambda: fx.mesh.surface(P, CONE, {"inner": [(0, 1)]}), "not that of a face"),
    (lambda: fx.mesh.surface(P, CONE, {"rim": [(0, 2)]}), "rim"),
    (lambda: scene(loads=[fx.Pressure("neck")]), "takes a pressure on its 'inner' or its 'outer'"),
    (lambda: scene(thickness=lambda x, y, z: 1 + z / 50), r"at \(.*, .*, -100\): must be greater than 0"),
])
def test_errors_name_what_is_wrong(make, words):
    with pytest.raises(fx.InputError, match=words):
        if make() is not None and words == "rim":
            raise fx.InputError("rim is no edge of an element and has no facet")


def test_wall_part_and_printed_lines_of_a_tube(tmp_path):
    path = fx.trace(scene(), until=fx.enclosed_volume(4e4), progress=False)
    wall, part = path.wall(), path.part(density=0.95)
    assert part.volume == pytest.approx(4 * (wall.reference_area * 0.5).sum())
    assert len(part.min_wall_reference) == 3 and "(X, Y, Z)" in str(part)
    wall.to_csv(tmp_path / "wall.csv")
    assert (tmp_path / "wall.csv").read_text().startswith("X,Y,Z,x,y,z,area,wall")
    lines = wall.printed(8.0)
    assert len(lines) == 3 + 13 and all(len(line) > 3 for line in lines)


@pytest.mark.thorough
def test_views_from_named_sides_and_the_unrolled_wall(tmp_path):
    from PIL import Image
    path, sizes = fx.trace(scene(), until=fx.enclosed_volume(4e4), progress=False), {}
    for camera in ("side", "top", (1.0, 1.0, 1.0)):
        path.view3d(tmp_path / "view.png", camera=camera)
        with Image.open(tmp_path / "view.png") as picture:
            ink = (np.asarray(picture.convert("RGB"))[:, :750] < 250).any(2)           # without the colour bar
        rows, columns = np.flatnonzero(ink.any(1)), np.flatnonzero(ink.any(0))
        sizes[camera] = np.ptp(rows) / np.ptp(columns)
    size = np.ptp(path.wall().deformed_points, axis=0) * [2, 2, 1]
    assert sizes["side"] == pytest.approx(size[2] / size[1], rel=0.05)
    assert sizes["top"] == pytest.approx(1, abs=0.05)
    with pytest.raises(fx.InputError, match="camera 'left' is not known"):
        path.view3d(tmp_path / "view.png", camera="left")
    axes = path.wall().plot_unrolled(angles=10, levels=12)
    (drawn,) = axes.collections
    assert drawn.get_array().size == 120 and axes.get_xlabel() == "angle, degrees"


def test_measured_wall_of_a_bottle(tmp_path):
    """Points on the whole bottle, at places of the modelled quarter and of its images, with the wall of the run."""
    path = fx.trace(scene(), until=fx.enclosed_volume(4e4), progress=False)
    wall = path.wall()
    rows = np.linspace(0, len(wall.reference_points) - 1, 9).astype(int)
    at, points = wall.at(wall.deformed_points[rows]), wall.deformed_points[rows] * [-1, 1, 1]
    assert at["wall"] == pytest.approx(wall.at_nodes[rows]) and at["distance"].max() < 1e-9
    assert np.column_stack([at[k] for k in "XYZ"]) == pytest.approx(wall.reference_points[rows], abs=1e-9)
    middle = wall.at(wall.middle[:5])
    assert middle["wall"] == pytest.approx(wall.at_nodes[wall.triangles[:5]].mean(1))
    part = fx.MeasuredWall(wall=1.1 * wall.at_nodes[rows], points=points)
    assert part.of_path(path) == pytest.approx(wall.at_nodes[rows])
    found = part.compare(path)
    assert found.deviation_percent == pytest.approx(-100 / 11) and found.plot()[0].get_xlabel().endswith("first point")
    assert found.length[-1] == pytest.approx(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
    lines = ["x,y,z,wall", *(",".join(map(repr, map(float, row))) for row in np.column_stack([points, part.wall]))]
    (tmp_path / "wall.csv").write_text("\n".join(lines))
    assert fx.MeasuredWall.from_csv(tmp_path / "wall.csv").compare(path).rms_percent == pytest.approx(100 / 11)
    with pytest.raises(fx.InputError, match="the part is in three dimensions: give points"):
        fx.MeasuredWall(wall=[1.0], length=[3.0]).compare(path)


ROUND_MOULD = fx.tools.revolved(fx.tools.bottle(radius=20.0, height=70.0, neck=18.0, shoulder=10.0, neck_height=15.0,
                                                base=-105.0, fillet=4.0, shoulder_fillet=4.0))


def moulded(wall):
    """A tube whose thickness is a function of the part of its meridian, blown into a round mould to a volume."""
    mesh = fx.mesh.tube(**CAPPED | {"elements": (8, 3)})
    length = float(mesh.arc_length([0.0], [0.0], [-100.0])[0])
    return scene(mesh, thickness=lambda x, y, z: wall(mesh.arc_length(x, y, z) / length),
                 contacts=[fx.Contact("outer", ROUND_MOULD, "stick")]), fx.enclosed_volume(3e4)


def test_a_design_of_a_tube_takes_differences_of_whole_runs():
    """The walls at twice the thickness are twice the walls: the knots together have the derivative wall / thickness."""
    design = fx.Design(moulded, {"wall": fx.spline(2, start=0.5, low=0.3, high=0.8)})
    run = design.run()
    wall, slopes = run.derivative("wall")
    assert design.whole_runs.count == 2 and run.missing_runs == 0
    assert np.linalg.norm(slopes.sum(1) - wall / 0.5) < 0.02 * np.linalg.norm(wall / 0.5)
    first = run.reference_length < 40
    assert np.abs(slopes[first, 0]).mean() > 2 * np.abs(slopes[first, 1]).mean()
    volume, by = run.derivative("volume")
    assert by.sum() == pytest.approx(volume[0] / 0.5, rel=1e-9) and design.whole_runs.count == 2
    assert run.sensitivities().coordinates == pytest.approx(np.sort(run.reference_length))
    with pytest.raises(fx.InputError, match=r"no exact derivatives; Design\(derivatives='runs'\) takes differences"):
        fx.Design(moulded, {"wall": fx.spline(2, start=0.5)}, derivatives="exact").run().derivative("volume")


@pytest.mark.thorough
def test_a_design_of_a_tube_meets_a_minimum_wall(tmp_path):
    design = fx.Design(moulded, {"wall": fx.spline(3, start=0.5, low=0.2, high=0.8)}, workers=2)
    found = design.minimum_weight(min_wall=0.25)
    assert found.best.wall.min() == pytest.approx(0.25, rel=0.02) and not found.missed and found.paths <= 60
    assert found.best.volume < found.before.volume and found.difference_runs == design.whole_runs.count
    assert f"{found.difference_runs} for differences of whole runs, 2 at a time" in str(found)
    assert "minimum wall" in found.report(tmp_path / "design.html").read_text()


def test_temperature_and_constants_may_depend_on_the_height():
    hot = scene(material=fx.NeoHookean(c10=lambda x, y, z: 0.5 - z / 100), temperature=lambda x, y, z: 150 + z)
    assert hot.temperature.T.x.array.min() == pytest.approx(50.0)
    assert hot.shear_modulus("sheet") == pytest.approx(3.0, rel=0.05)


def test_a_mirror_plane_normal_to_z_doubles_the_tube_unless_it_guides():
    mesh = fx.mesh.tube(radius=16.0, length=50.0, elements=(4, 3), part="quarter")
    for guide, factor in ((False, 8), (True, 4)):
        found = fx.Scene(mesh=mesh, thickness=1.0, materials=fx.NeoHookean(c10=0.5), loads=[fx.Pressure("inner")],
                         supports=[fx.Clamped("neck"), fx.Symmetry("end", "z", guide=guide), *SYMMETRIES["quarter"]])
        assert found.symmetry_factor == factor


@pytest.mark.thorough
def test_ranks():
    script = """
import json, sys
sys.path.insert(0, "tests")
import formingx as fx
from test_tubes import scene
path = fx.trace(scene(), until=fx.enclosed_volume(4e4), progress=False)
wall, mesh = path.wall(), path.problem.scene.mesh
at = path.state_at(fx.displacement(1.0, at=(16.0, 0.0, float(mesh.meridian[4, 1])), component="x"))
found = [[mesh.enclosed_volume(), at.measures["pressure"]], mesh.whole()[0].sum(0).tolist(), wall.ratio.tolist(),
         path["pressure"].tolist(), wall.section((0, 0, -50), (0, 0, 1))["wall"].tolist()]
if path.problem.comm.rank == 0:
    print(json.dumps(found))
"""
    for one, two in zip(*(run_json(script, ranks) for ranks in (1, 3))):
        np.testing.assert_allclose(two, one, rtol=1e-9, atol=1e-10)
