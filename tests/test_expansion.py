"""Thermal expansion: free and restrained cooling, strips of two layers, shrinkage of parts out of their mould."""

import re

import numpy as np
import pytest
from test_temperature import SHEET

import formingx as fx
from formingx.problem.problem import Problem

C10, HOT = 1.0, 150.0
SHRINKS = fx.ThermalExpansion(linear=7e-4, stress_free=HOT)


def stand(scene):
    """The state of equilibrium at the scene's temperature."""
    return fx.Process(scene).run([fx.Stage("stand", duration=1.0)], progress=False)


def disc(temperature, supports=(), model=None, material=None, **more):
    body = fx.mesh.disc(radius=1.0, thickness=0.2, elements=(6, 2))
    supports = [fx.Symmetry("axis"), *(supports or [fx.PinnedNode(0.0, 0.0)])]
    return fx.Scene(mesh=body, materials=material or fx.NeoHookean(c10=C10), temperature=temperature,
                    supports=supports, model=model, **({"expansion": SHRINKS} | more))


@pytest.mark.parametrize("space", ["P0", "P1", "P1dg"])
@pytest.mark.parametrize("law", [SHRINKS, fx.ThermalExpansion(
    specific_volume=fx.table({20: 0.95, 100: 0.98, 150: 1.02}), stress_free=HOT)], ids=["linear", "volume"])
def test_a_free_sheet_that_cools_shrinks_without_stress(law, space):
    """J = J_T everywhere, alike in all directions."""
    path = stand(disc(20.0, model=fx.MixedPressure(space=space), expansion=law))
    stretch = law.stretch(20.0)
    assert law.volume_ratio(20.0) == pytest.approx((1 - 7e-4 * 130) ** 3 if law is SHRINKS else 0.95 / 1.02)
    stress = path.stress().at_quadrature_points()
    assert stress.deformation_gradient == pytest.approx(np.broadcast_to(stretch * np.eye(3), (
        len(stress.points), 3, 3)), abs=1e-10)
    assert np.abs(stress.cauchy).max() < 1e-9 * C10
    assert abs(path.last.measures["mass_error"]) < 1e-10 and path.last.measures["volume_error"] < 1e-10


@pytest.mark.thorough
def test_a_free_sheet_that_cools_in_time_shrinks_as_it_cools():
    """Faces held at 20 C: when heat has gone, J = J_T(20), and a relaxing material has no stress either."""
    material = fx.Viscoelastic(fx.NeoHookean(c10=1.0), [(1.0, 5.0)])
    body = fx.mesh.disc(radius=4e-3, thickness=1e-3, elements=(3, 2))
    held = [fx.FixedTemperature(face, temperature=20.0) for face in ("top", "bottom")]
    scene = fx.Scene(mesh=body, materials=material, temperature=HOT, expansion=SHRINKS,
                     heat=fx.Cooling(SHEET, held, unit="C", tolerance=0.1),
                     supports=[fx.Symmetry("axis"), fx.PinnedNode(0.0, 0.0)])
    path = fx.Process(scene).run([fx.Stage("cool", duration=120.0)], progress=False, accuracy="draft")
    F = path.stress().at_quadrature_points()
    assert F.deformation_gradient == pytest.approx(np.broadcast_to(SHRINKS.stretch(20.0) * np.eye(3), (
        len(F.points), 3, 3)), abs=2e-4)
    assert np.abs(F.cauchy).max() < 2e-3
    between = path.stress(path.states[len(path.states) // 3]).at_quadrature_points()
    assert np.abs(between.cauchy).max() > 10 * np.abs(F.cauchy).max()      # skin and core shrink one after the other


def test_restrained_cooling_against_the_closed_form():
    """Held in the plane, free across: F = diag(1, J_T, 1), so sigma_rr = 2 c10 (j^-2 - j^4)/j^3, j^3 = J_T."""
    path = stand(disc(20.0, [fx.Symmetry("rim"), fx.Symmetry("bottom", normal="z")]))
    j, found = SHRINKS.stretch(20.0), path.stress().at_quadrature_points()
    exact = 2 * C10 * (j**-2 - j**4) / j**3
    assert found.cauchy[:, 0, 0] == pytest.approx(exact, rel=1e-8)
    assert found.cauchy[:, 2, 2] == pytest.approx(exact, rel=1e-8)
    assert np.abs(found.cauchy[:, 1, 1]).max() < 1e-8 * exact and exact > 0
    assert found.deformation_gradient[:, 1, 1] == pytest.approx(j**3, rel=1e-9)
    small = stand(disc(149.0, [fx.Symmetry("rim"), fx.Symmetry("bottom", normal="z")])).stress()
    assert small.at_quadrature_points().cauchy[:, 0, 0] == pytest.approx(      # E a dT/(1 - nu), E = 6 c10, nu = 1/2
        6 * C10 * 7e-4 / 0.5, rel=5e-3)


def test_a_released_part_shrinks_to_its_free_size():
    """Held while it cools, then let go at 20 C: residual stress first, then none, and the rim at j R."""
    scene = disc(20.0, [fx.PinnedNode(0.0, 0.0), grip := fx.Symmetry("rim")])
    path = fx.Process(scene).run([fx.Stage("held", duration=1.0), fx.Stage("free", inactive=[grip])], progress=False)
    held, free = (path.profile([s for s in path.states if s.stage == name][-1]) for name in ("held", "free"))
    assert held.top[-1, 0] == pytest.approx(1.0, abs=1e-9)
    assert free.top[-1, 0] == pytest.approx(SHRINKS.stretch(20.0), rel=1e-7)
    assert np.abs(path.stress().at_quadrature_points().cauchy).max() < 1e-6 * C10


def drawn_and_let_go(branches):
    """(stretch of a sheet when its rim is let go, having been drawn hot by 1.5 and chilled to 20 C; the path)."""
    sheet = fx.Viscoelastic(fx.NeoHookean(c10=1.0), branches, shift=fx.Arrhenius(250e3, HOT, unit="C"))
    body = fx.mesh.disc(radius=4e-3, thickness=1e-3, elements=(3, 1))
    cold = [fx.Convection(face, h=2000.0, air=20.0) for face in ("top", "bottom")]
    grip = fx.PrescribedDisplacement("rim", "r", name="grip")
    scene = fx.Scene(mesh=body, materials=sheet, temperature=HOT, expansion=SHRINKS,
                     heat=fx.Cooling(SHEET, cold, unit="C", tolerance=1.0),
                     supports=[fx.Symmetry("axis"), fx.Symmetry("bottom", normal="z"), grip])
    draw = fx.Stage("draw", control="grip", until=fx.travel(2e-3))
    path = fx.Process(scene).run([draw, fx.Stage("chill", duration=15.0), fx.Stage("let go", inactive=["grip"])],
                                 progress=False, accuracy="draft")
    return path.profile().top[-1, 0] / 4e-3, path


@pytest.mark.thorough
def test_a_solidified_part_keeps_its_shape_and_shrinks():
    """A branch that is glassy when cold (200 times as stiff) and has no time when hot freezes a sheet as it is drawn.

    Let go, it springs back by the small strain at which the frozen branch bears what the rubber pulls with, and by
    what it shrinks below the temperature at which it froze; the rubber alone goes back to where it began, less J_T.
    """
    set_stretch, path = drawn_and_let_go([(200.0, 1e-4)])
    rubber, _ = drawn_and_let_go([(1e-6, 1e-4)])
    free = float(SHRINKS.stretch(20.0))
    assert rubber == pytest.approx(free, rel=2e-3)
    assert 1.5 * free < set_stretch < 1.5
    in_grip = [s for s in path.states if s.stage == "chill"][-1]
    residual = path.stress(in_grip).at_quadrature_points().cauchy[:, 0, 0]
    assert residual.min() > 1.0                                # in the grip it pulls, let go it does not on the whole
    gone = path.stress().at_quadrature_points()
    weights = gone.points[:, 0]
    assert abs(np.average(gone.cauchy[:, 0, 0], weights=weights)) < 0.05 * residual.mean()


@pytest.mark.parametrize("heights, moduli", [((0.5, 0.5), (1.0, 1.0)), ((0.3, 0.7), (3.0, 0.5))])
def test_a_strip_of_two_layers_warps_as_timoshenko_says(heights, moduli):
    """Timoshenko, J. Opt. Soc. Am. 11 (1925) 233, eq. (4); in plane strain E/(1 - nu^2) and (1 + nu) times expansion.

    With nu = 1/2 and E = 6 c10 these are 8 c10 and 3/2.
    """
    expansions, cooling, length = (1e-4, 3e-4), 1.0, 20.0
    body = fx.mesh.disc(radius=length, thickness={"lower": heights[0], "upper": heights[1]}, elements=(40, (2, 2)))
    scene = fx.Scene(mesh=body, kinematics=fx.PlaneStrain(), temperature=HOT - cooling,
                     materials={name: fx.NeoHookean(c10=mu) for name, mu in zip(("lower", "upper"), moduli)},
                     expansion={name: fx.ThermalExpansion(linear=a, stress_free=HOT)
                                for name, a in zip(("lower", "upper"), expansions)},
                     supports=[fx.Symmetry("axis"), fx.PinnedNode(0.0, 0.0)])
    profile = stand(scene).profile()
    middle = profile.reference_bottom[:, 0] < length / 2
    r, z = profile.bottom[middle].T
    curvature = 2 * np.polyfit(r**2, z, 1)[0]
    m, n = heights[0] / heights[1], moduli[0] / moduli[1]
    strain = 1.5 * (expansions[1] - expansions[0]) * cooling
    exact = 6 * strain * (1 + m) ** 2 / (sum(heights) * (3 * (1 + m) ** 2 + (1 + m * n) * (m**2 + 1 / (m * n))))
    assert curvature == pytest.approx(exact, rel=2e-3)          # the upper shrinks more: the ends go up


def test_scenes_without_expansion_have_no_expansion_field():
    """A body at its stress-free temperature does not move; without expansion no field is made."""
    scene = disc(HOT, loads=[fx.Pressure("bottom")])
    plain = disc(HOT, loads=[fx.Pressure("bottom")], expansion=None)
    a, b = (fx.trace(s, until=fx.pressure(0.05), progress=False) for s in (scene, plain))
    assert a["pole_height"] == pytest.approx(b["pole_height"], rel=1e-9)
    assert Problem(plain).forms.elastic_F is not None and Problem(plain).forms._free is None


@pytest.mark.parametrize("law, words", [
    (fx.ThermalExpansion(linear=2e-4, stress_free=HOT), None),
    (fx.ThermalExpansion(specific_volume=fx.table({20: 0.8, 150: 1.0}), stress_free=HOT), None),
    (fx.ThermalExpansion(specific_volume=fx.table({20: 0.95, 150: 1.02e-3}), stress_free=HOT),      # cm3/g and m3/kg
     "from 150 to 20 degrees its lengths change by a factor of 9.77: .* volumes in one unit"),
    (fx.ThermalExpansion(linear=2e-3, stress_free=HOT), "change by a factor of 0.74")])
def test_implausible_changes_of_length_are_found(law, words):
    found = str(fx.check(disc(20.0, expansion=law, loads=[fx.Pressure("bottom")])))
    assert re.search(words or "no fault was found", found), found


@pytest.mark.parametrize("make, words", [
    (lambda: fx.ThermalExpansion(stress_free=20), "give linear"),
    (lambda: fx.ThermalExpansion(linear=70, stress_free=20), "must be at most 0.01: polymers .* in 1e-6/K is 7e-05"),
    (lambda: fx.ThermalExpansion(linear=-0.011, stress_free=20), "must be at most 0.01"),
    (lambda: fx.ThermalExpansion(linear=1e-4, specific_volume=fx.table({0: 1, 1: 2}), stress_free=20), "give linear"),
    (lambda: fx.ThermalExpansion(specific_volume=1.02, stress_free=20), r"must be table\(\{T: v"),
    (lambda: fx.ThermalExpansion(specific_volume=fx.table({30: 1, 50: 2}), stress_free=20), "must be from 30 to 50"),
    (lambda: disc(None), "give Scene a temperature"),
    (lambda: disc(20.0, expansion=7e-5), r"must be ThermalExpansion\(\.\.\.\)"),
    (lambda: disc(20.0, expansion={"skin": SHRINKS}), "layer 'skin' is not known"),
    (lambda: disc(-2000.0), "stress-free stretch is -0.505"),
    (lambda: disc(20.0, [fx.SimplySupported("rim")], model=fx.Membrane()), "a membrane keeps its volume"),
    (lambda: disc(20.0, model=fx.DisplacementPenalty()), "use MixedPressure"),
])
def test_wrong_expansions_are_refused(make, words):
    with pytest.raises(fx.InputError, match=words):
        make()
