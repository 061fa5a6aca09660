"""Sheets in space: their equations, exact solutions, contact that sticks, tools, what is read off, what is refused."""

import pytest
from test_demos import summary
from test_derivatives import assert_derivatives, difference, random_state

import formingx as fx
from formingx.discrete.problem import Problem

MATERIALS = [fx.NeoHookean(c10=2.0), fx.MooneyRivlin(c10=1.5, c01=0.4), fx.Ogden(mu=(1.4, -0.3), alpha=(2.5, -2.0)),
             fx.Viscoelastic(fx.NeoHookean(c10=0.5), [(1.0, 1.0)])]
HELD = [fx.SimplySupported("rim"), fx.Symmetry("x0", "x"), fx.Symmetry("y0", "y")]


def disc(size=0.3, material=MATERIALS[0], on="bottom", model=None, **scene):
    """A quarter of a disc of radius 1 under a pressure."""
    sheet = fx.mesh.sheet(fx.mesh.circle(1.0, part="quarter"), size=size, **scene.pop("mesh", {}))
    return fx.Scene(mesh=sheet, thickness=scene.pop("thickness", 0.01), materials=material, supports=HELD,
                    loads=[fx.Pressure(on)], model=model, **scene)


@pytest.mark.parametrize("wrinkles", [None, 0.01])
@pytest.mark.parametrize("material", MATERIALS, ids=lambda m: type(m).__name__)
def test_residual_and_tangent_are_derivatives(material, wrinkles):
    problem = Problem(disc(material=material, model=fx.Membrane(wrinkles=wrinkles)))
    assert_derivatives(problem, *random_state(problem, size=0.1 if wrinkles else 0.05))


@pytest.mark.parametrize("on", ["bottom", "top"])
def test_pressure_does_the_work_p_dV(on):
    problem = Problem(disc(on=on))
    forms, (x, d) = problem.forms, random_state(problem, size=0.05)
    volume, derivative = fx.enclosed_volume(1.0).bind(problem), problem.x.duplicate()
    problem.control_derivative(x, 0.0, derivative)
    work = -derivative.dot(d) * forms.stress * forms.volume / forms.control_scale
    assert work == pytest.approx(difference(lambda y: volume.value(y, 0.0), x, d, 1e-5), rel=1e-8)


def test_disc_converges_to_the_membrane_of_revolution(tmp_path):
    found = summary("disc_in_space", tmp_path, "--quick")
    fine = found["size_0.05"]
    for s, bound in (("1.5", 8e-4), ("2", 2e-3), ("3", 4e-3)):
        assert abs(fine["pressure_over_axisymmetric"][s] - 1) < bound
        assert found["order_of_pressure"][s] > 1.8
        assert abs(fine["pole_thickness_over_axisymmetric"][s] - 1) < 4 * bound
    assert abs(fine["limit_pressure_over_axisymmetric"] - 1) < 2.5e-3
    assert fine["failures"] == 0 and fine["iterations"] <= 35
