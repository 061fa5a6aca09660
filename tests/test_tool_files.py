"""Tools from drawings: splines as arcs to a tolerance, DXF, curves put end to end, the solid on the right side."""

import math
import re

import numpy as np
import pytest

import formingx as fx
from formingx.tools import cad
from formingx.tools.arcs import arcs_along
from formingx.tools.pieces import Arc

tools = fx.tools
POINTS = np.random.default_rng(1).uniform([0, 1.5], [12, 7], (100, 2))


def ellipse(t):
    a = math.pi / 2 * t
    return np.column_stack([3 * np.cos(a), np.sin(a)]), np.column_stack([-3 * np.sin(a), np.cos(a)])


def test_arcs_converge_to_a_curve():
    """Closer with the tolerance, smooth at every joint, and no more than its inverse third root asks for."""
    numbers = []
    exact = ellipse(np.linspace(0, 1, 1000))[0]
    for tolerance in (1e-2, 1e-4, 1e-6):
        pieces = arcs_along(ellipse, tolerance, "ellipse")
        tool = tools.Tool.of_pieces(pieces)
        assert np.abs(tool.signed_distance(exact[1:-1])).max() < 1.05 * tolerance
        for p, q in zip(pieces, pieces[1:]):
            assert math.cos(p.angles[1] - q.angles[0]) == pytest.approx(1, abs=1e-12)
            np.testing.assert_allclose(p.ends[1], q.ends[0], atol=1e-12)
        numbers.append(len(pieces))
    assert numbers[0] < numbers[1] < numbers[2] < 12 * numbers[1], numbers      # 100^(1/3) = 4.6 times


@pytest.mark.parametrize("curve, words", [
    (lambda t: (np.column_stack([t, np.abs(t - 0.3)]), np.column_stack([1 + 0 * t, np.sign(t - 0.3)])), "not within"),
    (lambda t: (np.column_stack([t**2, t**3]), np.column_stack([2 * t, 3 * t**2])), "no direction"),
    (lambda t: (np.column_stack([t, t * np.nan]), np.ones((len(t), 2))), "no direction")])
def test_curves_that_are_not_smooth(curve, words):
    with pytest.raises(fx.InputError, match=f"a curve: .*{words}"):
        arcs_along(curve, 1e-6, "a curve")


@pytest.mark.parametrize("kind", ["step", "brep"])
def test_splines_of_cad(tmp_path, kind):
    import gmsh
    gmsh.initialize(interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        occ = gmsh.model.occ
        knots = [occ.addPoint(x, math.sin(x), 0) for x in np.linspace(0, 3, 9)]
        occ.addSpline(knots)
        occ.synchronize()
        (low,), (high,) = gmsh.model.getParametrizationBounds(1, 1)
        exact = np.array(gmsh.model.getValue(1, 1, np.linspace(low, high, 300))).reshape(-1, 3)[:, :2]
        gmsh.write(str(tmp_path / f"wave.{kind}"))
    finally:
        gmsh.finalize()
    tool = tools.read(tmp_path / f"wave.{kind}", [1], tolerance=1e-4)
    assert 1e-7 < np.abs(tool.signed_distance(exact)).max() < 1e-4
    assert all(isinstance(p, Arc) for p in tool.pieces)
    with pytest.raises(fx.InputError, match="give tolerance="):
        tools.read(tmp_path / f"wave.{kind}", [1])
    with pytest.raises(fx.InputError, match="tolerance = 0: must be greater"):
        tools.read(tmp_path / f"wave.{kind}", [1], tolerance=0)


CUP = """Point(1) = {0, 5, 0}; Point(2) = {9, 5, 0}; Point(3) = {9, 4, 0}; Point(4) = {10, 4, 0}; Point(5) = {10, 0, 0};
Line(3) = {1, 2}; Circle(2) = {4, 3, 2}; Line(1) = {5, 4};"""


def test_end_to_end_and_the_side_of_the_body(tmp_path):
    """Curves in any order and direction are one profile; the body says where the solid is."""
    (tmp_path / "cup.geo").write_text(CUP)
    same = tools.cup(radius=10, depth=5, fillet=1)
    mesh = fx.mesh.disc(radius=9.0, thickness=0.5, elements=(4, 1))
    for body in ((1.0, 1.0), mesh):
        tool = tools.read(tmp_path / "cup.geo", body=body)
        np.testing.assert_allclose(tool.signed_distance(POINTS), same.signed_distance(POINTS), atol=1e-12)
    other = tools.read(tmp_path / "cup.geo", body=(20.0, 3.0))
    np.testing.assert_allclose(other.signed_distance(POINTS), -same.signed_distance(POINTS), atol=1e-12)
    np.testing.assert_allclose(other.reversed().signed_distance(POINTS), same.signed_distance(POINTS), atol=1e-12)
    for radius, remedy in (12.0, "move the tool or the body"), (12000.0, "body 1.2e.04: give the unit of your script"):
        with pytest.raises(fx.InputError, match=f"the body is on both sides of the profile.*{remedy}"):
            tools.read(tmp_path / "cup.geo", body=fx.mesh.disc(radius=radius, thickness=radius / 24, elements=(4, 1)))


@pytest.mark.parametrize("more, words", [
    ("Point(6) = {20, 0, 0}; Point(7) = {21, 0, 0}; Line(9) = {6, 7};", "4 free ends"),
    ("Point(6) = {20, 5, 0}; Line(9) = {2, 6};", "more than two ends"),
    ("Circle(9) = {20, 0, 0, 1};", "closes in itself")])
def test_curves_that_are_not_one_profile(tmp_path, more, words):
    (tmp_path / "cup.geo").write_text(CUP + more)
    with pytest.raises(fx.InputError, match=words):
        tools.read(tmp_path / "cup.geo")


def test_closed_curves_close(tmp_path):
    (tmp_path / "ring.geo").write_text("Circle(1) = {0, 2, 0, 1};")
    tool = tools.read(tmp_path / "ring.geo", body=(0, 5))
    np.testing.assert_allclose(tool.signed_distance(POINTS), 1 - np.hypot(*(POINTS - (0, 2)).T), atol=1e-12)


def drawing(tmp_path, fill):
    ezdxf = pytest.importorskip("ezdxf")
    doc = ezdxf.new()
    fill(doc.modelspace())
    doc.saveas(tmp_path / "drawing.dxf")
    return tmp_path / "drawing.dxf"


def test_dxf(tmp_path):
    """Lines, an arc, a polyline with a bulge, beside a text: all the same cup."""
    same = tools.cup(radius=10, depth=5, fillet=1).signed_distance(POINTS)

    def curves(space):
        space.add_line((10, 0), (10, 4)), space.add_text("cup")
        space.add_arc((9, 4), 1, 0, 90), space.add_line((0, 5), (9, 5))
    tool = tools.read(drawing(tmp_path, curves), body=(1, 1))
    np.testing.assert_allclose(tool.signed_distance(POINTS), same, atol=1e-12)
    np.testing.assert_allclose(tools.read(tmp_path / "drawing.dxf", [3, -2, -1]).signed_distance(POINTS), same,
                               atol=1e-12)
    rows = [(0, 5, 0), (9, 5, -math.tan(math.pi / 8)), (10, 4, 0), (10, 0, 0)]
    for old in (False, True):
        file = drawing(tmp_path, lambda space, old=old: (space.add_polyline2d if old else space.add_lwpolyline)(
            rows, format="xyb"))
        np.testing.assert_allclose(tools.read(file).signed_distance(POINTS), same, atol=1e-12)


def test_dxf_splines_and_ellipses(tmp_path):
    file = drawing(tmp_path, lambda space: (space.add_ellipse((0, 0), (3, 0), 1 / 3, 0, math.pi / 2),
                                            space.add_spline([(0, 0), (1, 1), (2, 0.5), (3, 2)])))
    tool = tools.read(file, [1], tolerance=1e-3)
    assert np.abs(tool.signed_distance(ellipse(np.linspace(0.01, 0.99, 100))[0])).max() < 1e-3
    wave = tools.read(file, [2], tolerance=1e-4)
    assert np.abs(wave.signed_distance(np.array([(0, 0), (1, 1), (2, 0.5), (3, 2.0)]))).max() < 1e-4
    with pytest.raises(fx.InputError, match="curve 1 is neither .*give tolerance"):
        tools.read(file, [1])


def hidden(space, **layer):
    made = space.doc.layers.add("hidden")
    for name in layer:
        getattr(made, name)()
    space.add_line((0, 0), (5, 5), dxfattribs={"layer": "hidden"})


def test_hidden_drawing_entities_are_ignored(tmp_path):
    for hide in (lambda s: hidden(s, off=1), lambda s: hidden(s, freeze=1),
                 lambda s: s.add_line((0, 0), (5, 5), dxfattribs={"invisible": 1})):
        file = drawing(tmp_path, lambda s, hide=hide: (hide(s), s.add_line((3, 0), (0, 0))))
        assert repr(tools.read(file)) == repr(tools.read(file, [1])) == "Tool(1 line from (3, 0) to (0, 0))"


@pytest.mark.parametrize("code, of, factor", [
    (4, "mm", 1), (5, "mm", 10), (1, "cm", 2.54), (6, "um", 1e6), (6, 2.5, 2.5)])
def test_units_of_a_drawing(tmp_path, code, of, factor):
    """What a drawing states is turned into the script's; a tolerance is in the script's."""
    def fill(space):
        space.doc.header["$INSUNITS"] = code
        space.add_arc((0, 2), 2, 270, 360), space.add_ellipse((0, 0), (3, 0), 1 / 3, 0, math.pi / 2)
    file = drawing(tmp_path, fill)
    arc = tools.read(file, [1], units=of).pieces[0]
    assert arc.radius == pytest.approx(2 * factor) and arc.centre == pytest.approx([0, 2 * factor])
    tool = tools.read(file, [2], units=of, tolerance=1e-4 * factor)
    off = np.abs(tool.signed_distance(factor * ellipse(np.linspace(0.01, 0.99, 100))[0])).max()
    assert 1e-6 * factor < off < 1e-4 * factor


def test_units_that_are_not_stated(tmp_path):
    (tmp_path / "cup.geo").write_text(CUP)
    none = drawing(tmp_path, lambda s: (s.add_line((0, 0), (1, 0)), s.doc.header.__setitem__("$INSUNITS", 0)))
    for file in (tmp_path / "cup.geo", none):
        with pytest.raises(fx.InputError, match="units = 'mm': .* does not state its own: give a factor"):
            tools.read(file, units="mm")
    with pytest.raises(fx.InputError, match="units .of length, or a factor. = None"):
        tools.read(none, units=fx.Units())
    assert tools.read(none, units=25.4).pieces[0].b == pytest.approx([25.4, 0])
    with pytest.raises(fx.InputError, match="units 'yard' is not known"):
        tools.read(none, units="yard")


@pytest.mark.parametrize("more, words", [
    ("Spline(9) = {1, 2, 3};", "curve 9 is a Spline"), ("BSpline(9) = {1, 2, 3};", "curve 9 is a BSpline"),
    ("Ellipse(9) = {1, 2, 3, 4};", "curve 9 is a Ellipse"), ("Bezier(9) = {1, 2, 3};", "curve 9 is a Bezier"),
    ("Point(5) = {1, 1, 0};", "a second point 5"), ("Point(9) = {1_0, 1, 0};", "is not a number"),
    ("Point(9) = {0x10, 1, 0};", "is not a number"), ("Point(9) = {\u0661, 1, 0};", "is not a number"),
    ("Point(9) = {1e308, 0, 0}; Line(9) = {5, 9};", "1e.308 away: must be below"),
    ("r = 12", "does not end in a semicolon")])
def test_geo_is_read_right_or_refused(tmp_path, more, words):
    """A curve that was passed over left a hole in the profile."""
    (tmp_path / "cup.geo").write_text(CUP + more, encoding="utf-8")
    with pytest.raises(fx.InputError, match=words):
        tools.read(tmp_path / "cup.geo")
    if "curve 9" in words:
        assert len(tools.read(tmp_path / "cup.geo", [3, -2, -1]).pieces) == 3


def solid(tmp_path, kind, draw):
    import gmsh
    gmsh.initialize(interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        draw(gmsh.model.occ)
        gmsh.model.occ.synchronize()
        gmsh.write(str(tmp_path / f"a.{kind}"))
    finally:
        gmsh.finalize()
    return tmp_path / f"a.{kind}"


@pytest.mark.parametrize("kind", ["step", "brep"])
def test_curves_out_of_the_plane(tmp_path, kind):
    """An arc in the x-z plane was taken for a line."""
    file = solid(tmp_path, kind, lambda occ: occ.addCircle(0, 0, 0, 1, angle1=0, angle2=1, zAxis=[0, -1, 0],
                                                           xAxis=[1, 0, 0]))
    with pytest.raises(fx.InputError, match="z must be 0"):
        tools.read(file)
    with pytest.raises(fx.InputError, match="z must be 0"):
        tools.read(file, tolerance=1e-3)


def test_units_of_step(tmp_path):
    file = solid(tmp_path, "step", lambda occ: occ.addCircle(0, 2, 0, 30, angle1=0, angle2=1))
    assert tools.read(file).pieces[0].radius == pytest.approx(30)
    assert tools.read(file, units="cm").pieces[0].radius == pytest.approx(3)
    text = file.read_text()
    for wrong, words in ((text[:len(text) // 2], "cut off"), (re.sub(r"#\d+ = CIRCLE.*\n", "", text), "refers to #"),
                         (text.replace("LENGTH_UNIT()", "LENGTH_UNIT() LENGTH_UNIT()", 1), "is not whole"),
                         (text.replace("LENGTH_UNIT()", "LENGTH_UNIT(", 1), "is not whole")):
        file.write_text(wrong)
        with pytest.raises(fx.InputError, match=words):
            tools.read(file)


def test_a_step_file_without_its_placement_is_refused(tmp_path):
    def two_parts(occ):
        points = [occ.addPoint(*p, 0) for p in ((0, 5), (9, 5), (9, 4), (10, 4))]
        occ.addLine(*points[:2]), occ.addCircleArc(*points[1:])
    file = solid(tmp_path, "step", two_parts)
    assert len(tools.read(file).pieces) == 2
    text, lost = re.subn(r"REPRESENTATION_RELATIONSHIP_WITH_TRANSFORMATION\(#\d+\)", "", file.read_text(), count=1)
    assert lost
    file.write_text(text)
    with pytest.raises(fx.InputError, match="nothing refers to #.*, a transformation"):
        tools.read(file)


@pytest.mark.parametrize("lost, words", [
    (r"#\d+ = CONTEXT_DEPENDENT_SHAPE_REPRESENTATION\([^;]*;", "nothing refers to #.*, a transformation"),
    (r"(?<=ASSIGNED_CONTEXT\()\s*\(#[^)]*\)\)\s*REPRESENTATION_CONTEXT\('Context #1',", "its units are lost")])
def test_a_step_file_that_lost_a_line(tmp_path, lost, words):
    file = solid(tmp_path, "step", lambda occ: (occ.addLine(*(occ.addPoint(x, 5, 0) for x in (0, 9))),
                                               occ.addLine(*(occ.addPoint(x, 4, 0) for x in (9, 12)))))
    text, times = re.subn(lost, "", file.read_text(), count=1)
    assert times and len(tools.read(file, [1]).pieces) == 1
    file.write_text(text)
    with pytest.raises(fx.InputError, match=words):
        tools.read(file, [1])


def test_time_to_read_grows_with_a_file(tmp_path, monkeypatch):
    """A large one is not a damaged one."""
    (tmp_path / "reader.py").write_text("import sys; print('{\"error\": \"' + sys.argv[3] + '\"}')")
    monkeypatch.setattr(cad.cad_process, "__file__", str(tmp_path / "reader.py"))
    for size, seconds in ((100, 10), (5_000_000, 110)):
        (tmp_path / "tool.brep").write_bytes(b"DBRep_DrawableShape" + b" " * size)
        with pytest.raises(fx.InputError, match=f"cannot be read: {seconds}$"):
            tools.read(tmp_path / "tool.brep")


@pytest.mark.parametrize("body, words", [
    ("import os, signal; os.kill(os.getpid(), signal.SIGSEGV)", r"Open CASCADE ended at it \(SIGSEGV\)"),
    ("import resource; resource.setrlimit(resource.RLIMIT_CPU, (1, 1))\nwhile True: pass", "took more than"),
    ("print('{\"curves\": {\"1\": [0, 1]}}')", "Open CASCADE ended at it")])
def test_a_file_that_ends_its_reader(tmp_path, monkeypatch, body, words):
    file = solid(tmp_path, "brep", lambda occ: occ.addCircle(0, 2, 0, 30, angle1=0, angle2=1))
    (tmp_path / "reader.py").write_text(body)
    monkeypatch.setattr(cad.cad_process, "__file__", str(tmp_path / "reader.py"))
    with pytest.raises(fx.InputError, match=f"cannot be read: .*{words}"):
        tools.read(file)


@pytest.mark.parametrize("old, new, words", [
    (" 11\n", " 41\n", "has 0 values of group code 11"), ("\nLINE\n", "\nLIME\n", "an unknown kind of entity"),
    ("  0\nEOF\n", "", "cut off"), (" 20\n", " 20.\n", "no group code")])
def test_damaged_dxf(tmp_path, old, new, words):
    """ezdxf ends such a line in (0, 0), or leaves it out."""
    file = drawing(tmp_path, lambda s: (s.add_line((3, 0), (4, 1)), s.add_line((4, 1), (5, 5))))
    assert len(tools.read(file).pieces) == 2
    head, entities = file.read_text().split("\nENTITIES\n")
    assert old in entities
    file.write_text(head + "\nENTITIES\n" + entities.replace(old, new, 1))
    with pytest.raises(fx.InputError, match=words):
        tools.read(file)


def test_tolerances_too_fine_are_refused():
    with pytest.raises(fx.InputError, match="tolerance = 1e-12: must be at least 1e-07 of the curve's size, 3e-07"):
        arcs_along(ellipse, 1e-12, "ellipse")


@pytest.mark.parametrize("fill, words", [
    (lambda s: s.add_lwpolyline([(0, 0), (1, 0)], dxfattribs={"elevation": 2}), "z must be 0"),
    (lambda s: s.add_arc((0, 0, 1), 1, 0, 90), "z must be 0"),
    (lambda s: s.add_polyline2d([(0, 0), (1, 0), (2, 1)], dxfattribs={"flags": 4}), "fitted with a spline"),
    (lambda s: s.add_line((0, 0, 1), (1, 0, 0)), "z must be 0"), (lambda s: s.add_text("a"), "has no curves"),
    (lambda s: s.add_3dface([(0, 0), (1, 0), (1, 1)]), "3DFACE, which is no curve"),
    (lambda s: s.add_arc((0, 0), 1, 0, 90, dxfattribs={"extrusion": (0, 0, -1)}), "extrusion"),
    (lambda s: s.add_circle((0, 0), 0), "radius = 0")])
def test_dxf_refuses(tmp_path, fill, words):
    with pytest.raises(fx.InputError, match=words):
        tools.read(drawing(tmp_path, fill))


@pytest.mark.parametrize("text", ["", "hello", "  0\nSECTION\n  2\nENTITIES\n  0\nLINE\n 10\nx\n"])
def test_broken_dxf(tmp_path, text):
    pytest.importorskip("ezdxf")
    (tmp_path / "a.dxf").write_text(text)
    with pytest.raises(fx.InputError, match="cannot be read"):
        tools.read(tmp_path / "a.dxf", [1])


def test_pot():
    """The mould's radii and depth, a plug that clears the wall all the way down, a sheet that starts between them."""
    mould, plug = tools.pot(mouth=40, base=25, depth=70, sheet=1.2, fillet=4, lip=2)
    wall = np.column_stack([np.linspace(39, 26.5, 9), np.linspace(1.2 + 70 / 15, 1.2 + 63, 9)])
    exact = (wall - (40, 1.2)) @ [70, 15] / math.hypot(70, 15)
    np.testing.assert_allclose(mould.signed_distance(wall), exact, atol=1e-12)
    assert mould.signed_distance([[0, 71.2]])[0] == pytest.approx(0) and plug.signed_distance([[0, 0]])[0] == 0
    assert np.all(mould.moved(z=-70 - 1.2).signed_distance(plug.outline()) < 1e-12)
    sheet = fx.mesh.disc(radius=45, thickness=1.2, elements=(20, 1))
    fx.Scene(mesh=sheet, materials=fx.NeoHookean(c10=0.2), loads=[fx.Pressure("bottom", name="air")],
             supports=[fx.Symmetry("axis"), fx.Clamped("rim")],
             contacts=[fx.Contact("top", mould, "stick"), fx.Contact("bottom", plug, direction=(0, 1), name="plug")])
