"""Blocks between plates: exact solutions, force balance, convergence, bad input."""

import sys

import numpy as np
import pytest
from conftest import ROOT
from test_contact import support_force

import formingx as fx

sys.path.insert(0, str(ROOT / "demos"))
from plates import HALF_HEIGHT, RADIUS, block, force, press  # noqa: E402

STIFF = {"penalty": 2e7, "ramp": 1e-8}


def test_homogeneous_compression():
    """Eqs. (7.6), (7.7), table 7.1; contact force equals the reaction of the symmetry plane."""
    h, c = 0.3288, 0.1
    path, _ = press(block(fx.NeoHookean(c10=c), "none", (2, 2), **STIFF), [HALF_HEIGHT - h], progress=False)
    l2 = HALF_HEIGHT / h
    exact = 100 * 2 * np.pi * RADIUS**2 * (l2**2 - 1 / l2) * c
    assert exact == pytest.approx(1553.5, abs=0.1) and force(path.last) == pytest.approx(exact, rel=1e-4)
    stress = path.stress().at_quadrature_points().second_piola[:, 1, 1]
    np.testing.assert_allclose(stress, -2 * (l2**3 - 1) * c, rtol=1e-4)
    assert abs(path.last.measures["mass_error"]) < 1e-9
    reaction = support_force(path.problem, path.last, 1)
    assert path.last.measures["tool_force"] == pytest.approx(reaction, rel=1e-6)


def test_a_long_strip():
    """Plane strain, free of friction: sigma_zz = mu (l^2 - 1/l^2) on a width 2 R0 / l."""
    l, c = 0.5, 0.2                                          # noqa: E741
    scene = block(fx.NeoHookean(c10=c), "none", (2, 2), kinematics=fx.PlaneStrain(), **STIFF)
    path, _ = press(scene, [HALF_HEIGHT * (1 - l)], progress=False)
    assert path.last.measures["tool_force"] == pytest.approx(2 * c * (1 / l**2 - l**2) * 2 * RADIUS / l, rel=2e-4)


@pytest.mark.parametrize("friction", ["stick", 0.2])
def test_contact_force_is_the_reaction(friction):
    path, _ = press(block(fx.MooneyRivlin(c10=1.0, c01=0.1), friction, (6, 6)), [0.2], progress=False)
    assert path.last.measures["tool_force"] == pytest.approx(support_force(path.problem, path.last, 1), rel=1e-6)


def test_friction_stiffens():
    found = [force(press(block(fx.MooneyRivlin(c10=1.0, c01=0.1), mu, (6, 6)), [0.2], progress=False)[0].last)
             for mu in ("none", 0.05, 0.1, 0.2, 0.3, "stick")]
    assert found == sorted(found) and found[-1] > 1.1 * found[0]


def test_mesh_refinement_softens_the_stuck_block():
    """Its edge is singular: the force falls with the mesh, the slower the finer."""
    found = [force(press(block(fx.MooneyRivlin(c10=1.0, c01=0.1), "stick", (n, n)), [0.2], progress=False)[0].last)
             for n in (4, 8, 16)]
    assert found[0] > found[1] > found[2] and found[1] - found[2] < 0.7 * (found[0] - found[1])
    assert found[1] == pytest.approx(found[2], rel=5e-3)


@pytest.mark.thorough
def test_equal_layers_are_one_block():
    soft, same, stiff = (fx.MooneyRivlin(c10=c, c01=0.1 * c) for c in (1.0, 1.0, 10.0))
    layers = {"strip": HALF_HEIGHT / 2, "block": HALF_HEIGHT / 2}
    scenes = [block({"strip": s, "block": soft}, "stick", (6, 3), layers=layers) for s in (soft, same, stiff)]
    one, two, sandwich = (force(press(scene, [0.2], progress=False)[0].last) for scene in scenes)
    assert two == pytest.approx(one, rel=1e-8) and sandwich > 1.2 * one


def test_the_side_rolls_onto_the_plate():
    """The fold carries load: stiffer than a side that passes through the plate."""
    material = fx.MooneyRivlin(c10=1.0, c01=0.1)
    rolled, free = (press(block(material, "stick", (8, 4), roll_over=r), [0.58], progress=False)[0]
                    for r in (True, False))
    assert rolled.last.measures["contact_length"] > 1.02 * RADIUS
    assert force(rolled.last) > force(free.last)


def roll_over(friction, step=None, **options):
    """Forces at three ratios."""
    made = block(fx.MooneyRivlin(c10=0.1, c01=1.0), friction, (8, 8), roll_over=True, **options)
    targets = [fx.travel(HALF_HEIGHT * (1 - 1 / ratio)) for ratio in (1.87, 2.5, 3.4)]
    path = fx.trace(made, until=targets[-1], intermediate=targets[:-1], step=step, progress=False)
    return [force(path.target_state(target)) for target in targets]


@pytest.mark.parametrize("friction, refined", [
    ("stick", {"penalty": 2e6}), (0.5, {"penalty": 2e6, "elastic_slip": 1e-4})])
def test_forces_in_roll_over_do_not_depend_on_steps_penalty_and_elastic_slip(friction, refined):
    """Where a node sticks depends on when it touched, and the force on how far the plate sinks in."""
    short = fx.StepControl(length=0.02, largest=0.02)
    assert roll_over(friction) == pytest.approx(roll_over(friction, short, **refined), rel=3e-3)


@pytest.mark.slow
@pytest.mark.parametrize("friction", [0.1, 0.2, 0.3])
def test_forces_in_roll_over_under_little_friction_need_short_steps(friction):
    """A point may stick in one part of a step and slide in the other: the error is of first order in the length."""
    fine = roll_over(friction, fx.StepControl(length=0.01, largest=0.01), penalty=2e6, elastic_slip=1e-4)
    assert roll_over(friction) == pytest.approx(fine, rel=6e-3)
    assert roll_over(friction, fx.StepControl(length=0.025, largest=0.025)) == pytest.approx(fine, rel=1e-3)


@pytest.mark.parametrize("change, message", [
    (lambda: fx.trace(block(fx.NeoHookean(c10=1.0), "none", (2, 2)), until=fx.travel(1.3)), "height"),
    (lambda: block(fx.NeoHookean(c10=1.0), "none", (2, 2), layers={"strip": 0.5, "block": -0.1}), "greater than 0"),
    (lambda: fx.travel(float("nan")), "finite"),
])
def test_bad_input(change, message):
    with pytest.raises(fx.InputError, match=message):
        change()


def test_forces_of_a_block_between_smooth_plates():
    """Within 1e-4 of the homogeneous block's from the first 0.1 % of travel on."""
    height, parts = 1.25, (0.001, 0.01, 0.1, 0.4)
    mesh = fx.mesh.disc(radius=1.32, thickness=height, elements=(6, 3))
    scene = fx.Scene(mesh=mesh, materials=fx.MooneyRivlin(c10=0.1, c01=0.01),
                     supports=[fx.Symmetry("axis"), fx.Symmetry("bottom", "z")],
                     contacts=[fx.Contact("top", fx.tools.plane(height), "none", direction=(0, -1))])
    targets = [fx.travel(part * height) for part in parts]
    path = fx.trace(scene, until=targets[-1], intermediate=targets[:-1], progress=False)
    for part, target in zip(parts, targets):
        l = 1 - part
        exact = 2 * (l**-2 - l) * (0.1 + 0.01 / l) * np.pi * 1.32**2
        assert path.target_state(target).measures["tool_force"] == pytest.approx(exact, rel=1e-4)
