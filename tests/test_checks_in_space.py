"""Checks of sheets in three dimensions: planes of symmetry, size of triangles, moulds wider or narrower than the sheet.
"""

import re

import numpy as np
import pytest
from test_space import disc, plug_above

import formingx as fx

BOX = {"half": (1.0, 1.5), "depth": 0.8, "corner": 0.3, "fillet": 0.15, "lip": 0.05}


def tray(scale, tool, size=0.1):
    """Return the scene of a sheet that is `scale` times as large as the mouth of the box."""
    outline = fx.mesh.rectangle(2 * scale, 3 * scale, corner=0.3 * scale, part="quarter")
    return fx.Scene(mesh=fx.mesh.sheet(outline, size=size * scale), thickness=0.02, materials=fx.NeoHookean(c10=1.0),
                    supports=[fx.Symmetry("x0"), fx.Symmetry("y0", "y"), fx.Clamped("rim")],
                    loads=[fx.Pressure("top")], contacts=[fx.Contact("bottom", tool)])


@pytest.fixture(scope="module")
def moulds(tmp_path_factory):
    file = tmp_path_factory.mktemp("mould") / "mould.stl"
    swept = fx.tools.box(**BOX)
    swept.to_stl(file, wall=0.3)
    return {"box": swept, "file": fx.tools.solid(file)}


@pytest.mark.parametrize("supports, words", [
    ([fx.Symmetry("x0", "y"), fx.Symmetry("y0", "y")], r"edge 'x0' y goes from 0 to 1: .* Symmetry\('x0', 'x'\)"),
    ([fx.Symmetry("x0"), fx.Symmetry("y0")], r"along the edge 'y0' x goes from 0 to 1: must be Symmetry\('y0', 'y'\)"),
    ([fx.Symmetry("x0"), fx.Symmetry("rim", "y")], "must be a straight edge along x or y; another edge can be Clamped"),
])
def test_a_plane_of_symmetry_is_normal_to_its_axis(supports, words):
    with pytest.raises(fx.InputError, match=words):
        disc(supports=[fx.SimplySupported("rim"), *supports])


def test_an_edge_may_slide_in_the_plane_of_the_sheet():
    """An edge of any shape lies in the plane z = 0, and the default axis is x."""
    scene = disc(supports=[fx.Symmetry("rim", "z"), fx.Symmetry("x0"), fx.Symmetry("y0", "y")],
                 contacts=[fx.Contact("top", fx.tools.revolved(fx.tools.sphere(radius=2.0, z=0.0)))])
    assert scene.symmetry_factor == 4 and fx.check(scene).healthy


@pytest.mark.parametrize("kind, scale, words", [
    ("box", 0.8, "the mould is wider than the sheet: its mouth is 0.205 mm or more away"),
    ("box", 0.96, "the mould is wider than the sheet: its mouth is 0.0"), ("box", 0.995, None),
    ("box", 1.0, None), ("box", 1.3, None), ("box", 16.0, "is 0.148 times as wide as the sheet: are"),
    ("file", 0.8, "the mould is wider than the sheet"), ("file", 1.0, None), ("file", 1.3, None),
    ("file", 4.0, "hangs past the end .*pressure = 1 is more than the 0.0541 MPa")])
def test_moulds_wider_or_narrower_than_the_sheet(moulds, kind, scale, words):
    report = fx.check(tray(scale, moulds[kind]), targets=[fx.pressure(1.0)], units=fx.Units(length="mm", stress="MPa"))
    if words is None:
        assert report.healthy
    else:
        finding, = (finding for finding in report.findings if "has fillets of radius" not in finding.text)
        assert finding.severity == "warning" and finding.about.startswith("Contact('bottom'")
        assert re.search(words, finding.text), finding.text


def test_a_narrow_file_may_be_in_another_unit(moulds):
    """The outer side of a file's solid is wider than its cavity, and does not hide it."""
    found = [finding.text for finding in fx.check(tray(12.0, moulds["file"])).findings]
    assert any("is 0.197 times as wide as the sheet: is its file in another unit" in text for text in found), found


@pytest.mark.thorough
def test_a_sheet_is_blown_past_the_end_of_a_narrow_mould(moulds):
    """Below the pressure of the finding the overhang stays a shallow blister; above it, it is the thinnest place."""
    depth, wall = [], []
    for pressure, found in ((0.15, False), (1.0, True)):
        scene, target = tray(2.4, moulds["file"]), fx.pressure(pressure)
        assert ("hangs past the end" in str(fx.check(scene, targets=[target]))) == found
        walls = fx.trace(scene, until=target, progress=False).wall()
        overhang = np.abs(walls.reference_points[:, 1]) > 3.2
        depth.append(-walls.deformed_points[overhang, 2].min())
        x = walls.middle[np.argmin(walls.ratio)]
        wall.append((x[1] > 3.2, walls.ratio.min()))
    assert depth[0] < 0.2 and depth[1] > 0.6
    assert not wall[0][0] and wall[1][0] and wall[1][1] < 0.4 * wall[0][1]


@pytest.mark.parametrize("size, error, words", [
    (0.3, 3e-4, None), (0.5, 0.041, "edges of triangles are up to 0.579 mm long, and the middle of the sheet is 1 mm"),
    (200.0, 0.117, r"up to 1 mm long.*size=0.1\), or adapt_mesh")])
def test_triangles_too_large_for_a_sheet(size, error, words):
    """Errors of the pressure of a blister 0.6 high; the pressure on triangles of size 0.05 is 0.0482505."""
    scene, target = disc(size), fx.displacement(0.6, at=(0.0, 0.0), component="z")
    pressure = fx.trace(scene, until=target, progress=False).last.measures["pressure"]
    assert abs(pressure / 0.0482505 - 1) == pytest.approx(error, rel=0.05)
    found = str(fx.check(scene, units=fx.Units(length="mm")))
    assert re.search(words or "no fault was found", found)


IN, OUT = (fx.Stage(name, control="plug", until=fx.travel(travel)) for name, travel in (("in", 0.5), ("out", 0.0)))


@pytest.mark.parametrize("separates, stages, found", [
    (None, [IN, OUT], True), (True, [IN, OUT], False), (None, [IN], False),
    (None, [IN, fx.Stage("out", inactive=["plug"])], False),
    (None, [fx.Stage("in", amplitudes={"plug": [(0.0, 0.0), (1.0, 0.5), (2.0, 0.2)]})], True)])
def test_a_plug_that_takes_the_sheet_along_is_reported(separates, stages, found):
    """By default a sheet that sticks does not separate in three dimensions."""
    scene = disc(contacts=[plug_above(separates)], model=fx.Membrane(wrinkles=0.01))
    texts = [finding.text for finding in fx.check(scene, stages=stages).findings]
    assert any("'plug' moves back and takes the sheet along" in text for text in texts) == found


@pytest.mark.parametrize("thickness", [1e-4, lambda x, y: 1e-4 + 0 * x])
def test_pressures_are_compared_to_the_thickness_of_a_sheet(thickness):
    """A thin sheet needs little pressure: half of shear modulus x thickness / length has an effect."""
    scene = fx.Scene(mesh=fx.mesh.sheet(fx.mesh.circle(100.0), size=20.0), thickness=thickness,
                     loads=[fx.Pressure("top")], materials=fx.NeoHookean(c10=0.5), supports=[fx.SimplySupported("rim")])
    assert fx.check(scene, targets=[fx.pressure(5e-7)]).healthy
    found, = fx.check(scene, targets=[fx.pressure(5e-12)]).findings
    assert "thickness / length = 5e-07" in found.text
