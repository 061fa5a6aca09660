"""The promises of `accuracy` for sheets that tools touch, and the elements that they get."""

import json
import sys

import numpy as np
import pytest
from conftest import ROOT

import formingx as fx
from formingx.mesh.fillets import fillets_in_sheet, flats_in_sheet
from formingx.results.evaluate import creases

sys.path.insert(0, str(ROOT / "benchmarks"))
import accuracy_in_moulds as moulds  # noqa: E402

# walls on the finest meshes: benchmarks/accuracy_in_moulds.py --references writes them
REFERENCES = json.loads((ROOT / "docs" / "data" / "walls_in_moulds.json").read_text())
MOULD = fx.tools.cup(radius=10.0, depth=5.0, mouth=0.3, fillet=1.0)


def error(name, path):
    return moulds.error(path, (REFERENCES[name]["length"], REFERENCES[name]["wall"]))


@pytest.fixture(scope="module")
def standard_cup():
    return moulds.cup(moulds.body("cup", accuracy="standard"))


def test_draft_keeps_its_promise_in_the_cup():
    path = moulds.cup(moulds.body("cup", accuracy="draft"))
    assert error("cup", path) < moulds.PROMISED["draft"]
    assert path.problem.n_unknowns < 700


def test_standard_keeps_its_promise_in_the_cup(standard_cup):
    """A uniform mesh needs 60 x 2 elements for it."""
    assert error("cup", standard_cup) < moulds.PROMISED["standard"]
    assert standard_cup.problem.n_unknowns < 1800


@pytest.mark.thorough
@pytest.mark.parametrize("name", ["ribbed", "tray"])
def test_draft_keeps_its_promise_over_sharp_edges_and_in_thick_sheets(name):
    """With one element through the sheet the wall over the rib is 7 % wrong."""
    path = moulds.MOULDS[name](moulds.body(name, accuracy="draft"))
    assert error(name, path) < moulds.PROMISED["draft"]
    assert moulds.elements(path)[1] == {"ribbed": 2, "tray": 1}[name]


@pytest.mark.slow
@pytest.mark.parametrize("name", moulds.MOULDS)
@pytest.mark.parametrize("accuracy", moulds.PROMISED)
def test_every_accuracy_keeps_its_promise(name, accuracy):
    assert error(name, moulds.MOULDS[name](moulds.body(name, accuracy=accuracy))) < moulds.PROMISED[accuracy]


def test_a_uniform_mesh_is_safe_if_all_finer_ones_keep_the_promise():
    """40 x 1 keeps 3 % by chance, because 60 x 1 does not; 20 x 2 is coarser and is no finer mesh than 40 x 1."""
    def row(along, through, error):
        return {"along": along, "through": through, "error": error, "million": along * through, "seconds": 1.0}
    rows = {"draft": row(30, 1, 0.01), "uniform": [row(40, 1, 0.02), row(60, 1, 0.04), row(20, 2, 0.05),
                                                   row(40, 2, 0.02), row(60, 2, 0.01)]}
    draft = moulds.with_cheapest(rows)["draft"]
    assert draft["million_ratio"] == 30 / 40 and draft["cheapest"].startswith("40 x 1")
    assert draft["safe"] == "40 x 2" and draft["safe_ratio"] == 30 / 80


def test_material_of_the_fillet_and_its_wall_are_estimated(standard_cup):
    """To 5 % of the sheet's length, and to a tenth of the wall."""
    disc = np.column_stack([np.linspace(0, 10, 500), np.full(500, 0.3)])
    fillet, = fillets_in_sheet(MOULD, disc, axisymmetric=True, moving=False)
    assert (fillet.radius, fillet.turn) == pytest.approx((1.0, 1.0), rel=1e-2)
    profile = standard_cup.profile()
    on_fillet = (profile.top > (8.999, 4.299)).all(1)
    R = profile.reference_radius[on_fillet]
    assert (fillet.first, fillet.last) == pytest.approx((R.min(), R.max()), abs=0.5)
    assert 0.3 * fillet.area_ratio == pytest.approx(profile.wall_thickness[on_fillet].mean(), rel=0.1)


def test_rounded_edges_are_met_before_the_film_bridges_them_and_plugs_anywhere_below():
    disc = np.column_stack([np.linspace(0, 12, 500), np.full(500, 0.3)])
    edged = fx.tools.cup(radius=10.0, depth=5.0, mouth=0.3, fillet=1.0, lip=0.8)
    found = {round(fillet.radius, 2): fillet for fillet in fillets_in_sheet(edged, disc, True, moving=False)}
    assert found[1.0].concave and not found[0.8].concave
    plug = fx.tools.male(radius=4.0, height=60.0, base=-60.0, fillet=0.5)
    nose, = (fillet for fillet in fillets_in_sheet(plug, disc, True, moving=True) if fillet.last < 6)
    assert (nose.first, nose.last) == pytest.approx((2.4, 4.0), rel=0.01)


def test_free_surface_that_touches_a_flat_floor_also_touches_the_edge_of_the_mouth():
    """A circle through that edge, tangent to the floor."""
    disc = np.column_stack([np.linspace(0, 10, 500), np.zeros(500)])
    depth = 2.0
    flats = flats_in_sheet(fx.tools.cup(radius=10.0, depth=depth), disc, axisymmetric=True)
    assert flats.positions[0] < 0.2
    assert flats.free_radii[0] == pytest.approx((10.0**2 + depth**2) / (2 * depth), rel=0.05)
    floor = flats.positions < 6.0
    assert floor.sum() > 10 and (np.diff(flats.free_radii[floor]) < 0).all() and (np.diff(flats.positions) >= 0).all()


def test_a_thin_sheet_gets_shorter_columns_on_a_flat_floor():
    """The fillet is too far away to shorten the columns that are compared."""
    def on_floor(thickness):
        mould = fx.tools.cup(radius=55.0, depth=10.0, mouth=thickness, fillet=1.0)
        ends, _ = columns(fx.mesh.disc(radius=55.0, thickness=thickness, accuracy="draft"),
                          contacts=[fx.Contact("top", mould)])
        middle = (ends[1:] + ends[:-1]) / 2
        return np.diff(ends)[(middle > 20.0) & (middle < 32.0)].mean()
    assert on_floor(0.02) < 0.8 * on_floor(0.2)


def test_elements_through_the_sheet_follow_the_sharpest_edge_inside_the_mould():
    """As many as wall over fillet radius demands; a lip beside the clamp counts for little."""
    def through(radius, accuracy):
        rib = fx.tools.Tool([(0, 20), (12, 20), (14, 16), (18, 16), (20, 20), (36, 20), (40, 1), (90, 1)],
                            [0, 3.0, radius, radius, 3.0, 3.5, 1.0, 0])
        disc = fx.mesh.disc(radius=42.0, thickness=1.0, accuracy=accuracy)
        return columns(disc, contacts=[fx.Contact("top", rib)])[1][0]
    assert [through(1.2, accuracy) for accuracy in moulds.PROMISED] == [2, 4, 7]
    assert [through(2.0, accuracy) for accuracy in moulds.PROMISED] == [2, 3, 5]


def test_a_sheet_that_is_thin_for_its_fillets_gets_one_element_through_it():
    """Its error falls with the thickness, and shorter columns cost less than a second element through it."""
    def through(thickness, accuracy):
        mould = fx.tools.cup(radius=10.0, depth=5.0, mouth=thickness, fillet=1.0)
        disc = fx.mesh.disc(radius=10.0, thickness=thickness, accuracy=accuracy)
        return columns(disc, contacts=[fx.Contact("top", mould)])[1][0]
    assert [through(thickness, "standard") for thickness in (0.3, 0.1)] == [2, 1]
    assert [through(thickness, "fine") for thickness in (0.3, 0.1, 0.02)] == [3, 2, 1]


@pytest.mark.parametrize("accuracy", moulds.PROMISED)
@pytest.mark.parametrize("fillet", [0.05, 1e-4])
@pytest.mark.parametrize("thickness", [0.9, 1e-3])
def test_elements_are_bounded_for_any_fillet(accuracy, fillet, thickness):
    mould = fx.tools.cup(radius=10.0, depth=5.0, mouth=thickness, fillet=fillet)
    ends, (through,) = columns(fx.mesh.disc(radius=10.0, thickness=thickness, accuracy=accuracy),
                               contacts=[fx.Contact("top", mould)])
    assert len(ends) < 640 and through <= 12


def test_edges_sharper_than_the_wall_and_thick_sheets_are_reported():
    """On an edge of radius 0.4 under a wall of 0.7 the error of "draft" is 4.7 %."""
    def findings(radius, thickness):
        rib = fx.tools.Tool([(0, 20), (12, 20), (14, 16), (18, 16), (20, 20), (36, 20), (40, 1), (90, 1)],
                            [0, 1.5, radius, radius, 1.5, 3.5, 2.0, 0]).moved(z=thickness)
        scene = fx.Scene(mesh=fx.mesh.disc(radius=42.0, thickness=thickness), materials=fx.NeoHookean(c10=0.4),
                         supports=[fx.Symmetry("axis"), fx.Clamped("rim")], loads=[fx.Pressure("bottom")],
                         contacts=[fx.Contact("top", rib, "stick")])
        return [(found.severity, found.text) for found in fx.check(scene, targets=[fx.pressure(0.25)]).findings
                if found.about == "mesh" and "accuracy" in found.text]
    (severity, text), *_ = findings(0.4, 1.0)
    assert severity == "warning" and "radius 0.4 " in text and "1.0%" in text
    assert not findings(1.2, 1.0)
    (severity, text), = findings(1.2, 5.0)
    assert severity == "note" and "thicker than a tenth" in text


@pytest.mark.thorough
def test_face_that_creases_between_sticking_points_is_reported(standard_cup):
    """A thick parison, whose outer face is shortened where it bends from the shoulder into the neck of a flask."""
    mould = fx.tools.bottle(radius=18.0, height=45.0, neck=8.5, shoulder=14.0, neck_height=10.0, base=-12.0,
                            fillet=4.0, shoulder_fillet=6.0)
    scene = fx.Scene(mesh=fx.mesh.parison(inner_radius=6.0, thickness=1.4, length=70.0, elements=(30, 1)),
                     materials=fx.Gent(mu=0.4, Jm=40.0), loads=[fx.Pressure("inner")],
                     supports=[fx.Symmetry("axis"), fx.Clamped("neck")], contacts=[fx.Contact("outer", mould, "stick")])
    path = fx.trace(scene, until=fx.pressure(0.4), progress=False)
    crease = creases.deepest(path)
    assert 0.5 < crease.stretch < 0.75 and crease.face == "outer"
    assert mould.nearest(np.array([crease.point])).distance[0] == pytest.approx(0, abs=0.1)
    assert [found.severity for found in path.findings() if "creases" in found.text] == ["warning"]
    assert creases.findings(creases.deepest(standard_cup)) == []


def columns(mesh, **scene):
    """Return the reference ends of the columns of a scene of a disc under the cup, and the numbers through layers."""
    layers = {name: fx.NeoHookean(c10=1.0) for name in mesh.layers}
    scene = fx.Scene(**{"mesh": mesh, "materials": layers, "supports": [fx.Symmetry("axis"), fx.Clamped("rim")],
                        "loads": [fx.Pressure("bottom")], "contacts": [fx.Contact("top", MOULD)]} | scene)
    ends = scene.mesh.columns.ends
    return ends, [len(scene.mesh.cells.find(tag)) // 2 // (len(ends) - 1) for tag in scene.mesh.layers.values()]


def test_columns_are_short_where_the_sheet_touches_a_fillet():
    """Also of a sharper fillet, and in plane strain."""
    def shortest(disc, **scene):
        ends, _ = columns(fx.mesh.disc(**{"radius": 10.0, "thickness": 0.3} | disc), **scene)
        lengths, middle = np.diff(ends), (ends[1:] + ends[:-1]) / 2
        inside = middle < 9.0                                            # those at the rim are short as well
        least = lengths[inside].min()
        return middle[inside & (lengths < 1.05 * least)].mean(), least
    place, length = shortest({})
    assert 6.0 < place < 7.5 and length < 0.2
    sharper = fx.tools.cup(radius=10.0, depth=5.0, mouth=0.3, fillet=0.5)
    assert shortest({}, contacts=[fx.Contact("top", sharper)])[1] < 0.8 * length
    assert 6.0 < shortest({}, kinematics=fx.PlaneStrain())[0] < 7.5
    assert shortest({"accuracy": "fine"})[1] < 0.6 * length < 0.5 * shortest({"accuracy": "draft"})[1]


def test_layers_share_the_elements_through_the_sheet():
    assert columns(fx.mesh.disc(radius=10.0, thickness={"core": 0.25, "skin": 0.05}))[1] == [2, 1]
    heat = fx.Cooling(fx.ThermalProperties(conductivity=0.2, density=1.0, heat_capacity=1.0), [], unit="C")
    cooled = {"heat": heat, "temperature": 100.0}
    assert columns(fx.mesh.disc(radius=10.0, thickness=0.3), **cooled)[1] == [4]            # as without a tool


def test_given_elements_and_bodies_without_tools_stay():
    def same(mesh, **scene):
        ends, through = columns(mesh, **scene)
        return np.array_equal(ends, mesh.columns.ends) and through == [len(mesh.columns.place(ends[:1])) // 2]
    sheet = {"radius": 10.0, "thickness": 0.3}
    assert not same(fx.mesh.disc(**sheet))
    assert same(fx.mesh.disc(**sheet), contacts=[])
    assert same(fx.mesh.disc(**sheet, elements=(40, 4)))
    assert same(fx.mesh.disc(**sheet, grading=0.5)) and same(fx.mesh.disc(**sheet, concentrate={7.0: 0.3}))
    block = [fx.Contact("top", fx.tools.plane(2.0))]
    assert columns(fx.mesh.disc(radius=10.0, thickness=2.0), contacts=block)[0].size == 41             # a thick body
    moved = fx.mesh.disc(**sheet)
    moved.domain.geometry.x[:, 1] *= 0.9
    assert columns(moved)[0].size == 41


def test_parts_of_boundaries_stay():
    mesh = fx.mesh.disc(radius=10.0, thickness=0.3).with_part("middle", "bottom", (0.0, 5.0))
    ends, _ = columns(mesh, loads=[fx.Pressure("middle")])
    assert np.isclose(ends, 5.0).any()


def test_a_parison_has_an_accuracy():
    mould = fx.tools.bottle(radius=3.0, height=10.0, neck=1.5, shoulder=2.0, neck_height=1.5, base=-2.9, fillet=0.8)
    parison = {"inner_radius": 1.1, "thickness": 0.3, "length": 10.6}

    def scene(**given):
        return fx.Scene(mesh=fx.mesh.parison(**parison, **given), materials=fx.NeoHookean(c10=1.0),
                        supports=[fx.Symmetry("axis"), fx.Clamped("neck")], loads=[fx.Pressure("inner")],
                        contacts=[fx.Contact("outer", mould)])
    n = {accuracy: len(scene(accuracy=accuracy).mesh.columns.ends) for accuracy in moulds.PROMISED}
    assert n["draft"] < n["standard"] < n["fine"]
    assert len(scene().mesh.columns.ends) == 61
    with pytest.raises(fx.InputError, match="parison: accuracy"):
        fx.mesh.parison(**parison, accuracy="finest")


def test_a_small_nose_of_a_plug_gets_short_columns():
    plug = fx.tools.male(radius=4.0, height=60.0, base=-60.0, fillet=0.5)
    ends, _ = columns(fx.mesh.disc(radius=10.0, thickness=0.3), contacts=[
        fx.Contact("bottom", plug, "none", direction=(0, 1))], loads=[])
    lengths, middle = np.diff(ends), (ends[1:] + ends[:-1]) / 2
    assert lengths[(middle > 2.4) & (middle < 4.0)].max() < 0.6 * lengths[middle < 1.0].max()


def test_a_scene_logs_that_it_chose_other_elements(caplog):
    """A log entry and `scene.mesh`; the mesh that was given stays as it was."""
    mesh = fx.mesh.disc(radius=10.0, thickness=0.2)
    mould = fx.Contact("top", fx.tools.cup(radius=9.0, depth=4.0, mouth=0.2, fillet=1.0, lip=0.5), "stick")
    with caplog.at_level("INFO", logger="formingx"):
        scene = fx.Scene(mesh=mesh, materials=fx.NeoHookean(c10=0.4), loads=[fx.Pressure("bottom")], contacts=[mould],
                         supports=[fx.Symmetry("axis"), fx.Clamped("rim")])
    columns = [len(found.columns.ends) - 1 for found in (scene.mesh, mesh)]
    assert columns[1] == 40 != columns[0]
    assert f"elements chosen for the tools: {columns[0]} columns instead of 40" in caplog.text
