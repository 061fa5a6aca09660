"""Meshes: names, layers, grading, files."""


import numpy as np
import pytest
from conftest import ROOT, run_json, treloar

import formingx as fx
from formingx import _compat
from formingx.forms.solid import Solid

pytestmark = pytest.mark.quick


def test_disc_layers_and_boundaries():
    mesh = fx.mesh.disc(radius=2.0, thickness={"a": 0.1, "b": 0.3}, elements=(5, (1, 2)))
    assert set(mesh.layers) == {"a", "b"} and set(mesh.boundaries) == {"axis", "rim", "bottom", "top"}
    assert [len(mesh.cells.find(mesh.layers[n])) for n in "ab"] == [10, 20]
    assert np.allclose(mesh.nodes_of("top")[:, 1], 0.4) and len(mesh.nodes_of("top")) == 11
    assert np.allclose(mesh.nodes_of("rim")[:, 0], 2.0) and np.allclose(mesh.nodes_of("axis")[:, 0], 0.0)


@pytest.mark.parametrize("swapped", [False, True])
@pytest.mark.parametrize("backwards", [False, True])
def test_from_lines(swapped, backwards):
    """The frustum of a cone: volume, names and nodes, for both orders and both directions of the lines."""
    lines = [np.array([(0, 0), (20, 0), (30, 40)]), np.array([(0, -2), (21, -2), (32, 40)])]
    given = [line[::-1] if backwards else line for line in (lines[::-1] if swapped else lines)]
    counts = [16, 8] if backwards else [8, 16]
    mesh = fx.mesh.from_lines(*given, elements=(counts, [1, 2]), layers={"a": 3, "b": 1})
    inner, outer, free = ("outer", "inner", "start" if backwards else "end")[: 3] if swapped else (
        "inner", "outer", "start" if backwards else "end")
    assert set(mesh.boundaries) == {"axis", free, "inner", "outer"}
    assert np.allclose(mesh.nodes_of("axis")[:, 0], 0) and np.allclose(mesh.nodes_of(free)[:, 1], 40)
    assert len(mesh.nodes_of("inner")) == 2 * 24 + 1 and given[0][1].tolist() in mesh.nodes_of("inner").tolist()
    assert [len(mesh.cells.find(mesh.layers[n])) for n in "ab"] == [48, 96]
    R, Z = np.concatenate([lines[0], lines[1][::-1]]).T
    r, z = np.roll(R, -1), np.roll(Z, -1)
    exact = abs(np.pi / 3 * np.sum((R + r) * (R * z - r * Z)))              # Pappus, side by side
    scene = fx.Scene(mesh=mesh, materials=fx.NeoHookean(c10=1.0), supports=[fx.Symmetry("axis"), fx.Clamped(free)],
                     loads=[fx.Pressure("inner")])
    assert Solid(scene).volume == pytest.approx(exact, rel=1e-12)


def test_wall_of_a_tube_that_is_thinner_at_its_top():
    """The lines of both faces have the same direction, although their ends of smaller R lie at different heights."""
    Z = np.linspace(0, 100, 6)
    tube = fx.mesh.from_lines([(20, z) for z in Z], [(22 - 0.01 * z, z) for z in Z], elements=(1, 1))
    scene = fx.Scene(mesh=tube, materials=fx.NeoHookean(c10=0.4), supports=[fx.Clamped("start"), fx.Clamped("end")],
                     loads=[fx.Pressure("inner")])
    wall = fx.solve(scene, to=1e-6).wall()
    assert wall.wall == pytest.approx(2 - 0.01 * wall.z, rel=1e-3)


def test_grading():
    R = fx.mesh.disc(radius=1.0, thickness=0.1, elements=(6, 1), grading=0.2).nodes_of("bottom")[::2, 0]
    sizes = np.diff(R)
    assert sizes[-1] / sizes[0] == pytest.approx(0.2) and np.all(np.diff(sizes) < 0)


@pytest.mark.parametrize("sizes, along", [
    ({0.3: 0.05}, 24), ({0.3: 0.1, 1.0: 0.02}, 40), ({0.0: 0.5}, 9), ({0.4: 1}, 2)])
def test_concentrate(sizes, along):
    """Elements are smallest at the given radii, where nodes lie; sizes grow linearly in the requested ratio."""
    mesh = fx.mesh.disc(radius=1.0, thickness=0.1, elements=(along, 2), concentrate=sizes)
    R = mesh.nodes_of("top")[:, 0]
    joints, middles, length = R[::2], R[1::2], np.diff(R[::2])
    assert len(joints) == along + 1 and joints[[0, -1]] == pytest.approx([0, 1], abs=1e-15)
    assert middles == pytest.approx((joints[1:] + joints[:-1]) / 2, rel=1e-12)
    assert mesh.nodes_of("bottom")[:, 0] == pytest.approx(R, rel=1e-12)
    away = np.abs(np.subtract.outer(joints, list(sizes)))
    assert away.min(0) == pytest.approx(0, abs=1e-15)
    if along > 10:
        farthest = np.abs(np.subtract.outer(np.linspace(0, 1, 10001), list(sizes))).min(1).max()
        away = np.abs(np.subtract.outer(middles, list(sizes)))
        small = np.array(list(sizes.values()))
        wanted = (small + (1 - small) * away / farthest).min(1)
        assert length / length.sum() == pytest.approx(wanted / wanted.sum(), rel=0.12)


@pytest.mark.parametrize("layers, through, ends", [
    ({"sheet": 0.7}, [1, 2, 4], [0, 0.1, 0.3, 0.7]),
    ({"a": 0.3, "b": 0.1, "c": 0.1}, [1, 1, 2], [0, 0.3, 0.4, 0.45, 0.5]),
    ({"a": 0.6, "b": 0.4}, ([2.0, 1.0], 2), [0, 0.4, 0.6, 0.8, 1.0])])
def test_grading_through_the_thickness(layers, through, ends):
    """Elements of a layer have the given relative sizes from the bottom up; numbers give equal sizes."""
    mesh = fx.mesh.disc(radius=1.0, thickness=layers, elements=(3, through))
    assert mesh.nodes_of("axis")[::2, 1] == pytest.approx(ends, abs=1e-15)
    assert mesh.nodes_of("axis")[1::2, 1] == pytest.approx(np.add(ends[1:], ends[:-1]) / 2, abs=1e-15)
    assert set(mesh.layers) == set(layers)


def test_sphere_is_curved_to_second_order():
    """All nodes, mid-edge nodes too, lie on circles; the volume error is of order 4 in the element size."""
    errors = []
    for n in (4, 8):
        mesh = fx.mesh.sphere(inner_radius=2.0, thickness={"x": 0.5, "y": 1.0}, elements=(n, (1, 2)))
        assert _compat.coordinate_map(mesh.domain).degree == 2
        assert set(mesh.layers) == {"x", "y"} and set(mesh.boundaries) == {"axis", "equator", "inner", "outer"}
        for name, radius in (("inner", 2.0), ("outer", 3.5)):
            nodes = mesh.nodes_of(name)
            assert len(nodes) == 2 * n + 1 and np.hypot(*nodes.T) == pytest.approx(radius, rel=1e-14)
        assert np.allclose(mesh.nodes_of("axis")[:, 0], 0) and np.all(mesh.nodes_of("equator")[:, 1] == 0)
        scene = fx.Scene(mesh=mesh, materials=fx.NeoHookean(c10=1.0), loads=[fx.Pressure("inner")],
                         supports=[fx.Symmetry("axis"), fx.Symmetry("equator", normal="z")])
        errors.append(abs(Solid(scene).volume / (2 / 3 * np.pi * (3.5**3 - 2.0**3)) - 1))
    assert errors[1] < 1e-5 and np.log2(errors[0] / errors[1]) > 3.8, errors


def test_file_and_back(tmp_path):
    """A mesh that is written and read gives the same path, and so does the grid in the repository."""
    scene = treloar((10, 1))
    fx.mesh.write(scene.mesh, tmp_path / "sheet.msh")
    pressures = []
    for mesh in (scene.mesh, fx.mesh.read(tmp_path / "sheet.msh"), fx.mesh.read(ROOT / "meshes" / "treloar_20.msh")):
        assert mesh.layers == {"sheet": 1} and set(mesh.boundaries) == {"axis", "rim", "bottom", "top"}
        again = fx.Scene(mesh=mesh, materials=scene.materials, supports=scene.supports, loads=scene.loads)
        pressures.append(fx.trace(again, until=fx.pole_stretch(1.5)).last.measures["pressure"])
    assert pressures == pytest.approx([pressures[0]] * 3, rel=1e-9)


def test_file_without_names(tmp_path):
    import gmsh
    gmsh.initialize(interruptible=False)
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.model.occ.addRectangle(0, 0, 0, 1, 1)
    gmsh.model.occ.synchronize()
    gmsh.model.mesh.generate(2)
    gmsh.write(str(tmp_path / "plain.msh"))
    gmsh.finalize()
    with pytest.raises(fx.InputError, match="no physical group of dimension 2"):
        fx.mesh.read(tmp_path / "plain.msh")


def test_first_order_mesh_gives_the_same_numbers(tmp_path):
    """The displacement is quadratic for files of first and of second order."""
    import gmsh
    fx.mesh.write(treloar((10, 1)).mesh, tmp_path / "second.msh")
    gmsh.initialize(interruptible=False)
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.open(str(tmp_path / "second.msh"))
    gmsh.model.mesh.setOrder(1)
    gmsh.write(str(tmp_path / "first.msh"))
    gmsh.finalize()
    first = fx.mesh.read(tmp_path / "first.msh")
    assert _compat.coordinate_map(first.domain).degree == 1
    pressures = []
    for mesh in (first, treloar((10, 1)).mesh):
        scene = fx.Scene(mesh=mesh, materials=fx.NeoHookean(c10=2.0), loads=[fx.Pressure("bottom")],
                         supports=[fx.Symmetry("axis"), fx.SimplySupported("rim")])
        pressures.append(fx.trace(scene, until=fx.pole_stretch(1.5)).last.measures["pressure"])
    assert pressures[0] == pytest.approx(pressures[1], rel=1e-9)


def test_parison_is_a_tube_with_a_round_bottom():
    """All nodes lie on circles or on straight lines; the volume error is of order 4 in the element size."""
    errors = []
    for n in (8, 16):
        mesh = fx.mesh.parison(inner_radius=1.0, thickness={"x": 0.2, "y": 0.3}, length=3.0, elements=(n, 1))
        assert set(mesh.layers) == {"x", "y"} and set(mesh.boundaries) == {"axis", "neck", "inner", "outer"}
        for name, radius in (("inner", 1.0), ("outer", 1.5)):
            line = mesh.line_of(name)
            assert line[0] == pytest.approx([0, -radius]) and line[-1] == pytest.approx([radius, 3.0])
            assert np.hypot(line[:, 0], np.minimum(line[:, 1], 0)) == pytest.approx(radius, rel=1e-14)
            assert np.any(line[::2, 1] == 0)                       # the joint is a corner of elements
        assert np.all(mesh.nodes_of("axis")[:, 0] == 0) and np.all(mesh.nodes_of("neck")[:, 1] == 3.0)
        scene = fx.Scene(mesh=mesh, materials=fx.NeoHookean(c10=1.0), loads=[fx.Pressure("inner")],
                         supports=[fx.Symmetry("axis"), fx.Clamped("neck")])
        errors.append(abs(Solid(scene).volume / (np.pi * ((1.5**3 - 1) * 2 / 3 + (1.5**2 - 1) * 3)) - 1))
    assert errors[1] < 1e-4 and np.log2(errors[0] / errors[1]) > 3.5, errors


def test_line_of_a_boundary():
    mesh = fx.mesh.disc(radius=2.0, thickness=0.1, elements=(5, 1))
    np.testing.assert_allclose(mesh.line_of("top"), mesh.nodes_of("top"))
    np.testing.assert_allclose(mesh.line_of("rim"), mesh.nodes_of("rim"))


def test_parts_of_a_boundary():
    """A part has the facets between its ends, which the whole boundary keeps; parts may overlap."""
    mesh = fx.mesh.disc(radius=2.0, thickness=0.1, elements=(10, 2), concentrate={0.5: 0.2, 1.2: 0.5})
    whole = mesh.facets_of("top")
    mesh = mesh.with_part("plug", "top", (0, 0.5)).with_part("ring", "top", (0.5, 1.2)).with_part("in", "top", (0, 1.2))
    mesh = mesh.with_part("grip", "rim", (0.05, 1.0), along="z")
    assert np.array_equal(mesh.facets_of("top"), whole)
    assert np.array_equal(np.union1d(mesh.facets_of("plug"), mesh.facets_of("ring")), mesh.facets_of("in"))
    for name, ends in (("plug", (0, 0.5)), ("ring", (0.5, 1.2)), ("in", (0, 1.2)), ("top", (0, 2))):
        assert mesh.nodes_of(name)[[0, -1], 0] == pytest.approx(ends, abs=1e-12)
        assert np.ptp(mesh.line_of(name)[:, 0]) == pytest.approx(ends[1] - ends[0])
    assert mesh.nodes_of("grip")[:, 1] == pytest.approx([0.05, 0.075, 0.1])
    scene = fx.Scene(mesh=mesh, materials=fx.NeoHookean(c10=1.0), supports=[fx.Symmetry("axis"), fx.Clamped("grip")],
                     loads=[fx.Pressure("in")])
    solid = Solid(scene)
    areas = {name: solid.integral(solid.weight * solid.face(name, 2)[1]) for name in ("plug", "ring", "in", "top")}
    assert list(areas.values()) == pytest.approx([np.pi * (b**2 - a**2) for a, b in ((0, .5), (.5, 1.2), (0, 1.2),
                                                                                     (0, 2))], rel=1e-10)


@pytest.mark.thorough
def test_parts_on_two_ranks():
    script = ("import formingx as fx; m = fx.mesh.disc(radius=2.0, thickness=0.1, elements=(20, 1),"
              " concentrate={0.5: 0.2}).with_part('plug', 'top', (0, 0.5)); n = [len(m.nodes_of(k)) for k in"
              " ('plug', 'top')]; s = m.comm.allgather(n); import json; s[0] == s[-1] and m.comm.rank or"
              " print(json.dumps(n))")
    assert run_json(script, 2) == run_json(script, 1)


@pytest.mark.parametrize("suffix", ["msh", "txt"])
def test_a_part_is_written_and_read(tmp_path, suffix):
    mesh = fx.mesh.disc(radius=1.0, thickness=0.1, elements=(10, 1)).with_part("plug", "top", (0, 0.5))
    fx.mesh.write(mesh, tmp_path / f"part.{suffix}")
    again = fx.mesh.read(tmp_path / f"part.{suffix}")
    for name in ("plug", "top", "rim"):
        np.testing.assert_array_equal(again.nodes_of(name), mesh.nodes_of(name))
    assert set(again.facets_of("plug")) < set(again.facets_of("top"))


def test_opposite_points_of_a_wall():
    """Opposite points of concentric circles lie at the same angle; the undeformed thickness is exact."""
    mesh = fx.mesh.parison(inner_radius=1.0, thickness=0.3, length=4.0, elements=(30, 1), grading=2.0)
    scene = fx.Scene(mesh=mesh, materials=fx.NeoHookean(c10=1.0), loads=[fx.Pressure("inner")],
                     supports=[fx.Symmetry("axis"), fx.Clamped("neck")])
    profile = fx.trace(scene, until=fx.pressure(1e-3), progress=False).profile()
    assert profile.original_thickness == pytest.approx(0.3, rel=1e-6)
    np.testing.assert_allclose(profile.reference_top, mesh.line_of("outer"), atol=2e-4)
    assert profile.reference_length[-1] == pytest.approx(4.0 + np.pi / 2 * 1.15, rel=1e-3)


@pytest.mark.parametrize("make, words", [
    (lambda **a: fx.mesh.parison(inner_radius=1.0, length=2.0, **{"thickness": 0.1} | a), "parison"),
    (lambda **a: fx.mesh.disc(radius=1.0, **{"thickness": 0.1} | a), "disc"),
    (lambda **a: fx.mesh.sphere(inner_radius=1.0, **{"thickness": 0.1} | a), "sphere")])
@pytest.mark.parametrize("wrong", [
    {"grading": 5e-324}, {"grading": 1e300}, {"thickness": 1e300}, {"thickness": 1e-300}, {"thickness": "0.1"},
    {"elements": (10**9, 1)}, {"elements": (10, 10**300)}, {"elements": ("4", 2)}, {"elements": np.array(4)},
    {"elements": "42"}, {"elements": {4: 1, 2: 2}}, {"thickness": np.array([0.1])}, {"thickness": 1j},
    {"thickness": {"a": 0.1, 3: 0.2}}])
def test_extreme_sizes_are_refused(make, words, wrong):
    with pytest.raises(fx.InputError, match=words):
        make(**wrong)


def test_numbers_of_numpy_are_numbers():
    mesh = fx.mesh.disc(radius=np.array(1.0), thickness=np.float32(0.5), elements=np.array([2, 1]))
    assert mesh.nodes_of("rim")[-1].tolist() == [1.0, 0.5]


@pytest.mark.parametrize("thickness", [
    lambda R: 0.2 - 0.1 * R, {0: 0.2, 0.5: 0.15, 1.0: 0.1}, {"a": lambda R: 0.1 - 0.05 * R, "b": {0: 0.1, 1: 0.05}}])
def test_disc_of_varying_thickness(thickness):
    """All nodes of the top, mid-edge nodes too, lie on the profile; each layer may vary."""
    mesh = fx.mesh.disc(radius=1.0, thickness=thickness, elements=(5, 2))
    mesh.check()
    R, Z = mesh.nodes_of("top").T
    np.testing.assert_allclose(Z, 0.2 - 0.1 * R, rtol=1e-14)
    assert len(R) == 11
    assert np.all(mesh.nodes_of("bottom")[:, 1] == 0)
    scene = fx.Scene(mesh=mesh, materials=fx.NeoHookean(c10=1.0), loads=[fx.Pressure("bottom")],
                     supports=[fx.Symmetry("axis"), fx.Clamped("rim")])
    assert Solid(scene).volume == pytest.approx(2 * np.pi * (0.2 / 2 - 0.1 / 3), rel=1e-13)


def test_parison_of_programmed_wall():
    """Thickness is measured along the normal of the inner face, at the height of that face."""
    mesh = fx.mesh.parison(inner_radius=1.0, thickness={-1: 0.1, 0.0: 0.3, 2.0: 0.2}, length=2.0, elements=(12, 2))
    mesh.check()
    inner, outer = mesh.line_of("inner"), mesh.line_of("outer")
    centre = np.column_stack([np.zeros(len(inner)), np.maximum(inner[:, 1], 0)])
    assert np.hypot(*(inner - centre).T) == pytest.approx(1, rel=1e-14)
    assert np.hypot(*(outer - centre).T) == pytest.approx(1 + np.interp(inner[:, 1], [-1, 0, 2], [0.1, 0.3, 0.2]))
    np.testing.assert_array_equal(mesh.line_of("neck")[[0, -1]], [[1.0, 2.0], [1.2, 2.0]])


def test_text_of_meshes_and_scenes():
    mesh = fx.mesh.disc(radius=2.0, thickness={"a": 0.1, "b": 0.2}, elements=(6, 1))
    assert str(mesh) == """24 six-node triangles, R from 0 to 2, Z from 0 to 0.3
layers: a, b
boundaries: axis (2 edges), rim (2 edges), bottom (6 edges), top (6 edges)"""
    scene = fx.Scene(mesh=mesh, materials=fx.NeoHookean(c10=1.0), loads=[fx.Pressure("bottom")],
                     supports=[fx.Symmetry("axis"), fx.Clamped("rim")])
    lines = str(scene).splitlines()
    assert lines[0].startswith("mesh               24 six-node triangles, 2 by 0.3 (R, Z); layers: a, b; boundaries: ")
    assert {"material of b      NeoHookean(c10=1.0)", "load 1             Pressure('bottom') (driven)"} <= set(lines)


@pytest.mark.thorough
def test_a_mesh_prints_no_round_off():
    """The axis of a body that was meshed anew is at R = 0."""
    path = fx.trace(treloar((6, 1)), until=fx.pole_height(0.6), progress=False)
    for mesh in (path.deformed_mesh(), path.deformed_mesh(size=0.05)):
        assert "R from 0 to" in str(mesh)


def test_elements_of_layers_are_a_list_not_a_mapping():
    with pytest.raises(fx.InputError, match="a list with an entry for each layer, from the bottom up"):
        fx.mesh.disc(radius=10.0, thickness={"skin": 0.1, "core": 0.2}, elements=(10, {"skin": 1, "core": 2}))
