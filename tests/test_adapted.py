"""Meshes adapted to a first run (`mesh.adapted`, `trace(adapt_mesh=)`)."""

import shutil

import numpy as np
import pytest

import formingx as fx
from formingx.extensions.adapt.column_factors import column_factors
from formingx.extensions.adapt.sizes import rounded

PLUG = fx.tools.male(radius=3.0, height=60.0, base=-60.0, fillet=0.5).mirrored().moved(z=0.5)


def plugged(mesh, **options):
    """A sheet under a plug, pushed 3 lengths."""
    scene = fx.Scene(mesh=mesh, materials=fx.NeoHookean(c10=1.0), supports=[fx.Symmetry("axis"), fx.Clamped("rim")],
                     contacts=[fx.Contact("top", PLUG, direction=(0, -1))])
    return fx.trace(scene, until=fx.travel(3.0), progress=False, **options)


def disc(elements, **options):
    return fx.mesh.disc(radius=10.0, thickness=0.5, elements=elements, **options)


def inflated(elements, **options):
    scene = fx.Scene(mesh=disc(elements), materials=fx.NeoHookean(c10=1.0), loads=[fx.Pressure("bottom")],
                     supports=[fx.Symmetry("axis"), fx.SimplySupported("rim")])
    return fx.trace(scene, until=fx.pole_height(6.0), progress=False, **options)


def cut(folder, number):
    """Leave the states before `number` in a checkpoint, as if the run had been killed."""
    for state in [entry for entry in folder.iterdir() if entry.name.isdigit() and int(entry.name) >= number]:
        shutil.rmtree(state)
    (folder / "end.json").unlink(missing_ok=True)


@pytest.mark.parametrize("pilot", (False, True))
def test_a_killed_run_on_an_adapted_mesh_is_resumed(pilot, tmp_path):
    """Killed in the pilot run or in the second run: it has the states of a run that was not killed."""
    options = {"adapt_mesh": {"max_rotation": None, "error": 0.01}, "checkpoint": tmp_path / "run"}
    whole = inflated((6, 1), **options)
    pressures = whole["pressure"].copy(), whole.pilot["pressure"].copy()
    assert len(pressures[0]) > 4 and len(pressures[1]) > 4
    if pilot:
        cut(tmp_path / "run" / "pilot", 3)
        cut(tmp_path / "run", 0)
        (tmp_path / "run" / "scene.json").unlink()
    else:
        cut(tmp_path / "run", 3)
    again = inflated((6, 1), **options, resume=True)
    assert again["pressure"] == pytest.approx(pressures[0], rel=1e-9)
    assert again.pilot["pressure"] == pytest.approx(pressures[1], rel=1e-9)


def test_columns_of_a_pilot_run_resolve_the_plug_edge():
    """The run on adapted columns: they fit the edge, others stay long; the force is that of a finer mesh."""
    path = plugged(disc((20, 1)), adapt_mesh={"max_rotation": 0.5})
    ends = path.problem.scene.mesh.columns.ends
    sizes = np.diff(ends)
    assert path.pilot is not None and len(path.pilot.problem.scene.mesh.columns.ends) == 21
    assert 20 < len(sizes) < 45 and sizes.max() == pytest.approx(0.5, rel=0.15)
    assert 2.4 < ends[np.argmin(sizes)] < 4.0 and sizes.min() < 0.3
    assert np.all(sizes[1:] / sizes[:-1] < 1.4) and np.all(sizes[:-1] / sizes[1:] < 1.4)
    shortest = np.diff(fx.mesh.adapted(path.pilot, max_rotation=1e-4).columns.ends).min()
    assert 0.5 / 8 / 1.2 < shortest < 0.5 / 8 * 1.01
    fine = plugged(disc((100, 1))).last.measures["tool_force"]
    pilot = path.pilot.last.measures["tool_force"]
    assert abs(path.last.measures["tool_force"] / fine - 1) < max(2e-3, 0.5 * abs(pilot / fine - 1))


def test_adapted_columns_meet_the_requested_stress_error():
    """Columns that share the error: fewer than uniform ones of the same error, which is near what was asked for."""
    def inflated(mesh):
        scene = fx.Scene(mesh=mesh, materials=fx.NeoHookean(c10=1.0), loads=[fx.Pressure("bottom")],
                         supports=[fx.Symmetry("axis"), fx.SimplySupported("rim")])
        return fx.trace(scene, until=fx.pole_height(6.0), progress=False)
    pilot = inflated(disc((8, 4)))
    first = pilot.stress().error().relative
    mesh = fx.mesh.adapted(pilot, max_rotation=None, error=first / 3)
    columns = len(mesh.columns.ends) - 1
    found, uniform = (inflated(m).stress().error().relative for m in (mesh, disc((columns, 4))))
    assert found < min(first / 2, uniform) and columns < 24


def test_adapted_meshes_keep_volume_names_and_interfaces():
    """Every builder's mesh made again: the same volume, names and interfaces; ends that must stay do."""
    layers = {"core": {0.0: 0.4, 10.0: 0.2}, "skin": 0.1}
    line = [(0, 0), (20, 0), (30, 40)]
    meshes = [fx.mesh.disc(radius=10.0, thickness=layers, elements=(9, (1, 2)), concentrate={4.0: 0.5}).with_part(
                  "plug", "bottom", (0, 4.0)),
              fx.mesh.sphere(inner_radius=1.0, thickness=0.2, elements=(8, 2)),
              fx.mesh.parison(inner_radius=1.0, thickness=0.2, length=5.0, elements=(12, 2)),
              fx.mesh.from_lines(line, [(0, -2), (21, -2), (32, 40)], elements=([4, 6], 2)),
              fx.mesh.from_lines(line[::-1], [(32, 40), (21, -2), (0, -2)], elements=([6, 4], 2))]
    for mesh in meshes:
        ends = mesh.columns.ends
        fine = mesh.columns.make(np.unique(np.concatenate([ends, (ends[1:] + ends[:-1]) / 2])))
        assert list(fine.boundaries) == list(mesh.boundaries) and list(fine.layers) == list(mesh.layers)
        for name in mesh.boundaries:
            a, b = mesh.nodes_of(name), fine.nodes_of(name)
            assert len(b) >= len(a)
            away = np.linalg.norm(a[:, None] - b[None], axis=2).min(1)
            assert away.max() < 1e-12 * np.abs(a).max()
        assert len(fine.columns.ends) == 2 * len(ends) - 1
        assert set(mesh.columns.fixed) <= set(ends)


def test_force_of_a_block_compressed_to_a_twentieth_is_exact():
    """A block 20 times flatter: the force is exact to 1e-3 where the penalty of the block at rest is off by 1e-2."""
    def pressed(**options):
        block = fx.mesh.disc(radius=1.0, thickness=1.0, elements=(2, 2))
        scene = fx.Scene(mesh=block, materials=fx.NeoHookean(c10=1.0),
                         supports=[fx.Symmetry("axis"), fx.Symmetry("bottom", normal="z")],
                         contacts=[fx.Contact("top", fx.tools.plane(1.0), "none", direction=(0, -1), **options)])
        return fx.trace(scene, until=fx.travel(0.95), progress=False, allow_inadmissible=True)
    exact = 2 * np.pi * (400 - 1 / 20)
    path = pressed(present_area=True)
    assert path.last.measures["tool_force"] == pytest.approx(exact, rel=1e-3)
    assert path["penetration"][-1] < 1e-3 * 0.05 and path.problem.symmetric
    assert abs(pressed().last.measures["tool_force"] / exact - 1) > 1e-2
    assert path.value("tool_force", path.states[-2]) == pytest.approx(path.states[-2].measures["tool_force"], rel=1e-12)


def test_sizes_of_triangles_do_not_depend_on_round_off():
    """Two computers, or one that rounds otherwise, make the same mesh: another has other walls by a percent."""
    sizes = np.random.default_rng(0).uniform(0.5, 20.0, 2000)
    found = rounded(sizes)
    assert found == pytest.approx(sizes, rel=5e-3) and len(np.unique(found)) > 200
    assert np.array_equal(rounded(found * (1 + 1e-10)), found) and np.array_equal(rounded(found * (1 - 1e-10)), found)


def test_wrong_arguments_of_adapted_are_refused():
    mesh = disc((4, 1))
    with pytest.raises(fx.InputError, match="adapted: max_rotation = 0"):
        fx.mesh.adapted(None, max_rotation=0)
    with pytest.raises(fx.InputError, match="must be what trace or Process.run gave back"):
        fx.mesh.adapted(None)
    with pytest.raises(fx.InputError, match="adapt_mesh 'sizes'"):
        plugged(mesh, adapt_mesh={"sizes": 1})
    with pytest.raises(fx.InputError, match="adapt_mesh = 3"):
        plugged(mesh, adapt_mesh=3)
    with pytest.raises(fx.InputError, match="adapt_mesh=True: a pilot run begins with the unloaded body"):
        plugged(mesh, adapt_mesh=True, start=inflated((4, 1)))
    mesh.domain.geometry.x[:, 1] *= 0.99
    with pytest.raises(fx.InputError, match="were moved"):
        plugged(mesh, adapt_mesh=True)
    with pytest.raises(fx.InputError, match="present_area"):
        fx.Contact("top", PLUG, 0.3, present_area=True)


def test_column_factors_need_a_mesh_with_columns(tmp_path):
    fx.mesh.write(disc((4, 1)), tmp_path / "sheet.msh")
    scene = fx.Scene(mesh=fx.mesh.read(tmp_path / "sheet.msh"), materials=fx.NeoHookean(c10=1.0),
                     loads=[fx.Pressure("bottom")], supports=[fx.Symmetry("axis"), fx.SimplySupported("rim")])
    path = fx.trace(scene, until=fx.pole_height(0.1), progress=False)
    with pytest.raises(fx.InputError, match="column_factors: the mesh has no columns"):
        column_factors(path, 0.3, None)
