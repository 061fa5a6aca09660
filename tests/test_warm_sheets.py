"""Sheets in three dimensions whose constants, friction and solidified fraction follow the column's temperatures."""

import numpy as np
import pytest
from test_demos import summary
from test_files import drawn
from test_friction_in_space import formed_in_cup, pushed
from test_heat_columns import HELD, POLYMER, sheet

import formingx as fx
from formingx.extensions.space.heat.linear import is_linear

HEATER = fx.HeatFlux("top", flux=0.06, name="heater")
MODULUS = fx.table({20.0: 2.0, 50.0: 0.5, 100.0: 0.2, 200.0: 0.1})


def heated(material, size=8.0, **options):
    """Scene of a sheet of 1 mm that a heater above warms by 75 degrees from its bottom to its top face in 0.4 s."""
    heat = fx.Cooling(POLYMER, [HEATER], unit="C", tolerance=0.02)
    return fx.Scene(mesh=sheet(size), thickness=1.0, materials=material, temperature=20.0, heat=heat, supports=HELD,
                    loads=[fx.Pressure("bottom", name="air")], **options)


def blown(scene, heat=True, volume=4000.0):
    """Path of a sheet that is heated and then blown at once to a volume."""
    blow = fx.Stage("blow", control="air", until=fx.enclosed_volume(volume), inactive=["heater"] if heat else [])
    oven = [fx.Stage("oven", duration=0.4)] if heat else []
    return fx.Process(scene).run([*oven, blow], progress=False)


def column_of(path, state=None):
    """Temperatures of the column at the first node in a state, and its quadrature weights, both (m,)."""
    field = path.problem.temperature
    with path.problem.state_context(state or path.last):
        return field.now[0].copy(), field.basis.layers["sheet"].weights


def test_modulus_is_the_mean_over_the_column():
    """The pressure is that of a sheet with the mean modulus, not with the modulus at the mean temperature."""
    path = blown(heated(fx.NeoHookean(c10=MODULUS)))
    T, weights = column_of(path)
    assert T[-1] - T[0] > 50.0
    def pressure(c10):
        plain = fx.Scene(mesh=sheet(8.0), thickness=1.0, materials=fx.NeoHookean(c10=c10), supports=HELD,
                         loads=[fx.Pressure("bottom", name="air")])
        return blown(plain, heat=False)["pressure"][-1]
    assert path["pressure"][-1] == pytest.approx(pressure(float(weights @ MODULUS(T))), rel=1e-6)
    assert abs(path["pressure"][-1] / pressure(float(MODULUS(weights @ T))) - 1) > 0.02


def test_energies_that_are_linear_in_their_constants_are_found():
    assert is_linear(heated(fx.NeoHookean(c10=MODULUS)), "sheet")
    assert not is_linear(heated(fx.Gent(mu=0.5, Jm=fx.table({20.0: 1.5, 200.0: 20.0}))), "sheet")


@pytest.mark.thorough
def test_an_energy_that_is_not_linear_is_integrated_over_the_column():
    """A limiting stretch that depends on the temperature: the pressure is that of layers with a limit each."""
    limit = fx.table({20.0: 1.5, 200.0: 20.0})
    scene = heated(fx.Gent(mu=0.5, Jm=limit))
    path = blown(scene)
    T, weights = column_of(path)
    names = [f"layer {k}" for k in range(len(T))]
    layers = fx.Scene(mesh=sheet(8.0, layers=names), thickness=dict(zip(names, map(float, weights))), supports=HELD,
                      materials={name: fx.Gent(mu=0.5, Jm=float(limit(t))) for name, t in zip(names, T)},
                      loads=[fx.Pressure("bottom", name="air")])
    assert path["pressure"][-1] == pytest.approx(blown(layers, heat=False)["pressure"][-1], rel=1e-4)


def test_each_point_of_a_column_solidifies_at_its_temperature():
    """On a cold tool the lower half has set: the fraction at each point is phi of its temperature."""
    cold = fx.ContactWithTool("bottom", conductance=2e-3, tool=20.0)
    material = fx.Solidification(fx.NeoHookean(c10=0.1), modulus=50.0, between=(80.0, 100.0))
    scene = fx.Scene(mesh=sheet(), thickness=1.0, materials=material, temperature=150.0, supports=HELD,
                     heat=fx.Cooling(POLYMER, [cold], unit="C", tolerance=0.02),
                     loads=[fx.Pressure("bottom", name="air")])
    path = fx.Process(scene).run([fx.Stage("chill", duration=0.8), fx.Stage("more", duration=1e-6)], progress=False)
    T, _ = column_of(path)
    with path.problem.state_context(path.last) as problem:
        terms, = problem.forms.terms
        _, _, shapes = problem.temperature.basis.layers["sheet"].gauss(problem.forms.energy_depths)
        found = terms.internal["fraction"].x.array.reshape(-1, len(shapes))
    assert found[:, 0].min() == pytest.approx(1.0) and found[:, -1].max() < 0.01
    assert found == pytest.approx(np.broadcast_to(material.fraction(shapes @ T), found.shape), abs=0.01)


@pytest.mark.thorough
def test_relaxation_times_follow_the_depth():
    """A sheet that is hot above and cold below, at small strain: its pressure relaxes as the mean over the column.

    The mean is that of the five Gauss points through the sheet; that over the points of the column is within 1 %.
    """
    shift = fx.Arrhenius(150e3, 60.0, unit="C")
    scene = heated(fx.Viscoelastic(fx.NeoHookean(c10=0.1), [(1.0, 0.5)], shift=shift))
    volume = fx.enclosed_volume(400.0)
    path = fx.Process(scene).run([
        fx.Stage("oven", duration=0.4), fx.Stage("blow", control="air", until=volume, inactive=["heater"]),
        fx.Stage("wait", control="air", constant=volume, duration=0.05, inactive=["heater"])], progress=False)
    states = [state for state in path.states if state.stage == "wait"]
    weights, times = column_of(path)[1], np.array([state.time for state in states])
    T = np.array([column_of(path, state)[0] for state in states])
    _, gauss, shapes = path.problem.temperature.basis.layers["sheet"].gauss(path.problem.forms.energy_depths)
    ratio = path["pressure"][-1] / path.state("blow").measures["pressure"]
    for there, share, error in ((T @ shapes.T, gauss, 2e-3), (T, weights, 1e-2)):
        left = np.exp(-np.trapezoid(1 / (0.5 * shift(there)), times, axis=0))
        assert ratio == pytest.approx(share @ (0.2 + left) / 1.2, rel=error)
    at_mean = np.exp(-0.05 / (0.5 * shift(weights @ column_of(path)[0])))
    assert (0.2 + at_mean) / 1.2 > 1.03 * ratio


def test_friction_has_the_temperature_of_the_touching_face():
    """Under a cold plug: the coefficient at each node is that of the top face, which the plug has chilled."""
    friction = fx.table({20.0: 0.1, 150.0: 0.5})
    heat = fx.Cooling(POLYMER, unit="C", tools={"plug": (2e-3, 20.0)})
    plug = fx.tools.revolved(fx.tools.sphere(radius=8.0, z=0.0))
    scene = fx.Scene(mesh=sheet(5.0), thickness=1.0, materials=fx.NeoHookean(c10=0.1), temperature=150.0, heat=heat,
                     supports=HELD, contacts=[fx.Contact("top", plug, friction, direction=(0, 0, -1), name="plug")])
    path = fx.Process(scene).run([fx.Stage("push", control="plug", until=fx.travel(5.0), speed=20.0)], progress=False,
                                 accuracy="draft")
    contact, = path.problem.contacts
    with path.problem.state_context(path.last) as problem:
        T, mu = problem.temperature.now[:, -1], contact.law.mu
        touching = contact.touching(problem.x.array_r, problem.control)
    assert mu == pytest.approx(friction(np.clip(T, 20.0, 150.0)), rel=1e-12)
    away = np.hypot(*contact.points[:, :2].T) > 12.0
    assert touching.any() and mu[touching].min() < 0.4 and mu[away] == pytest.approx(np.full(away.sum(), 0.5))


@pytest.mark.parametrize("make, until, entry, share", [
    (lambda: pushed(0.3, 0.15), fx.travel(0.7), "friction", 0.03),
    (lambda: pushed("stick", 0.15), fx.travel(0.7), "bonds", 0.0),
    (lambda: formed_in_cup(0.3, 0.15)[0], fx.pressure(0.06), "friction", 0.0)], ids=["ball", "stick", "cup"])
def test_energy_balance_of_sheets(make, until, entry, share):
    """Plug with and without friction, and a cup: the balance closes to 0.5 %, and friction has a share in it."""
    path = fx.trace(make(), until=until, progress=False)
    work = path.work()
    size = max(np.abs(values).max() for values in work.values())
    assert entry in work and np.abs(work["unbalanced"]).max() < 5e-3 * size
    assert work[entry][-1] >= share * size or not share


@pytest.mark.thorough
def test_energy_balance_with_heat_and_relaxation():
    """A sheet that relaxes, cools on a mould and is pushed by a plug with friction: the balance closes to 1 %."""
    material = fx.Viscoelastic(fx.NeoHookean(c10=MODULUS), [(0.3, 0.2)], shift=fx.Arrhenius(60e3, 130.0, unit="C"))
    heat = fx.Cooling(POLYMER, [fx.Convection("top", h=1e-4, air=20.0)], unit="C", tools={"plug": (1e-3, 40.0)})
    plug = fx.tools.revolved(fx.tools.sphere(radius=8.0, z=0.0))
    scene = fx.Scene(mesh=sheet(4.0), thickness=1.0, materials=material, temperature=130.0, heat=heat, supports=HELD,
                     contacts=[fx.Contact("top", plug, 0.3, direction=(0, 0, -1), name="plug")])
    path = fx.Process(scene).run([fx.Stage("push", control="plug", until=fx.travel(8.0), speed=20.0),
                                  fx.Stage("wait", duration=0.5)], progress=False)
    work = path.work()
    size = max(np.abs(values).max() for values in work.values())
    assert np.abs(work["unbalanced"]).max() < 1e-2 * size
    assert min(work["friction"][-1], work["dissipated_energy"][-1], work["heat"][-1]) > 0.01 * size


@pytest.mark.thorough
def test_warm_tray_quick(tmp_path):
    """The demo ends; both faces differ, the tray's base is thicker than its corner, and it sets within the hold."""
    found = summary("warm_tray", tmp_path, "--quick")
    assert found["faces_differ_C"] > 20.0
    assert found["corner_wall_mm"]["all"] < found["base_wall_mm"]["all"] < 1.5
    assert 1.0 < found["time_to_demould_s"] < 10.0


@pytest.mark.slow
def test_warm_tray_and_disc(tmp_path):
    """A disc against the solid: faces within 1 % of sheet minus mould temperature, walls within 1.5 %, force 5 %."""
    found = summary("warm_tray", tmp_path, timeout=1500)
    disc = found["disc"]
    for face in ("bottom", "top"):
        off = disc["face_temperature_C"]["3d"][face] - disc["face_temperature_C"]["section"][face]
        assert abs(off) < 0.01 * (130.0 - 20.0)
    for place, ratio in disc["wall_ratio"]["section"].items():
        assert disc["wall_ratio"]["3d"][place] == pytest.approx(ratio, rel=0.015)
    assert disc["plug_force_N"]["3d"] == pytest.approx(disc["plug_force_N"]["section"], rel=0.05)
    assert found["faces_differ_C"] > 20.0


def test_stresses_of_a_blister_and_of_a_column(tmp_path):
    """Neo-Hookean stresses in closed form; the mean of those at the depths of a column; a field in VTK and pictures."""
    path = blown(heated(fx.NeoHookean(c10=MODULUS), size=12.0))
    T, weights = column_of(path)
    basis, l = path.problem.temperature.basis, path.wall().stretches
    across = 1 / l.prod(1) ** 2
    mean, bottom = path.stress(), path.stress(depth=0.0)
    assert bottom.principal == pytest.approx(2 * MODULUS(T[0]) * (l**2 - across[:, None]), rel=2e-3)
    through = sum(w * path.stress(depth=depth).principal for w, depth in zip(weights, basis.depths))
    assert mean.principal == pytest.approx(through, rel=1e-9)
    assert mean.resultants == pytest.approx(mean.principal * path.wall().wall[:, None])
    assert np.einsum("mki,mji->mkj", mean.directions, mean.directions) == pytest.approx(
        np.broadcast_to(np.eye(2), (len(l), 2, 2)), abs=1e-12)
    edges = path.wall().deformed_points[path.wall().triangles]
    normal = np.cross(edges[:, 1] - edges[:, 0], edges[:, 2] - edges[:, 0])
    assert np.abs(np.einsum("mki,mi->mk", mean.directions, normal)).max() < 1e-9 * np.abs(normal).max()
    path.to_vtk(tmp_path / "sheet.pvd")
    text = (tmp_path / f"sheet-{len(path) - 1}.vtu").read_text(errors="replace")
    assert "principal_stresses" in text and "temperature_top" in text
    with pytest.raises(fx.InputError, match="must be from 0, the bottom face"):
        path.stress(depth=-0.1)
    with pytest.raises(fx.InputError, match="these are the stresses at the depth 0"):
        _ = bottom.resultants


def test_stresses_of_an_energy_by_depth():
    """Layers of Gent materials of other limits: the stress at a depth is that of the limit there."""
    limit = fx.table({20.0: 1.5, 200.0: 20.0})
    path = blown(heated(fx.Gent(mu=0.5, Jm=limit), size=12.0))
    T, _ = column_of(path)
    l = path.wall().stretches
    squared, across = l**2, 1 / l.prod(1)[:, None] ** 2
    J = float(limit(T[-1]))
    wanted = 0.5 * J / (J - (squared.sum(1) + across[:, 0] - 3))[:, None] * (squared - across)
    assert path.stress(depth=1.0).principal == pytest.approx(wanted, rel=1e-6)


@pytest.mark.thorough
def test_an_animation_and_a_picture_of_stresses(tmp_path):
    """Frames of a sheet with its plug, all of one size; a picture coloured by stress; the report has both fields."""
    from PIL import Image
    path = fx.trace(pushed(0.3, 0.3), until=fx.travel(0.5), progress=False)
    path.animate(tmp_path / "run.gif", frames=3, seconds=1.0)
    with Image.open(tmp_path / "run.gif") as picture:
        frames = [np.asarray(picture.convert("RGB")) for k in range(picture.n_frames) if picture.seek(k) is None]
    assert len(frames) == 3 and not np.array_equal(frames[0], frames[2])
    path.stress().view(tmp_path / "stress.png")
    with Image.open(tmp_path / "stress.png") as picture:
        assert len(np.unique(np.asarray(picture.convert("RGB")).reshape(-1, 3), axis=0)) > 20
    shown = drawn(path.report(tmp_path / "report.html"))
    assert list(shown["runs"][0]["mesh"]["fields"]) == ["wall", "wall / original", "larger stress"]


@pytest.mark.thorough
@pytest.mark.parametrize("material", [
    fx.Viscoelastic(fx.NeoHookean(c10=MODULUS), [(0.3, 0.1)], shift=fx.Arrhenius(80e3, 60.0, unit="C")),
    fx.KBKZ([(0.5, 0.05), (0.2, 2.0)], damping=fx.PSM(alpha=14.4, beta=0.05), shift=fx.Arrhenius(80e3, 60.0, unit="C")),
    fx.Solidification(fx.NeoHookean(c10=MODULUS), modulus=5.0, between=(50.0, 90.0))],
    ids=["viscoelastic", "K-BKZ", "solidification"])
def test_an_insulated_sheet_of_one_temperature_is_one_without_heat(material):
    """Energies and histories at several depths: with one temperature they give the volume of a run without columns."""
    volumes = []
    for heat in (fx.Cooling(POLYMER, unit="C"), None):
        scene = fx.Scene(mesh=sheet(12.0), thickness=1.0, materials=material, temperature=70.0, heat=heat,
                         supports=HELD, loads=[fx.Pressure("bottom", name="air")])
        path = fx.Process(scene).run([fx.Stage("blow", control="air", until=fx.pressure(0.01), duration=0.2),
                                      fx.Stage("hold", duration=0.1)], progress=False, accuracy="draft")
        volumes.append(path["enclosed_volume"][-1])
    assert volumes[0] > 100.0 and volumes[0] == pytest.approx(volumes[1], rel=1e-4)
