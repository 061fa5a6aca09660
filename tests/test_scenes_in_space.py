"""Scenes of sheets that no one means, and tools that cannot be resolved, are told before the run."""

import numpy as np
import pytest
from test_solid_surfaces import ball

import formingx as fx
from formingx import _compat
from formingx.extensions.space.surface import Surface
from formingx.extensions.space.triangulated import Triangulated
from formingx.io.stl import write_stl

BOX = fx.tools.box(half=(10.0, 14.0), depth=8.0, corner=3.0, fillet=2.0, lip=1.0)


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    name = tmp_path_factory.mktemp("tools") / "box.stl"
    BOX.to_stl(name, wall=3.0)
    return fx.tools.solid(name)


def upside_down(tool):
    points, triangles = tool.surface()
    turned = points * (1, -1, -1)
    return Triangulated(turned - (0, 0, turned[:, 2].max()), triangles, "turned.stl")


def texts(tool, size=1.5, whole=False, target=None, **options):
    """Findings of the check of a sheet over a mould."""
    part = "whole" if whole else "quarter"
    sheet = fx.mesh.sheet(fx.mesh.rectangle(24.0, 32.0, corner=4.0, part=part), size=size)
    supports = [fx.SimplySupported("rim"), *([] if whole else [fx.Symmetry("x0", "x"), fx.Symmetry("y0", "y")])]
    contacts = options.pop("contacts", None) or [fx.Contact("bottom", tool, "stick", name="mould")]
    scene = fx.Scene(mesh=sheet, thickness=options.pop("thickness", 0.5), materials=fx.NeoHookean(c10=1.0),
                     supports=supports, loads=[fx.Pressure("top")], contacts=contacts)
    return [finding.text for finding in fx.check(scene, targets=[target or fx.pressure(0.1)]).findings]


def test_a_sheet_on_its_mould_is_healthy(file):
    assert texts(BOX) == [] and texts(file) == [] and texts(file, whole=True) == []


@pytest.mark.parametrize("change, text", [
    (lambda tool: tool.moved(z=-0.5), "the mould lies 0.5 beyond the held edge"),
    (lambda tool: tool.moved(z=-6.0), "the mould lies 6 beyond the held edge"),
    (lambda tool: tool.moved(x=9.0), "a part of the held edge, as at .* lies over the cavity"),
    (upside_down, "is its file upside down")])
def test_moulds_that_are_not_under_the_sheet(file, change, text):
    import re
    found = texts(change(file), whole=True)
    assert any(re.search(text, finding) for finding in found), found


def test_a_plug_that_meets_the_held_edge():
    plug = fx.tools.box(half=(11.0, 15.0), depth=20.0, corner=4.0, fillet=2.0, draft=0.0, mouth=20.5, plug=True)
    narrow, wide = plug, fx.tools.box(half=(13.0, 17.0), depth=20.0, corner=4.0, fillet=2.0, mouth=20.5, plug=True)
    contacts = [[fx.Contact("top", tool, "stick", direction=(0, 0, -1), name="plug")] for tool in (narrow, wide)]
    assert not any("give way" in text for text in texts(None, contacts=contacts[0], target=fx.travel(6.0)))
    found = texts(None, contacts=contacts[1], target=fx.travel(6.0))
    assert any("after a travel of" in text and "cannot give way" in text for text in found), found


def push_bar(tool):
    """Push a tool into a clamped square, to a travel of 6; return the message and the findings at the start."""
    scene = fx.Scene(mesh=fx.mesh.sheet(fx.mesh.rectangle(60.0, 60.0), size=15.0), thickness=1.0,
                     supports=[fx.Clamped("rim")], materials=fx.NeoHookean(c10=1.0), model=fx.Membrane(wrinkles=0.01),
                     contacts=[fx.Contact("top", tool, "stick", direction=(0, 0, -1), name="pin")])
    warned = " ".join(found.text for found in fx.check(scene, targets=[fx.travel(6.0)]).findings)
    try:
        fx.trace(scene, until=fx.travel(6.0), progress=False)
    except fx.ConvergenceError as error:
        return str(error), warned
    return "", warned


def test_a_run_that_ends_at_the_held_edge_blames_the_edge():
    """A bar lies across the sheet and both its held edges, which stop it."""
    bar = fx.tools.extruded(fx.Tool([(-8.0, 30.0), (-8.0, 0.0), (8.0, 0.0), (8.0, 30.0)])).moved(z=0.5)
    text, warned = push_bar(bar)
    assert "meets the held edge of the sheet" in warned
    assert "the sheet is held there and cannot give way: use a smaller tool" in text and "triangles" not in text


def test_a_tool_that_starts_behind_the_sheet_between_its_nodes_is_refused():
    bar = fx.tools.box(half=(4.0, 4.0), depth=20.0, corner=1.0, fillet=0.5, mouth=20.0, plug=True).moved(x=3.0, y=2.5)
    with pytest.raises(fx.InputError, match=r"starts inside the tool: .*between its nodes: move the tool"):
        push_bar(bar.moved(z=-1.0))
    assert push_bar(bar.moved(z=0.2))[1].count("behind") == 0


def test_small_balls_are_pushed_and_told():
    """A ball of a tenth of the sheet is no unit error, so the run begins; a hundredth is refused."""
    ball = fx.tools.revolved(fx.tools.sphere(radius=3.0)).moved(z=0.5)
    text, warned = push_bar(ball)
    assert "the tool is 6 large, the sheet 60: are the units of length the same?" in warned
    assert not text or "passes through the sheet" in text
    with pytest.raises(fx.InputError, match="units of length"):
        push_bar(fx.tools.revolved(fx.tools.sphere(radius=0.25)).moved(z=0.5))


def test_files_whose_triangles_are_noisy_or_miss_their_edges(tmp_path):
    points, triangles = ball(16)
    smooth = Triangulated(points, triangles, "ball")
    assert smooth.roughness[0] < 0.01
    noise = np.random.default_rng(1).normal(size=points.shape)
    assert Triangulated(points + 2e-3 * noise, triangles, "ball").roughness[0] > 0.05
    write_stl(12 * (points + 2e-3 * noise) * (1, 1, 0.4) - (0, 0, 5), triangles, tmp_path / "noisy.stl")
    found = texts(fx.tools.solid(tmp_path / "noisy.stl"))
    assert any("do not resolve its surface" in text for text in found), found
    flat = texts(fx.tools.solid(tmp_path / "noisy.stl", crease=0))
    assert not any("do not resolve" in text for text in flat)


@pytest.mark.parametrize("friction", ["stick", 0.2])
def test_fillets_below_the_triangles(file, friction):
    def found(size):
        return texts(None, size=size, contacts=[fx.Contact("bottom", file, friction, name="mould")])
    assert any("fillets of radius 2" in text for text in found(2.6)) and found(1.5) == []


def test_thickness_rougher_than_the_triangles():
    def stripes(x, y):
        return 0.5 + 0.3 * np.sin(5.0 * x)
    assert any("the thickness varies within the triangles" in text for text in texts(BOX, thickness=stripes))
    assert texts(BOX, thickness=lambda x, y: 0.5 + 0.01 * x) == []


@pytest.mark.parametrize("radius, neck, shoulder, wall", [(1.0, 0.45, 0.5, 0.3), (0.8, 0.3, 0.6, 0.2)])
def test_a_bottle_from_its_neck_is_written_as_a_closed_mould(radius, neck, shoulder, wall, tmp_path):
    """The outer side of the file lies outside the widest part of the profile, and does not cross the cavity.

    The second shoulder turns by 39.8 degrees, just below the angle of sharp edges, beside long triangles.
    """
    profile = fx.tools.bottle(radius=radius, height=2.0, neck=neck, shoulder=shoulder, neck_height=0.3)
    mould = fx.tools.revolved(profile)
    mould.to_stl(tmp_path / "bottle.stl", wall=wall)
    tool, rng = fx.tools.solid(tmp_path / "bottle.stl"), np.random.default_rng(3)
    low, high = profile.bounds
    wide = radius + wall / 3                                  # nearer to the cavity than to the outer side
    x = rng.uniform((-wide, -wide, low[1] - 0.1), (wide, wide, high[1] - 0.2), (6000, 3))
    x = x[np.hypot(*x[:, :2].T) < wide]
    near = np.abs(mould.signed_distance(x)) < wall / 2.5
    np.testing.assert_allclose(tool.signed_distance(x)[near], mould.signed_distance(x)[near], atol=5e-3)


def test_the_thinnest_triangle_is_drawn(monkeypatch, tmp_path):
    """A mean at nodes would be thicker than the minimum wall of the part."""
    from formingx import figures
    drawn, pyvista = [], figures.pyvista()
    monkeypatch.setattr(pyvista.Plotter, "add_mesh", lambda self, mesh, **options: drawn.append((mesh, options)))
    sheet = fx.mesh.sheet(fx.mesh.rectangle(24.0, 32.0, corner=4.0, part="quarter"), size=3.0)
    scene = fx.Scene(mesh=sheet, thickness=0.5, materials=fx.NeoHookean(c10=1.0), loads=[fx.Pressure("top")],
                     supports=[fx.SimplySupported("rim"), fx.Symmetry("x0", "x"), fx.Symmetry("y0", "y")],
                     contacts=[fx.Contact("bottom", BOX, "stick")])
    path = fx.trace(scene, until=fx.pressure(0.1), progress=False)
    path.view3d(tmp_path / "tray.png")
    mesh, options = drawn[0]
    assert mesh[options["scalars"]].min() == pytest.approx(path.part().min_wall / 0.5, rel=1e-12)
    assert options["clim"][0] == pytest.approx(path.part().min_wall / 0.5, rel=1e-9)


def cup(friction, size, fillet=0.12, depth=0.8):
    """Return the path of a disc that a pressure of 0.36 forms in a cup."""
    profile = fx.Tool([(1.5, 0.0), (1.0, 0.0), (1.0, -depth), (0.0, -depth)], [0.0, 0.0, fillet, 0.0])
    sheet = fx.mesh.sheet(fx.mesh.circle(1.0, part="quarter"), size=size)
    scene = fx.Scene(mesh=sheet, thickness=0.01, materials=fx.NeoHookean(c10=1.0), loads=[fx.Pressure("top")],
                     supports=[fx.SimplySupported("rim"), fx.Symmetry("x0", "x"), fx.Symmetry("y0", "y")],
                     contacts=[fx.Contact("bottom", fx.tools.revolved(profile), friction, name="mould")])
    return fx.trace(scene, until=fx.pressure(0.36), progress=False)


def rim_force(path):
    """Return the force of the rim on the whole sheet along z, from the balance of its nodes."""
    with path.problem.state_context(path.last) as problem:
        forces, (face,) = problem.forces(problem.x, path.last.control), problem.contacts
        rim = np.hypot(*face.points[:, :2].T) > 1 - 1e-9
        return 4 * forces[face.rule.dofs[rim, 2]].sum() * problem.forms.stress * problem.forms.volume


@pytest.mark.parametrize("friction, size, fillet, depth", [
    ("none", 0.15, 0.12, 0.8), ("stick", 0.15, 0.12, 0.8),
    *(pytest.param(*case, marks=pytest.mark.thorough) for case in (("none", 0.08, 0.15, 0.6), (0.3, 0.1, 0.12, 0.8)))])
def test_supports_and_tools_balance_the_pressure(friction, size, fillet, depth):
    """They do on any triangles, up to the friction of the last step."""
    path = cup(friction, size, fillet, depth)
    domain = path.problem.forms.domain
    points, cells = domain.geometry.x, _compat.cell_nodes(domain)
    a, b, c = points[cells].transpose(1, 0, 2)
    load = 4 * 0.36 * np.abs(np.cross(b - a, c - a)[:, 2]).sum() / 2
    assert rim_force(path) - path.last.measures["mould_force"] == pytest.approx(load, rel=1e-7)
    assert not any("miss the resultant" in finding.text for finding in path.findings())


@pytest.mark.thorough
def test_the_force_of_a_sliding_sheet_converges():
    """On triangles nearly as long as the radius of the fillet, the force on the mould is within 1 %."""
    coarse, fine = (cup("none", size).last.measures["mould_force"] for size in (0.1, 0.04))
    assert coarse == pytest.approx(fine, rel=0.01)


def test_forces_that_miss_the_loads_are_told(monkeypatch):
    monkeypatch.setattr(Surface, "carried_forces", lambda self, face, fields, control: 0.0)
    found = cup("none", 0.15).findings()
    assert any("miss the resultant of the loads by 8" in finding.text for finding in found)


def test_forces_balance_where_nothing_loads_the_sheet():
    """A sheet on which no load acts, at rest or under a plug, has no missed forces beyond round-off."""
    plug = fx.Contact("top", fx.tools.revolved(fx.tools.sphere(radius=0.5, z=0.0)), direction=(0, 0, -1), name="plug")
    scene = fx.Scene(mesh=fx.mesh.sheet(fx.mesh.circle(1.0, part="quarter"), size=0.3), thickness=0.01,
                     materials=fx.Viscoelastic(fx.NeoHookean(c10=1.0), [(1.0, 1.0)]), contacts=[plug],
                     supports=[fx.SimplySupported("rim"), fx.Symmetry("x0", "x"), fx.Symmetry("y0", "y")],
                     loads=[fx.Pressure("top", name="air")])
    for stage in (fx.Stage("wait", duration=1.0), fx.Stage("push", control="plug", until=fx.travel(0.2))):
        path = fx.Process(scene).run([stage], accuracy="draft", progress=False)
        assert not any("miss the resultant" in finding.text for finding in path.findings())


def test_half_of_two_balloons_stops_at_its_plane_of_symmetry():
    """Two balloons with a waist would press at each other; the model of one would pass through its mirror image."""
    neck, turn = 0.2, np.pi - np.arcsin(0.2)
    t = np.linspace(-turn, turn, 40)
    outline = np.column_stack([np.cos(turn) * -1 + np.cos(t), np.sin(t)])
    sheet = fx.mesh.sheet(outline.tolist(), size=0.25, names=["rim"] * (len(t) - 1) + ["x0"])
    scene = fx.Scene(mesh=sheet, thickness=0.01, materials=fx.MooneyRivlin(c10=1.0, c01=0.2), supports=[
        fx.SimplySupported("rim"), fx.Symmetry("x0", "x")], loads=[fx.Pressure("bottom")])
    low, high = (fx.displacement(h, at=(np.sqrt(1 - neck**2), 0.0), component="z") for h in (0.3, 2.0))
    path = fx.trace(scene, until=low, progress=False)
    assert not any("plane of symmetry" in finding.text for finding in path.findings())
    with pytest.raises(fx.ConvergenceError, match="crosses the plane of symmetry x = .* where its mirror image is"):
        fx.trace(scene, until=high, progress=False)


def test_the_gap_of_an_untouched_mould_leaves_out_the_held_rim():
    """The rim lies on the flange, so the smallest gap is that of the nodes next to it."""
    sheet = fx.mesh.sheet(fx.mesh.circle(1.2, part="quarter"), size=0.3)
    cup = fx.tools.revolved(fx.Tool([(2.0, 0.0), (1.2, 0.0), (1.1, -0.8), (0.0, -0.8)], [0.0, 0.0, 0.1, 0.0]))
    scene = fx.Scene(mesh=sheet, thickness=0.01, materials=fx.NeoHookean(c10=1.0), loads=[fx.Pressure("top")],
                     supports=[fx.SimplySupported("rim"), fx.Symmetry("x0", "x"), fx.Symmetry("y0", "y")],
                     contacts=[fx.Contact("bottom", cup, "none", name="mould")])
    path = fx.trace(scene, until=fx.pressure(0.002), progress=False)
    (text,) = (finding.text for finding in path.findings() if "mould" in finding.about)
    assert "never touched" in text and "the gap was 0 at" not in text and "and 0 at the end" not in text, text
