"""Exact solutions: homogeneous tension, the thick tube, membrane theory."""

import numpy as np
import pytest

import formingx as fx
from formingx.exact.inflation import membrane_inflation, membrane_limit_point


def cylinder(material, model=None):
    """A block pulled along Z, free to contract: uniaxial tension."""
    mesh = fx.mesh.disc(radius=1.0, thickness=2.0, elements=(3, 3))
    return fx.Scene(mesh=mesh, materials=material, model=model,
                    supports=[fx.Symmetry("axis"), fx.Symmetry("bottom", normal="z", guide=True),
                              fx.PrescribedDisplacement("top", "z")])


@pytest.mark.quick
@pytest.mark.parametrize("stretch", [0.4, 3.0])
@pytest.mark.parametrize("material, energy", [
    (fx.NeoHookean(c10=2.0), lambda s: 2.0 * (s**2 + 2 / s - 3)),
    (fx.MooneyRivlin(c10=1.0, c01=0.5), lambda s: s**2 + 2 / s - 3 + 0.5 * (2 * s + s**-2 - 3)),
    (fx.Ogden(mu=(1.0, -0.2), alpha=(3.0, -1.5)),
     lambda s: (s**3 + 2 * s**-1.5 - 3) / 3 + 0.2 / 1.5 * (s**-1.5 + 2 * s**0.75 - 3)),
])
def test_uniaxial_tension_and_compression(material, energy, stretch):
    """The energy of the homogeneous state, the force on the support that is driven, and a volume that stays."""
    path = fx.trace(cylinder(material), until=fx.travel(2.0 * (stretch - 1)))
    volume = np.pi * 2.0
    assert path.last.measures["strain_energy"] == pytest.approx(energy(stretch) * volume, rel=1e-9)
    assert path.last.measures["volume_error"] < 1e-9
    pulls_back = -np.pi * material.stress("uniaxial", stretch)
    assert path.last.measures["support_force"] == pytest.approx(pulls_back, rel=1e-8)
    assert path.problem.symmetric


@pytest.mark.parametrize("eps", [1e-2, 1e-4])
def test_both_forms_of_the_penalty_agree(eps):
    """Displacement-only and pressure-carrying penalty have the same solution for small volume change."""
    energies = [fx.trace(cylinder(fx.NeoHookean(c10=2.0), keeping), until=fx.travel(2.0)).last.measures
                for keeping in (fx.MixedPressure(eps=eps), fx.DisplacementPenalty(eps=eps))]
    assert energies[0]["volume_error"] == pytest.approx(energies[1]["volume_error"], rel=5 * eps**0.5)
    assert energies[0]["volume_error"] > 0.01 * eps


@pytest.mark.thorough
def test_unloaded_body_of_the_printed_penalty_is_not_free_of_stress():
    """(3.4.1) as printed rests at I3 = 1 - eps (c10 + 2 c01)/(2 mu): shrunk."""
    given = cylinder(fx.NeoHookean(c10=2.0), fx.DisplacementPenalty(eps=1e-2, stress_free=False))
    scene = fx.Scene(mesh=given.mesh, materials=given.materials, model=given.model,
                     supports=given.supports[:2], loads=[fx.Pressure("rim")])
    path = fx.solve(scene, to=1e-9)
    assert path.last.measures["mass_error"] == pytest.approx(-1e-2 * 2.0 / 4.0 / 4, rel=0.02)


@pytest.mark.parametrize("space", ["P1dg", "P1"])
def test_path_starts_in_equilibrium_with_fixed_loads(space):
    """A fixed pressure on the rim of a disc squeezes it before anything is driven: sigma_r = -p, uniaxial along Z."""
    mesh = fx.mesh.disc(radius=1.0, thickness=2.0, elements=(3, 3))
    scene = fx.Scene(mesh=mesh, materials=fx.NeoHookean(c10=2.0), model=fx.MixedPressure(space=space),
                     supports=[fx.Symmetry("axis"), fx.Symmetry("bottom", normal="z")],
                     loads=[fx.Pressure("rim", 1.5), fx.Pressure("top")])
    path = fx.trace(scene, until=fx.pressure(1.5))
    start, end = path.states[0], path.last
    # free along Z: 2 c10 (l^2 - 1/l) = p; then hydrostatic pressure all round: back to rest
    stretch = 1 + start.measures["pole_height"] / 1.0
    assert 4.0 * (stretch**2 - 1 / stretch) == pytest.approx(1.5, rel=1e-8) and len(start.history) > 1
    assert end.measures["pole_height"] == pytest.approx(0.0, abs=1e-8)


def tube(elements, material):
    mesh = fx.mesh.disc(radius=2.0, inner_radius=1.0, thickness=0.5, elements=elements)
    return fx.Scene(mesh=mesh, materials=material, loads=[fx.Pressure("inner")],
                    supports=[fx.Symmetry("bottom", normal="z"), fx.Symmetry("top", normal="z")])


def exact_tube(stretch, modulus):
    """Pressure of a thick neo-Hookean or Mooney tube, inner radius 1, outer 2, plane strain."""
    outer = np.sqrt(1 + (stretch**2 - 1) / 4)
    return modulus * (np.log(stretch / outer) + (outer**-2 - stretch**-2) / 2)


@pytest.mark.quick
@pytest.mark.parametrize("material", [fx.NeoHookean(c10=1.5), fx.MooneyRivlin(c10=1.0, c01=0.5)],
                         ids=lambda m: type(m).__name__)
def test_thick_tube_converges(material):
    """Error of the pressure at inner stretch 2: below 1e-6 with 16 elements through the wall, order 2.9."""
    errors = []
    for n in (4, 8, 16):
        path = fx.trace(tube((n, n // 2), material), until=fx.displacement(1.0, at=(1.0, 0.25), component="r"))
        errors.append(abs(path.last.measures["pressure"] / exact_tube(2.0, 3.0) - 1))
    assert errors[-1] < 1e-6 and np.log2(errors[-2] / errors[-1]) > 2.8, errors


def test_membrane_theory_against_published_numbers():
    """The Adkins-Rivlin equations: limit point and heights known from independent integration."""
    unit = {"radius": 1.0, "thickness": 1.0, "c10": 1.0}
    stretch, state = membrane_limit_point(**unit)
    assert (state.pressure, stretch, state.height) == pytest.approx((3.75835, 2.196, 1.174), rel=2e-4)
    for stretch, pressure, height in [(1.25, 2.3429, 0.5878), (2, 3.7391, 1.0831), (6, 2.8919, 2.3142)]:
        state = membrane_inflation(stretch, **unit)
        assert (state.pressure, state.height) == pytest.approx((pressure, height), abs=1e-4)
    stretch, state = membrane_limit_point(**unit, c01=0.05)
    assert (state.pressure, stretch) == pytest.approx((4.537, 3.10), rel=1e-3)
    assert membrane_limit_point(**unit, c01=0.06) is None
