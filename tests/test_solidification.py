"""Solidification: networks that form in a deformed shape keep it; melting releases them."""

import json

import numpy as np
import pytest
import ufl
from conftest import drawn, run
from scipy.optimize import brentq

import formingx as fx

HEAT = fx.ThermalProperties(conductivity=0.2, density=1000.0, heat_capacity=2000.0)
BASE = fx.NeoHookean(c10=1.0)


def block(material, boundaries, temperature=150.0, heat=True, **more):
    """Scene of a block that is stretched equibiaxially in its plane."""
    return fx.Scene(mesh=fx.mesh.disc(radius=1e-3, thickness=1e-3, elements=(2, 1)), materials=material,
                    temperature=temperature, heat=fx.Cooling(HEAT, boundaries, unit="C", tolerance=1.0) if heat
                    else None, supports=[fx.Symmetry("axis"), fx.Symmetry("bottom", normal="z"),
                                         fx.PrescribedDisplacement("rim", "r", name="grip")], **more)


def air(temperature):
    return [fx.Convection(face, h=500.0, air=temperature) for face in ("top", "bottom")]


def draw(by):
    return fx.Stage("draw", control="grip", until=fx.travel(by * 1e-3))


def stretch(path):
    return float(np.mean(path.stress().at_quadrature_points().deformation_gradient[:, 0, 0]))


def balance(G, drawn_to, mu=2.0, phi=1.0):
    return brentq(lambda l: mu * (l**2 - l**-4) + phi * G * ((l / drawn_to)**2 - (l / drawn_to)**-4), 1, drawn_to)


@pytest.mark.thorough
def test_solidified_block(tmp_path):
    """The stretch agrees to 1e-8 with the balance of rubber and glass, in fewer than 25 steps."""
    run("demos/set_block.py", "--out", tmp_path, "--quick")
    found = json.loads((tmp_path / "summary.json").read_text())
    for mode, close in (("uniaxial", (1.492217, 1.499210)), ("equibiaxial", (1.494939, 1.499488))):
        for modulus, value in zip((200, 2000), close):
            numbers = found[mode][f"G_{modulus}"]
            assert numbers["stretch"] == pytest.approx(numbers["exact"], rel=1e-8)
            assert numbers["exact"] == pytest.approx(value, abs=1e-6) and numbers["steps"] < 25
    assert drawn(tmp_path / "set_block.png")


@pytest.mark.thorough
def test_relaxing_base_solidifies():
    """A released block balances rubber, glass and the branch with its elastic strain at the release."""
    tau, mu, G = 4.0, 1.5, 300.0
    material = fx.Solidification(fx.TransientNetwork(BASE, [(mu, tau)]), G, fraction=fx.table({70: 1, 75: 0.5, 85: 0}))
    path = fx.Process(block(material, air(20.0))).run(
        [draw(0.4), fx.Stage("chill", duration=20.0), fx.Stage("let go", inactive=["grip"])], progress=False,
        accuracy="fine")
    L, time = 1.4, 20.0
    decay = np.exp(-time / tau)
    A = np.array([decay + (1 - decay) / L**2, decay + (1 - decay) * L**4])      # in the plane, across

    def pull(l):
        return (2 * (l**2 - l**-4) + mu * (A[0] * l**2 - A[1] * l**-4) + G * ((l / L)**2 - (l / L)**-4))
    assert stretch(path) == pytest.approx(brentq(pull, 1, L), rel=1e-6)


@pytest.mark.parametrize("hot, left", [(82.5, 0.25), pytest.param(120.0, 0.0, marks=pytest.mark.thorough)])
def test_melted_material_carries_no_stress(hot, left):
    """Solidified, stretched, then warmed at constant stretch: the base and the remaining glass carry the stress."""
    G, l = 50.0, 1.1
    scene = block(fx.Solidification(BASE, G, between=(75, 85)), air(hot), temperature=20.0)
    path = fx.Process(scene).run([draw(l - 1), fx.Stage("warm", duration=60.0)], progress=False, accuracy="draft")
    for state, share in ((path.state("draw"), 1.0), (path.last, left)):
        stress = path.stress(state).at_quadrature_points().cauchy[:, 0, 0]
        assert stress == pytest.approx((2 + share * G) * (l**2 - l**-4) * np.ones(len(stress)), rel=2e-4)


@pytest.mark.thorough
def test_steps_in_time_keep_the_accuracy():
    """A loaded block, whose base stiffens and contracts on cooling, until glass stops it."""
    stiffens = fx.NeoHookean(c10=fx.table({20: 4.0, 80: 1.5, 150: 1.0}))
    found = {}
    for accuracy in (5e-2, 1e-2, 1e-3):
        scene = fx.Scene(mesh=fx.mesh.disc(radius=1e-3, thickness=1e-3, elements=(2, 1)), temperature=150.0,
                         materials=fx.Solidification(stiffens, 20.0, between=(60, 90)),
                         loads=[fx.Pressure("rim", name="pull")],
                         heat=fx.Cooling(HEAT, air(20.0), unit="C", tolerance=0.2),
                         supports=[fx.Symmetry("axis"), fx.Symmetry("bottom", normal="z")])
        path = fx.Process(scene).run([fx.Stage("pull", control="pull", until=fx.pressure(-1.5)),
                                      fx.Stage("chill", duration=10.0)], progress=False, accuracy=accuracy)
        found[accuracy] = stretch(path)
    assert found[5e-2] == pytest.approx(found[1e-3], rel=5e-3)
    assert found[1e-2] == pytest.approx(found[1e-3], rel=5e-4)


def test_stress_of_a_sheet_that_solidifies_while_it_is_stretched():
    """It tends to that of networks that form free of stress at every stretch, with the square of the step."""
    G, end = 30.0, 1.5
    glass = fx.Solidification(fx.NeoHookean(c10=1.0), modulus=G, between=(90, 110))
    nodes, weights = np.polynomial.legendre.leggauss(40)
    formed, share = 1.25 + 0.25 * nodes, weights / 2                         # phi grows evenly with the stretch
    exact = 2 * (end - end**-2) + G * share @ (end / formed**2 - formed / end**2)

    def gradient(l):
        return ufl.as_matrix(np.diag([l, l**-0.5, l**-0.5]).tolist())

    def numbers(values):
        return {name: tuple(float(x(())) for x in value) if value.ufl_shape else float(value(()))
                for name, value in ((name, ufl.as_ufl(value)) for name, value in values.items())}

    def error(steps):
        state, h = dict(glass.internal), 1e-4
        for k in range(steps):
            phi = {"c10": 1.0, "G_set": G, "set_end": np.exp((k + 1) / steps), "set_middle": np.exp((k + 0.5) / steps)}
            constants = {name: ufl.as_ufl(float(value)) for name, value in phi.items()}
            before = {name: ufl.as_vector(v) if isinstance(v, tuple) else ufl.as_ufl(v) for name, v in state.items()}
            l = 1 + (end - 1) * (k + 1) / steps
            energies = [float(glass.step_energy(gradient(l + d), before, 1.0, **constants)(())) for d in (h, -h)]
            state = numbers(glass.updated(gradient(l), before, 1.0, **constants))
        return (energies[0] - energies[1]) / (2 * h) - exact
    errors = [error(n) for n in (5, 10, 20)]
    assert abs(errors[2]) < 2e-3 * exact
    assert errors[0] / errors[1] == pytest.approx(4, rel=0.2) and errors[1] / errors[2] == pytest.approx(4, rel=0.2)


def test_hot_material_equals_its_base():
    """A hot material deforms like its base, to round-off; a cold one has the moduli of base and glass."""
    hot, plain = (fx.Process(block(material, [], heat=False)).run([draw(0.5)], progress=False)
                  for material in (fx.Solidification(BASE, 300.0, between=(75, 85)), BASE))
    assert hot.last.x == pytest.approx(plain.last.x, abs=1e-12)
    material = fx.Solidification(BASE, 300.0, between=(75, 85))
    assert material.at_temperature(20.0).shear_modulus == pytest.approx(302.0)
    assert material.fraction([20.0, 80.0, 90.0]).tolist() == [1.0, 0.5, 0.0]
    assert material.base.parameters == BASE.parameters


@pytest.mark.parametrize("make, words", [
    (lambda: fx.Solidification(1.0, 800.0, between=(75, 85)), "base = 1.0: must be a material"),
    (lambda: fx.Solidification(BASE, -1.0, between=(75, 85)), "modulus = -1.0: must be greater than 0"),
    (lambda: fx.Solidification(BASE, 1.0, between=(85, 75)), "the lower first"),
    (lambda: fx.Solidification(BASE, 1.0), "give one of them"),
    (lambda: fx.Solidification(BASE, 1.0, fraction=fx.table({20: 0, 80: 1})), "must fall from 1 to 0"),
    (lambda: fx.Solidification(fx.Solidification(BASE, 1.0, between=(1, 2)), 1.0, between=(1, 2)), "fies already"),
    (lambda: block(fx.Solidification(BASE, 1.0, between=(1, 2)), [], temperature=None, heat=False), "temperature"),
])
def test_refused_arguments(make, words):
    with pytest.raises(fx.InputError, match=words):
        make()
