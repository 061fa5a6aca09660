"""Residual, tangent and derivative by the control against central differences of energy and residual."""

import numpy as np
import pytest

import formingx as fx
from formingx.forms.viscosity import Viscosity
from formingx.problem.problem import Problem
from formingx.solve.snap_through import ViscousDrag

pytestmark = pytest.mark.quick

MATERIALS = [
    fx.NeoHookean(c10=2.0),
    fx.MooneyRivlin(c10=1.5, c01=0.4),
    fx.Ogden(mu=(1.4, -0.3), alpha=(2.5, -2.0)),
    fx.Yeoh(c10=1.0, c20=-0.02, c30=0.01),
    fx.Gent(mu=2.0, Jm=5.0),
    fx.ArrudaBoyce(mu=2.0, N=4.0),
    fx.Hyperelastic(lambda I1, I2, a, b: a * (I1 - 3) + b * (I1 - 3) ** 2, a=1.0, b=0.1),
]
KEEPING = [fx.MixedPressure(), fx.MixedPressure(eps=1e-3),
           *(fx.DisplacementPenalty(eps=1e-2, points=n) for n in (3, 4, 7)),
           fx.DisplacementPenalty(eps=1e-2, stress_free=False)]


def scene(material=MATERIALS[1], keeping=None, kinematics=None, support=None, loads=()):
    layers = {"lower": 0.2, "upper": 0.3}
    mesh = fx.mesh.disc(radius=2.0, thickness=layers, elements=(3, 1), inner_radius=0.5)
    materials = {"lower": material, "upper": fx.NeoHookean(c10=5.0)}
    return fx.Scene(mesh=mesh, materials=materials, supports=[support or fx.Clamped("rim")], loads=loads,
                    model=keeping, kinematics=kinematics)


def random_state(problem, seed=1, size=0.004):
    rng = np.random.default_rng(seed)
    x, d = problem.x.duplicate(), problem.x.duplicate()
    x.setArray(size * rng.standard_normal(x.getLocalSize()))
    d.setArray(0.03 * rng.standard_normal(x.getLocalSize()))
    for v in (x, d):
        v.array_w[problem.constrained] = 0
    return x, d


def difference(f, x, d, h):
    """Central difference of f along d, with f(vector) an array or a number."""
    plus, minus = x.duplicate(), x.duplicate()
    plus.waxpy(h, d, x)
    minus.waxpy(-h, d, x)
    return (f(plus) - f(minus)) / (2 * h)


def residual(problem, control):
    out = problem.x.duplicate()

    def f(x):
        problem.residual(x, control, out)
        return out.array_r.copy()
    return f


def assert_second_order(error, exact, steps=(1e-3, 1e-4)):
    """The difference quotient is exact to round-off, or its error falls as the square of the step."""
    errors = [error(h) / np.abs(exact).max() for h in steps]
    assert errors[1] < 1e-6 and (errors[0] < 1e-9 or errors[1] < 0.05 * errors[0]), errors


def assert_derivatives(problem, x, d):
    """Along d at x: the tangent is the derivative of the residual, the residual that of the energy."""
    exact = problem.x.duplicate()
    problem.tangent(x, 0.7).mult(d, exact)
    f = residual(problem, 0.7)
    assert_second_order(lambda h: np.abs(difference(f, x, d, h) - exact.array_r).max(), exact.array_r)

    energy = problem.forms.compile(problem.forms.energy)

    def value(y):
        problem.set_state(y, 0.0)
        return problem.assemble_scalar(energy)
    slope = residual(problem, 0.0)(x) @ d.array_r
    assert_second_order(lambda h: abs(difference(value, x, d, h) - slope), slope, steps=(3e-4, 3e-5))


@pytest.mark.parametrize("kinematics, keeping", [*((fx.Axisymmetric(), keeping) for keeping in KEEPING),
                                                 (fx.PlaneStrain(), KEEPING[0]), (fx.PlaneStrain(), KEEPING[2])])
def test_tangent_is_derivative_of_residual(keeping, kinematics):
    problem = Problem(scene(keeping=keeping, kinematics=kinematics, support=fx.SimplySupported("rim")
                            if isinstance(kinematics, fx.Axisymmetric) else None,
                            loads=[fx.Pressure("bottom"), fx.Pressure("top", 0.3)]))
    x, d = random_state(problem)
    exact = problem.x.duplicate()
    problem.tangent(x, 0.7).mult(d, exact)
    f = residual(problem, 0.7)
    assert_second_order(lambda h: np.abs(difference(f, x, d, h) - exact.array_r).max(), exact.array_r)


@pytest.mark.parametrize("material", MATERIALS, ids=lambda m: type(m).__name__)
def test_residual_is_derivative_of_energy(material):
    problem = Problem(scene(material))
    energy = problem.forms.compile(problem.forms.energy)
    x, d = random_state(problem)

    def value(y):
        problem.set_state(y, 0.0)
        return problem.assemble_scalar(energy)
    exact = residual(problem, 0.0)(x) @ d.array_r
    assert_second_order(lambda h: abs(difference(value, x, d, h) - exact), exact)


@pytest.mark.parametrize("material", MATERIALS, ids=lambda m: type(m).__name__)
def test_tangent_of_every_material(material):
    problem = Problem(scene(material))
    x, d = random_state(problem, seed=2)
    exact = problem.x.duplicate()
    problem.tangent(x, 0.0).mult(d, exact)
    f = residual(problem, 0.0)
    assert_second_order(lambda h: np.abs(difference(f, x, d, h) - exact.array_r).max(), exact.array_r)


@pytest.mark.parametrize("driven", ["pressure", "motion"])
def test_derivative_by_control(driven):
    loads = [fx.Pressure("bottom")] if driven == "pressure" else []
    given = scene(loads=loads)
    if driven == "motion":
        given = fx.Scene(mesh=given.mesh, materials=given.materials,
                         supports=[fx.Clamped("rim"), fx.PrescribedDisplacement("inner", "z")])
    problem = Problem(given)
    x, _ = random_state(problem)
    control, h = 0.4, 1e-5
    # a held unknown follows the control in x as well as in the residual
    shift = np.zeros_like(x.array_r)
    shift[problem.constrained] = problem.constrained_rate
    plus, minus = x.duplicate(), x.duplicate()
    plus.setArray(x.array_r + (control + h) * shift)
    minus.setArray(x.array_r + (control - h) * shift)
    x.setArray(x.array_r + control * shift)
    numeric = (residual(problem, control + h)(plus) - residual(problem, control - h)(minus)) / (2 * h)
    exact = problem.x.duplicate()
    problem.control_derivative(x, control, exact)
    free = np.ones(len(shift), dtype=bool)
    free[problem.constrained] = False
    assert np.abs(numeric - exact.array_r)[free].max() < 1e-6 * np.abs(exact.array_r).max()
    assert np.abs(exact.array_r[free]).max() > 1e-3
    assert np.allclose(exact.array_r[problem.constrained], -problem.constrained_rate)


@pytest.mark.parametrize("kinematics", [fx.Axisymmetric(), fx.PlaneStrain()], ids=lambda k: type(k).__name__)
def test_pressure_does_the_work_p_dV(kinematics):
    """Virtual work of the pressure over a change of shape equals p times the change of enclosed volume."""
    mesh = fx.mesh.disc(radius=2.0, thickness=0.3, elements=(4, 1))
    problem = Problem(fx.Scene(mesh=mesh, materials=fx.NeoHookean(c10=1.0), loads=[fx.Pressure("bottom")],
                               supports=[fx.Symmetry("axis"), fx.Clamped("rim")], kinematics=kinematics))
    forms, (x, d) = problem.forms, random_state(problem, size=0.01)
    volume = fx.enclosed_volume(1.0).bind(problem)
    change = difference(lambda y: volume.value(y, 0.0), x, d, 1e-5)
    derivative = problem.x.duplicate()
    problem.control_derivative(x, 0.0, derivative)
    work = -derivative.dot(d) * forms.stress * forms.volume / forms.control_scale * problem.scene.symmetry_factor
    assert work == pytest.approx(change, rel=1e-8)


@pytest.mark.parametrize("support", [fx.Clamped("rim"), fx.SimplySupported("rim")], ids=lambda s: type(s).__name__)
def test_tangent_with_viscosity(support):
    """Held unknowns (clamped) and means (hinged) are none that move against it."""
    problem = Problem(scene(support=support))
    x, d = random_state(problem)
    drag, plain = ViscousDrag(problem.viscosity()), residual(problem, 0.0)
    drag.eta, drag.origin = 3.0, 0.5 * x.array_r
    exact = x.duplicate()
    drag.add_to(problem.tangent(x, 0.0))
    problem.matrix.mult(d, exact)

    def f(y):
        return plain(y) + drag.forces(y.array_r)
    assert_second_order(lambda h: np.abs(difference(f, x, d, h) - exact.array_r).max(), exact.array_r)
    assert np.abs(drag.forces(x.array_r)).max() > 1e-3 and not drag.forces(x.array_r)[problem.constrained].any()
    drag.destroy()


@pytest.mark.parametrize("kinematics, dF2", [(fx.Axisymmetric(), 3), (fx.PlaneStrain(), 2)], ids=["ring", "bar"])
def test_viscous_work_of_a_homogeneous_stretch(kinematics, dF2):
    """u = s X: dF = s I (s I in the plane, bar), so the work of the viscous stress is s^2 |I|^2 per volume."""
    problem = Problem(scene(keeping=fx.DisplacementPenalty(), kinematics=kinematics))
    s, x = 0.3, problem.x.duplicate()
    problem.forms.w.sub(0).interpolate(lambda X: s / problem.forms.length * X[:2])
    x.array_w[: problem.n_owned] = problem.forms.w.x.array[: problem.n_owned]
    viscosity = Viscosity(problem.forms.compile(problem.forms.viscosity()), [])
    assert x.array_r @ viscosity.forces(x.array_r, 2.0) == pytest.approx(2.0 * dF2 * s**2, rel=1e-12)
    viscosity.destroy()
