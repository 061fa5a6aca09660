"""Friction that depends on the temperature of the body where it touches."""

import numpy as np
import pytest
from test_temperature import SHEET

import formingx as fx
from formingx.contact.tooling import Tooling
from formingx.results.files.description import describe

RISING = fx.table({20.0: 0.1, 150.0: 0.4})


def pushed(friction, temperature=150.0, heat=None, points="nodes", travel=0.3):
    """A sheet, 0.05 thick, clamped at 1, under a plug with a rounded edge."""
    tool = fx.tools.male(radius=0.4, height=1.0, base=-1.0, fillet=0.15).mirrored().moved(z=0.05)
    scene = fx.Scene(mesh=fx.mesh.disc(radius=1.0, thickness=0.05, elements=(14, 1)), materials=fx.NeoHookean(c10=1.0),
                     supports=[fx.Symmetry("axis"), fx.Clamped("rim")], temperature=temperature, heat=heat,
                     contacts=[fx.Contact("top", tool, friction, direction=(0, -1), name="plug", points=points)])
    stage = fx.Stage("push", control="plug", until=fx.travel(travel), duration=1.0)
    return scene, fx.Process(scene).run([stage], progress=False, accuracy="draft")


def tractions(path, state=None):
    """(reference R, normal, tangential, mu) of a state at the points that touch."""
    problem = path.problem
    contact = problem.contacts[0]
    with problem.state_context(state or path.last):
        found = contact.tractions(problem.x.array_r[: problem.n_owned], problem.control)
        mu = np.broadcast_to(contact.law.mu, len(found.normal)).copy()
    on = found.normal > 0
    return contact.points[on, 0], found.normal[on], found.tangential[on], mu[on]


@pytest.mark.parametrize("points", ["nodes", 3])
def test_uniform_temperature_gives_the_same_bits_as_the_number(points):
    warm, plain = (pushed(friction, 150.0, points=points)[1] for friction in (RISING, 0.4))
    assert len(warm.states) == len(plain.states)
    for a, b in zip(warm.states, plain.states):
        assert np.array_equal(a.x, b.x) and a.control == b.control


def test_friction_depends_on_temperature():
    """The thesis' finding that friction keeps the base thick, by temperature; everywhere |T| <= mu(T) N."""
    flat = {}
    for T in (20.0, 150.0):
        path = pushed(RISING, T)[1]
        R, N, tangential, mu = tractions(path)
        assert np.all(mu == RISING(T)) and np.all(np.abs(tangential) <= mu * N * (1 + 1e-12))
        assert np.any(np.abs(tangential) > 0.999 * mu * N)          # some slide
        flat[T] = path.profile().thickness_ratio[0]
    assert flat[150.0] > 1.01 * flat[20.0]


def test_friction_has_the_temperature_of_each_point():
    """A sheet with a hot middle: mu follows T(R) point by point, and the limit of friction with it."""
    def temperature(R, Z):
        return 150 - 120 * R
    path = pushed(fx.of_temperature(lambda T: 0.3 * T / 150), temperature)[1]
    R, N, tangential, mu = tractions(path)
    assert mu == pytest.approx(0.3 * temperature(R, 0) / 150, rel=1e-12) and np.ptp(mu) > 0.01
    slides = np.abs(tangential) > 0.999 * mu * N
    assert np.all(np.abs(tangential) <= mu * N * (1 + 1e-12)) and slides.any()
    between = [pushed(mu)[1].profile().thickness_ratio[0] for mu in (0.15, 0.3)]
    assert between[0] < path.profile().thickness_ratio[0] < between[1]


def test_friction_follows_a_face_that_cools():
    """mu is that of the last accepted state's face, comes back with a state, and goes on in a restart."""
    polymer = fx.ThermalProperties(conductivity=0.17, density=1.0, heat_capacity=1.0)
    cooling = fx.Cooling(polymer, unit="C", tools={"plug": (1.0, 30.0)}, tolerance=0.5)
    path = pushed(RISING, 150.0, cooling)[1]
    R, N, tangential, mu = tractions(path)
    T = path.temperature(np.column_stack([R, np.full(len(R), 0.05)]))
    assert T.max() < 120 and mu == pytest.approx(RISING(T), rel=1e-9)
    assert np.all(np.abs(tangential) <= mu * N * (1 + 1e-12))
    assert np.all(tractions(path, path.states[1])[3] > mu.max())
    hot = pushed(RISING, 150.0)[1]
    assert path.profile().thickness_ratio[0] < 0.995 * hot.profile().thickness_ratio[0]


def test_friction_appears_in_files_and_reports():
    """A tool that is drawn from a file knows its friction in words."""
    path = pushed(RISING, 150.0, travel=0.05)[1]
    told = describe(path.problem)
    assert told["contacts"][0]["friction"] == {"kind": "table", "x": [20.0, 150.0], "y": [0.1, 0.4]}
    assert Tooling.of_description(told).contacts[0].friction == repr(RISING)


@pytest.mark.parametrize("friction, temperature, words", [
    (RISING, None, "friction depends on the temperature: give Scene a temperature"),
    (RISING, 160.0, r"friction: .*temperature = 160: must be from 20 to 150"),
    (fx.table({20.0: -0.1, 150.0: 0.4}), 150.0, "smallest value = -0.1: must not be negative"),
    (fx.of_temperature(lambda T: T - 151), 150.0, "friction = -1 at a temperature of 150: must be at least 0"),
    (fx.of_temperature(lambda T: np.where(T > 0, np.nan, T)), 150.0, "nan, not a finite number, at temperature = 150"),
    (lambda R, Z: R, 150.0, "a number or, by temperature"),
    ("rough", 150.0, "must be 'stick', 'none' or a coefficient"),
])
def test_wrong_friction_tables_are_refused(friction, temperature, words):
    with pytest.raises(fx.InputError, match=words):
        pushed(friction, temperature, travel=0.01)


@pytest.mark.thorough
def test_a_melt_that_is_chilled_below_the_pole_of_its_shift_does_not_relax(caplog):
    """The WLF shift of docs/my_polymer.md is infinite at 90 C: below 103.7 C, where it is 1e30, it stays so."""
    shift = fx.WLF(8.9, 60.0, 150.0)
    assert np.log10(shift(shift.limits[0])) == pytest.approx(30.0) and 92 < shift.limits[0] < 104
    melt = fx.Viscoelastic(fx.NeoHookean(c10=0.2), [(1.0, 1e-2)], shift=shift)
    cooling = fx.Cooling(SHEET, [fx.Convection("top", h=1e5, air=20.0), fx.Convection("bottom", h=1e5, air=20.0)],
                         unit="C", tolerance=1.0)
    scene = fx.Scene(mesh=fx.mesh.disc(radius=1.0, thickness=0.05, elements=(8, 1)), materials=melt, temperature=150.0,
                     heat=cooling, supports=[fx.Symmetry("axis"), fx.Clamped("rim")], loads=[fx.Pressure("bottom")])
    stage = fx.Stage("blow", control=scene.loads[0], until=fx.pressure(1e-3), duration=1.0)
    path = fx.Process(scene).run([stage], progress=False, accuracy="draft")
    assert path.temperature(path.profile().reference_top).max() < 90
    known = "where the material does not relax any more"
    assert sum(known in found.text for found in path.findings()) == 1 == caplog.text.count(known)
    assert melt.constants()["tau_1"].clamped([20.0, 150.0]) == pytest.approx([1e28, 1e-2], rel=1e-9)


def test_a_face_that_leaves_the_table_while_it_cools_has_the_friction_of_its_end(caplog):
    """It is said before the run, once, with the temperature of the air."""
    cooling = fx.Cooling(SHEET, [fx.Convection("top", h=1e5, air=20.0)], unit="C", tolerance=1.0)
    path = pushed(fx.table({140.0: 0.1, 150.0: 0.4}), 150.0, cooling)[1]
    assert path.temperature(path.profile().reference_top).min() < 130
    known = "is known down to 140 degrees, and the tools and the air may bring it to 20: below 140 it is taken as"
    assert sum(known in found.text for found in path.findings()) == 1 == caplog.text.count(known)
    mu = path.problem.contacts[0].law.mu
    assert mu.min() == pytest.approx(0.1, rel=1e-12)
