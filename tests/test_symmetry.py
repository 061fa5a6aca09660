"""Results of a scene with planes of symmetry are those of the whole part: a quarter, a half and the whole agree."""

import json

import numpy as np
import pytest
from mpi4py import MPI

import formingx as fx
from formingx.extensions.space.wall import SheetWall, thinnest_triangle
from formingx.io.stl import volume
from formingx.results.files import checkpoint_data
from formingx.results.show import report_data

C10, UNITS = 0.4, fx.Units(length="mm", stress="MPa")
HELD = {"whole": [], "half": [fx.Symmetry("x0", "x")], "quarter": [fx.Symmetry("x0", "x"), fx.Symmetry("y0", "y")]}
PART = "weight", "volume", "area", "draw_ratio", "min_wall", "uniformity"
COLUMNS = ("enclosed_volume", "strain_energy", "mould_force", "contact_area", "reference_contact_area")


def inflated(part):
    """A sheet of 160 x 100 mm blown into a box: each part of the same triangles."""
    images = {"quarter": [], "half": ["y0"], "whole": ["y0", "x0"]}[part]
    sheet = fx.mesh.sheet(fx.mesh.rectangle(160.0, 100.0, part="quarter"), size=20, reflected=images)
    box = fx.tools.box(half=(78.0, 48.0), depth=20.0, corner=12.0, fillet=5.0)
    scene = fx.Scene(mesh=sheet, thickness=1.0, materials=fx.NeoHookean(c10=C10), model=fx.Membrane(wrinkles=0.01),
                     supports=[fx.SimplySupported("rim"), *HELD[part]], loads=[fx.Pressure("top")],
                     contacts=[fx.Contact("bottom", box, "none", name="mould")])
    return fx.trace(scene, until=fx.pressure(0.03), progress=False)


@pytest.fixture(scope="module")
def parts():
    return {part: inflated(part) for part in HELD}


@pytest.mark.thorough
@pytest.mark.parametrize("part, factor", [("half", 2), ("quarter", 4)])
def test_part_of_a_sheet_in_space_gives_results_of_the_whole(parts, part, factor):
    path, whole = parts[part], parts["whole"]
    assert path.scene.symmetry_factor == factor and whole.scene.symmetry_factor == 1
    mine, its = (p.part(density=1.05, units=UNITS) for p in (path, whole))
    assert mine.weight == pytest.approx(160 * 100 * 1.05e-3, rel=1e-9)
    assert [getattr(mine, name) for name in PART] == pytest.approx([getattr(its, name) for name in PART], rel=1e-5)
    assert [path.last.measures[c] for c in COLUMNS] == pytest.approx([whole.last.measures[c] for c in COLUMNS],
                                                                     rel=1e-5)
    assert path.last.measures["penetration"] < 1e-5 and whole.last.measures["penetration"] < 1e-5       # of the wall
    assert mine.min_wall_at == pytest.approx(its.min_wall_at, rel=1e-4)
    assert path.tool_forces()["mould"][-1] == path.last.measures["mould_force"]
    assert f"(a {part} was modelled)" in str(mine) and "given for" not in str(its)


@pytest.mark.parametrize("seed", range(4))
def test_thinnest_triangle_of_mirror_images_does_not_depend_on_round_off(seed):
    """Of four images the one at positive x and y; a share of 0 leaves a triangle out."""
    rest = np.array([[0.0, 0, 0], [2, 0, 0], [0, 1, 0], [-2, 0, 0], [0, -1, 0]])
    fans = np.array([[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 1]])
    deformed = rest * 1.5 + 1e-13 * np.random.default_rng(seed).normal(size=rest.shape)
    wall = SheetWall(rest, deformed, fans, {"sheet": np.ones(4)}, MPI.COMM_SELF)
    assert thinnest_triangle(wall) == 0 and thinnest_triangle(wall, np.array([0, 1, 1, 1])) == 3
    thinner = SheetWall(rest, deformed, fans, {"sheet": np.array([1, 1, 0.999, 1])}, MPI.COMM_SELF)
    assert thinnest_triangle(thinner) == 2


def test_contact_area_is_that_of_the_deformed_sheet(parts):
    """All of a sheet that touches: its area is that of the part, and its area at rest that of the flat sheet."""
    path = parts["quarter"]
    wall, contact = path.wall(), path.problem.contacts[0]
    with path.problem.state_context(path.last) as problem:
        rows = np.column_stack([contact.points, contact.rule.area,
                                contact.rule.area_ratio(problem.x.array_r)])
    assert 4 * rows[:, 3].sum() == pytest.approx(160 * 100, rel=1e-12)
    assert 4 * (rows[:, 3] * rows[:, 4]).sum() == pytest.approx(path.part().area, rel=1e-12)
    measures = path.last.measures
    assert 1.05 * measures["reference_contact_area"] < measures["contact_area"] < 4 * wall.area.sum()


def test_targets_are_those_of_the_whole_part(parts):
    value = 0.9 * parts["whole"].last.measures["enclosed_volume"]
    found = [fx.trace(path.scene, until=fx.enclosed_volume(value), progress=False).last.measures
             for path in parts.values()]
    for name in ("enclosed_volume", "pressure", "mould_force"):
        assert [one[name] for one in found] == pytest.approx([found[0][name]] * 3, rel=1e-5)


def test_a_volume_beyond_the_room_of_a_mould_is_that_of_the_whole_part():
    """A box 1.8 wide over a sheet 2 wide and 0.1 thick, of which a half is modelled; and a round one."""
    rooms = []
    for kinematics in (fx.PlaneStrain(), fx.Axisymmetric()):
        scene = fx.Scene(mesh=fx.mesh.disc(radius=1.0, thickness=0.1, elements=(4, 1)), kinematics=kinematics,
                         materials=fx.NeoHookean(c10=C10), supports=[fx.Symmetry("axis"), fx.Clamped("rim")],
                         loads=[fx.Pressure("bottom")],
                         contacts=[fx.Contact("top", fx.tools.cup(radius=0.9, depth=0.5, fillet=0.1).moved(z=0.1))])
        with pytest.raises(fx.InputError, match="has room for") as error:
            fx.trace(scene, until=fx.enclosed_volume(100.0), progress=False)
        rooms.append(float(str(error.value).rsplit("room for ", 1)[1].split()[0].rstrip(".")))
    assert rooms == pytest.approx([2 * (0.9 * 0.5 + 0.1), np.pi * (0.9**2 * 0.5 + 0.1)], rel=0.02)     # from below


def block(part, driven=None, contacts=(), **scene):
    """A long bar of 10 x 4 mm, pressed between frictionless plates, in plane strain."""
    half, quarter = part != "whole", part == "quarter"
    mesh = fx.mesh.disc(radius=5.0 if half else 10.0, thickness=2.0 if quarter else 4.0, elements=(2, 2))
    if not half:
        mesh.domain.geometry.x[:, 0] -= 5.0
    supports = [fx.Symmetry("axis")] if half else [fx.PinnedNode(0.0, 0.0)]
    floor = fx.Symmetry("bottom", "z", guide=not quarter)
    return fx.Scene(mesh=mesh, materials=fx.NeoHookean(c10=C10), kinematics=fx.PlaneStrain(), contacts=contacts,
                    supports=[*supports, floor, *([fx.PrescribedDisplacement("top", "z")] if driven is None else [])],
                    **scene)


LENGTH = 0.8
FORCE, ENERGY = 10 * 2 * C10 * (LENGTH**-3 - LENGTH), 40 * C10 * (LENGTH**2 + LENGTH**-2 - 2)     # N/mm, N


@pytest.mark.parametrize("part, factor", [("whole", 1), ("half", 2), ("quarter", 4)])
def test_bar_in_plane_strain_has_the_exact_force_per_depth(part, factor):
    """P = 2 c10 (l - l^-3) over the whole width; both plates do the work, where the lower half is an image."""
    height = 2.0 if part == "quarter" else 4.0
    path = fx.trace(scene := block(part), until=fx.travel((LENGTH - 1) * height), progress=False)
    assert scene.symmetry_factor == factor
    last = path.last.measures
    assert last["support_force"] == pytest.approx(FORCE, rel=1e-8)
    assert last["strain_energy"] == pytest.approx(ENERGY, rel=1e-8)
    work = path.work()
    assert work["support"][-1] == pytest.approx(ENERGY, rel=1e-4) and abs(work["unbalanced"][-1]) < 1e-3 * ENERGY
    found = path.part(density=1.0, units=UNITS)
    assert (found.volume, found.weight) == pytest.approx((40.0, 0.04), rel=1e-8)
    assert "per mm of depth" in str(found) and "40 mm3/mm" in str(found) and "0.04 g/mm" in str(found)


def test_force_on_a_plate_is_a_target_of_the_whole():
    """A plate that the plane cuts is whole on both sides; one of two that are images of each other is not doubled."""
    found = []
    for part in ("half", "quarter"):
        top = 2.0 if part == "quarter" else 4.0
        plate = fx.Contact("top", fx.tools.plane(top), "none", direction=(0, -1), name="plate")
        path = fx.trace(block(part, driven=plate, contacts=[plate]), until=fx.force(FORCE, of="plate"), progress=False)
        assert path.last.measures["tool_force"] == pytest.approx(FORCE, rel=1e-9)
        assert path.last.measures["contact_length"] == pytest.approx(10.0, rel=1e-9)
        found.append(path.last.measures["travel"] / top)
    assert found == pytest.approx([1 - LENGTH] * 2, rel=1e-3)              # the penalty gives way


def test_supports_other_than_symmetry_planes_have_no_images():
    disc = fx.mesh.disc(radius=10.0, thickness=1.0, elements=(4, 1))
    held = [fx.Symmetry("axis"), fx.PrescribedDisplacement("top", "z")]

    def factor(supports, mesh=disc, **scene):
        return fx.Scene(mesh=mesh, materials=fx.NeoHookean(c10=C10), supports=supports, **scene).symmetry_factor
    assert factor([held[0], fx.Symmetry("rim", "z"), held[1]]) == 1                  # a ring, not a plane
    assert factor([*held, fx.Symmetry("bottom", "z", guide=True)]) == 1
    assert factor([held[0], fx.Symmetry("bottom", "z"), fx.Symmetry("top", "z")]) == 1      # a slice of a long rod
    assert factor([*held, fx.Symmetry("bottom", "z")]) == 2
    assert factor([*held, fx.Symmetry("bottom", "z")], kinematics=fx.PlaneStrain()) == 4
    assert factor([held[0], fx.Symmetry("rim", "r"), held[1]], kinematics=fx.PlaneStrain()) == 1
    flat = fx.mesh.sheet([(0, 0), (4, 0), (4, 3), (0, 3)], size=2, names=["a", "b", "c", "d"])
    rims = [fx.Symmetry(name, "z") for name in "abcd"]
    space = {"mesh": flat, "thickness": 0.1}
    assert factor([*rims, fx.Symmetry("d", "x"), fx.Symmetry("a", "y")], **space) == 4
    assert factor([*rims, fx.Symmetry("d", "x"), fx.Symmetry("a", "y"), fx.Symmetry("c", "y")], **space) == 2
    with pytest.raises(fx.InputError, match="guide = True: must be one of them"):
        fx.Symmetry("bottom", "z", mirror=True, guide=True)


def test_tool_beside_a_plane_is_one_of_two():
    planes = fx.Scene(mesh=fx.mesh.disc(radius=10.0, thickness=1.0, elements=(4, 1)), kinematics=fx.PlaneStrain(),
                      materials=fx.NeoHookean(c10=C10), supports=[fx.Symmetry("axis"), fx.Clamped("rim")]).symmetry
    across, up, beside = np.array([[0.0, 1], [3, 2]]), np.array([0.0, 1.0]), np.array([[2.0, 1], [3, 2]])
    assert planes.factor_of(across, up) == 2 and planes.factor_of(beside, up) == 1
    assert planes.factor_of(across, np.array([1.0, 0.0])) == 1             # of both halves together it would be 0
    assert len(planes.images(2)) == 2 and len(planes.images(2, np.array([[-1.0, 1], [3, 2]]))) == 1


def test_report_of_a_checkpoint_knows_the_planes(tmp_path):
    path = fx.trace(block("half"), until=fx.travel(-0.4), progress=False)
    path.save(tmp_path / "run")
    found = report_data.of_checkpoint(*checkpoint_data.contents(tmp_path / "run"))
    assert found.planes.planes == path.scene.symmetry.planes and found.per_depth
    text = path.report(tmp_path / "bar.html", units=UNITS, density=1.0).read_text()
    assert "given for the whole part (a half was modelled), per mm of depth" in text and "N/mm" in text
    assert fx.load(tmp_path / "run", block("half")).last.measures == path.last.measures
    path.to_csv(tmp_path / "bar.csv", units=UNITS)
    heads = (tmp_path / "bar.csv").read_text().splitlines()[0].split(",")
    assert {"support_force [N/mm]", "strain_energy [mJ/mm]", "mass_error"} < set(heads)
    other = block("half")
    other.supports[0].guide = True
    with pytest.raises(fx.InputError, match="symmetry"):
        fx.load(tmp_path / "run", other.with_mesh(other.mesh))


@pytest.mark.thorough
def test_report_in_space_draws_the_whole_part_and_its_tool(parts, tmp_path):
    """The sheet's triangles, frame by frame, with its images; the box, which is whole, once."""
    from formingx.extensions.space import show
    path = parts["quarter"]
    drawn = show._mesh(path, report_data.of_path(path), UNITS)
    assert list(drawn["fields"]) == ["wall, mm", "wall / original", "larger stress, MPa"]
    assert len(drawn["tools"][0]["images"]) == 1
    assert len(drawn["points"]) == len(drawn["fields"]["wall, mm"]) == len(path)
    assert min(drawn["fields"]["wall, mm"][-1]) == pytest.approx(path.wall().at_nodes.min(), rel=1e-4)
    text = path.report(tmp_path / "tray.html", units=UNITS, density=1.05).read_text()
    assert all(word in text for word in ("id=slider", "a quarter was modelled", "id=data", "contact area, mm2"))


@pytest.mark.parametrize("part", HELD)
def test_solid_is_that_of_the_whole_part_and_closed(parts, part, tmp_path):
    """Every edge belongs to two triangles, run both ways; inside is the volume of the part."""
    parts[part].to_stl(tmp_path / "tray.stl")
    found = fx.tools.solid(tmp_path / "tray.stl")
    points, triangles, ratio = parts[part]._reader.solid(parts[part].last)
    whole = volume(*parts["whole"]._reader.solid(parts["whole"].last)[:2])
    assert found.volume == pytest.approx(whole, rel=1e-4) and whole == pytest.approx(160 * 100, rel=0.05)
    assert np.ptp(found.bounds, axis=0)[:2] == pytest.approx([160, 100], abs=2.0)
    edges = {tuple(edge) for k in range(3) for edge in triangles[:, [k, (k + 1) % 3]].tolist()}
    assert len(edges) == 3 * len(triangles) and all((b, a) in edges for a, b in edges) and len(ratio) == len(points)


def test_gltf_is_in_metres(parts, tmp_path):
    parts["quarter"].to_gltf(tmp_path / "tray.glb", units=UNITS)
    data = (tmp_path / "tray.glb").read_bytes()
    found = json.loads(data[20:20 + int.from_bytes(data[12:16], "little")])
    size = np.ptp([found["accessors"][0][end] for end in ("min", "max")], axis=0)
    assert size[0] == pytest.approx(0.16, abs=0.002) and size[2] == pytest.approx(0.1, abs=0.002)


def test_nodes_of_a_sheet_in_space_are_written_and_compared(parts, tmp_path):
    path, file = parts["quarter"], tmp_path / "nodes.csv"
    fx.write_nodes(path, file)
    rows = file.read_text().splitlines()
    assert rows[0] == "node,X,Y,u_x,u_y,u_z" and {len(row.split(",")) for row in rows} == {6}
    found = fx.compare_nodes(path, file)
    assert found.maximum < 1e-12 and found.ours.shape == (len(rows) - 1, 3)
    lowest = found.ours[np.argmin(found.ours[:, 2])]
    assert lowest[2] == pytest.approx(path.wall().deformed_points[:, 2].min(), rel=1e-9) and "(X, Y) = (" in str(found)
    assert found.plot() is not None


@pytest.mark.slow
def test_plug_forces_on_a_tray_agree_as_the_mesh_converges():
    """Each part has triangles of its own: the forces on the whole plug differ by 12 % at 16 mm, by 0.7 % at 4 mm."""
    tray = fx.tools.box(half=(80, 50), depth=30, corner=20, fillet=8, draft=5)
    plug = fx.tools.box(half=(55, 28), depth=20, corner=12, fillet=6, draft=5, mouth=20.5, plug=True)
    spreads = []
    for size in (16, 4):
        found = []
        for part, held in HELD.items():
            sheet = fx.mesh.sheet(fx.mesh.rectangle(160, 100, corner=20, part=part), size=size)
            scene = fx.Scene(mesh=sheet, thickness=1.0, materials=fx.NeoHookean(c10=0.05),
                             supports=[fx.SimplySupported("rim"), *held], model=fx.Membrane(wrinkles=0.01),
                             contacts=[fx.Contact("bottom", tray, name="mould"),
                                       fx.Contact("top", plug, direction=(0, 0, -1), name="plug")])
            path = fx.trace(scene, until=fx.travel(18.0), progress=False)
            found.append([path.last.measures[name] for name in ("plug_force", "strain_energy")])
        spreads.append(np.ptp(found, axis=0) / np.mean(found, axis=0))
    coarse, fine = spreads
    assert coarse[0] > 0.08 and np.all(fine < 0.015)
