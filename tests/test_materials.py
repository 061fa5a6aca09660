"""Materials: closed-form stresses, Ogden's powers in high precision, limits, stability, bad input."""

import itertools
import math
import re

import basix.ufl
import numpy as np
import pytest
import ufl
from scipy.optimize import brentq
from ufl.algorithms import expand_derivatives, expand_indices

import formingx as fx
from formingx.materials import homogeneous
from formingx.materials.homogeneous import MODES, _Program
from formingx.physics import kinematics
from formingx.problem.problem import Problem


def of_invariants(W1, W2=lambda I1: 0.0):
    """Closed-form nominal stresses of an energy with these derivatives by I1 and I2."""
    return {
        "uniaxial": lambda l: 2 * (l - l**-2) * (W1(l**2 + 2 / l) + W2(0) / l),
        "pure_shear": lambda l: 2 * (l - l**-3) * (W1(l**2 + 1 + l**-2) + W2(0)),
        "equibiaxial": lambda l: 2 * (l - l**-5) * (W1(2 * l**2 + l**-4) + l**2 * W2(0)),
    }


def of_powers(pairs):
    """Closed-form nominal stresses of Ogden's energy."""
    return {mode: lambda l, b=b: sum(m * (l ** (a - 1) - l ** (-b * a - 1)) for m, a in pairs)
            for mode, b in (("uniaxial", 0.5), ("pure_shear", 1), ("equibiaxial", 2))}


def inverse_langevin(y):
    return brentq(lambda b: 1 / np.tanh(b) - 1 / b - y, 1e-6, 1e6, xtol=1e-14, rtol=1e-14)


def eight_chain(mu, N):
    """dW/dI1 of the eight-chain model by the approximation of the inverse Langevin function."""
    def W1(I1):
        y = np.sqrt(I1 / (3 * N))
        return mu * N * (3 * y - (6 * y**3 + y**5 - 2 * y**7) / 5) / (1 - y**2) / (6 * N * y)
    return W1


PAIRS = [(0.63, 1.3), (0.0012, 5.0), (-0.01, -2.0)]
CASES = [
    (fx.NeoHookean(c10=0.3), of_invariants(lambda I1: 0.3)),
    (fx.MooneyRivlin(c10=0.3, c01=0.05), of_invariants(lambda I1: 0.3, lambda I1: 0.05)),
    (fx.Yeoh(c10=0.3, c20=-2e-3, c30=5e-5), of_invariants(lambda I1: 0.3 - 4e-3 * (I1 - 3) + 1.5e-4 * (I1 - 3) ** 2)),
    (fx.Gent(mu=0.3, Jm=80.0), of_invariants(lambda I1: 0.15 / (1 - (I1 - 3) / 80))),
    (fx.ArrudaBoyce(mu=0.3, N=25.0), of_invariants(eight_chain(0.3, 25.0))),
    (fx.Ogden(mu=[m for m, _ in PAIRS], alpha=[a for _, a in PAIRS]), of_powers(PAIRS)),
    (fx.Hyperelastic(lambda I1, I2, a, b: a * (I1 - 3) + b * ufl.ln(I2 / 3), a=0.2, b=0.1), {
        "uniaxial": lambda l: 2 * (l - l**-2) * (0.2 + 0.1 / (2 * l + l**-2) / l),
        "pure_shear": lambda l: 2 * (l - l**-3) * (0.2 + 0.1 / (l**2 + 1 + l**-2)),
        "equibiaxial": lambda l: 2 * (l - l**-5) * (0.2 + 0.1 * l**2 / (l**4 + 2 * l**-2)),
    }),
]
MATERIAL = pytest.mark.parametrize("material, exact", CASES, ids=lambda x: type(x).__name__ if x in
                                   [m for m, _ in CASES] else "")


def test_materials_of_a_kind_differentiate_their_energy_once():
    """Whatever the constants are: a study makes hundreds of materials."""
    def made(c):
        return fx.MooneyRivlin(c10=c, c01=0.1), fx.Ogden(mu=[c, 0.01], alpha=[1.8, 6.0])
    made(0.3)
    before = homogeneous._programs.cache_info().misses
    made(0.4)
    assert homogeneous._programs.cache_info().misses == before



@pytest.mark.quick
@MATERIAL
@pytest.mark.parametrize("mode", MODES)
def test_stress_is_the_closed_form(material, exact, mode):
    l = np.concatenate([np.geomspace(0.45, 5.5, 60), [1.0, 1 - 1e-6, 1 + 1e-6, 1.005, 1.0051]])
    wanted = exact[mode](l)
    assert np.abs(material.stress(mode, l) - wanted).max() < 1e-12 * np.abs(wanted).max()
    near = np.abs(l - 1) < 0.01
    assert np.abs(material.stress(mode, l) - wanted)[near].max() < 1e-14


@pytest.mark.quick
@MATERIAL
def test_modulus_and_rest_stress(material, exact):
    h = 1e-5
    slope = (exact["uniaxial"](1 + h) - exact["uniaxial"](1 - h)) / (2 * h)
    assert material.shear_modulus == pytest.approx(slope / 3, rel=1e-8)
    assert all(material.stress(mode, 1.0) == pytest.approx(0, abs=1e-15) for mode in MODES)
    assert material.stress("uniaxial", [[1.5, 2.0]]).shape == (1, 2) and np.ndim(material.stress("uniaxial", 2)) == 0


@pytest.mark.quick
@MATERIAL
def test_compiled_energy_has_the_closed_form_stress(material, exact):
    """The form that a scene compiles, on a block stretched equibiaxially: dW/dl = 2 P."""
    mesh = fx.mesh.disc(radius=1.0, thickness=0.5, elements=(2, 1))
    scene = fx.Scene(mesh=mesh, materials=material, supports=[fx.Symmetry("axis"), fx.Clamped("rim")])
    problem = Problem(scene)
    forms = problem.forms
    energy, x = forms.compile(forms.energy), problem.x.duplicate()
    u = forms.w.sub(0)

    def W(l):
        problem.set_state(x, 0.0)
        u.interpolate(lambda X: np.stack([(l - 1) * X[0], (l**-2 - 1) * X[1]]) / forms.length)
        forms.w.x.scatter_forward()
        return problem.assemble_scalar(energy) * forms.stress
    for l in (1.0, 1.003, 1.2, 3.0):
        slope = (W(l - 2e-4) - 8 * W(l - 1e-4) + 8 * W(l + 1e-4) - W(l + 2e-4)) / 12e-4
        assert slope == pytest.approx(2 * exact["equibiaxial"](l), rel=1e-9, abs=1e-10)


def test_eight_chain_against_the_inverse_langevin_function():
    """The approximation is within 0.28 % of the function for all y; so is the stress, and the modulus series."""
    mu, N = 0.3, 25.0
    chain = np.linspace(0.01, 0.999, 300)
    W1 = np.array([mu * N * inverse_langevin(y) / (6 * N * y) for y in chain])
    error = eight_chain(mu, N)(3 * N * chain**2) / W1 - 1
    assert 0.0025 < np.abs(error).max() < 0.0028
    material = fx.ArrudaBoyce(mu=mu, N=N)
    l = np.linspace(1.01, 0.999 * material.largest_stretch("uniaxial"), 50)
    exact = [2 * (s - s**-2) * mu * N * inverse_langevin(y) / (6 * N * y)
             for s, y in zip(l, np.sqrt((l**2 + 2 / l) / (3 * N)))]
    assert np.abs(material.stress("uniaxial", l) / exact - 1).max() < 0.0028
    series = mu * (1 + 3 / (5 * N) + 99 / (175 * N**2) + 513 / (875 * N**3))
    assert material.shear_modulus == pytest.approx(series, rel=5e-4)


def _powers():
    """sum_of_powers of F = [[F0, F1, 0], [F2, F3, 0], [0, 0, F4]], its gradient and Hessian, as numpy operations."""
    mesh = ufl.Mesh(basix.ufl.element("Lagrange", "triangle", 1, shape=(2,)))
    inputs = [ufl.Constant(mesh) for _ in range(6)]
    f = [ufl.variable(x) for x in inputs[:5]]
    F = ufl.as_tensor([[f[0], f[1], 0], [f[2], f[3], 0], [0, 0, f[4]]])
    W = expand_indices(expand_derivatives(kinematics.sum_of_powers(F, inputs[5])))
    first = [expand_derivatives(ufl.diff(W, x)) for x in f]
    return _Program(inputs, [W, *first, *(expand_derivatives(ufl.diff(g, x)) for g in first for x in f)])


def _exact_powers(mp, F, alpha):
    """Derivatives by finite differences in arithmetic of 90 digits."""
    x, h = [mp.mpf(float(v)) for v in F], mp.mpf(10) ** -20 * max(abs(v) for v in F)

    def f(shift):
        p, q, r, s, t = (v + h * int(n) for v, n in zip(x, shift))
        A, B, D = p * p + r * r, q * q + s * s, p * q + r * s
        large = (A + B) / 2 + mp.sqrt(((A - B) / 2) ** 2 + D * D)
        return large ** (alpha / 2) + ((p * s - q * r) ** 2 / large) ** (alpha / 2) + t**alpha
    e = np.eye(5, dtype=int)
    gradient = [(f(a) - f(-a)) / (2 * h) for a in e]
    hessian = [(f(a + b) - f(a - b) - f(b - a) + f(-a - b)) / (4 * h * h) for a in e for b in e]
    return float(f(0 * e[0])), np.array(gradient, float), np.array(hessian, float)


@pytest.mark.parametrize("alpha", [-5.0, -2.0, -0.5, 1.3, 2.0, 5.0, 10.0])
def test_sum_of_powers_in_high_precision(alpha):
    """Value, gradient, Hessian: at equal stretches, on both sides of the switch (d/m = 0.01), in thin sheets."""
    mp = pytest.importorskip("mpmath")
    mp.mp.dps = 90
    program, rng = _powers(), np.random.default_rng(3)

    def turn(t):
        return np.array([[np.cos(t), -np.sin(t)], [np.sin(t), np.cos(t)]])
    for ratio in (0, 1e-14, 1e-8, 1e-3, 0.00999999, 0.01000001, 0.03, 0.3, 0.99, 1 - 1e-5):
        for turned in (0, 1):
            m = 10 ** rng.uniform(-2, 1.5)
            a, b = turned * rng.uniform(0, 6, 2)
            F = turn(a) @ np.diag(np.sqrt([m * (1 + ratio), m * (1 - ratio)])) @ turn(b)
            F = np.append(F.ravel(), math.sqrt(m))
            found = program(F[:3, None], [F[3], F[4], alpha])[:, 0]
            for part, exact in zip((found[0], found[1:6], found[6:]), _exact_powers(mp, F, alpha)):
                # what remains at 1 - 1e-5 is the round-off of det F in a turned F
                assert np.linalg.norm(part - exact) < (5e-14 if ratio < 0.999 else 1e-10) * np.linalg.norm(exact)


def test_energy_of_ogden_at_changed_volume():
    """A term of a negative exponent has the stretch of the area across each direction: (l2 l3)^2 for alpha = -2."""
    stretches, (c, s) = np.array([1.7, 0.6, 1.3]), (np.cos(0.4), np.sin(0.4))
    turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    rubber = fx.Ogden(mu=(1.4, -0.3), alpha=(2.5, -2.0))
    F = ufl.as_matrix((turn @ np.diag(stretches) @ turn.T).tolist())
    exact = 1.4 / 2.5 * (np.sum(stretches**2.5) - 3) + 0.15 * (np.sum((stretches.prod() / stretches) ** 2) - 3)
    assert float(rubber.strain_energy(F, **rubber.parameters)(())) == pytest.approx(exact, rel=1e-12)


@pytest.mark.parametrize("alpha", [1.3, *(pytest.param(a, marks=pytest.mark.thorough) for a in (-2.0, 2.0, 5.0))])
def test_powers_for_every_perturbation(alpha):
    """Derivatives by all nine entries of F, where two, three or no stretches are equal."""
    mp = pytest.importorskip("mpmath")
    mp.mp.dps = 60
    mesh = ufl.Mesh(basix.ufl.element("Lagrange", "triangle", 1, shape=(2,)))
    inputs = [ufl.Constant(mesh) for _ in range(10)]
    f = [ufl.variable(x) for x in inputs[:9]]
    F = ufl.as_tensor([f[:3], f[3:6], f[6:]])
    e, h = np.eye(9, dtype=int), mp.mpf(10) ** -15
    upper = [(i, j) for i in range(9) for j in range(i, 9)]
    for of, exact in ((kinematics.sum_of_powers(F, inputs[9]),
                       lambda A: sum(x ** (alpha / 2) for x in mp.eigsy(A.T * A, eigvals_only=True))),
                      (kinematics.volume_ratio(F), mp.det)):
        W = expand_indices(expand_derivatives(of))
        first = [expand_derivatives(ufl.diff(W, x)) for x in f]
        program = _Program(inputs, [W, *first, *(expand_derivatives(ufl.diff(first[i], f[j])) for i, j in upper)])
        for turned in (0.0, 0.7):
            for stretches in ((1, 1, 1), (2, 2, 0.25), (2, 0.25, 2), (3, 0.2, 1.4), (1 + 1e-9, 1, 1)):
                c, s = np.cos(turned), np.sin(turned)
                at = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]) @ np.diag(stretches)
                at[:2, :2] = at[:2, :2] @ np.array([[c, s], [-s, c]])
                x = [mp.mpf(float(v)) for v in at.ravel()]

                def value(shift, x=x, exact=exact):
                    return exact(mp.matrix(3, 3) + mp.matrix([[x[3 * i + j] + h * int(shift[3 * i + j])
                                                               for j in range(3)] for i in range(3)]))
                found = program(at.ravel()[:8, None], [at[2, 2], alpha])[:, 0]
                wanted = [value(0 * e[0]), *((value(a) - value(-a)) / (2 * h) for a in e),
                          *((value(e[i] + e[j]) - value(e[i] - e[j]) - value(e[j] - e[i]) + value(-e[i] - e[j]))
                            / (4 * h * h) for i, j in upper)]
                wanted = np.array(wanted, float)
                assert np.linalg.norm(found - wanted) < 1e-7 * np.linalg.norm(wanted), (stretches, turned)


@pytest.mark.parametrize("alpha", [-5.0, 1.3, 10.0])
def test_second_derivatives_of_powers_do_not_jump(alpha):
    program, h = _powers(), 1e-9
    low, high = (program(np.sqrt([[1 + x], [0], [0]]), [np.sqrt(1 - x), 1.0, alpha])[:, 0]
                 for x in (0.01 * (1 - h), 0.01 * (1 + h)))
    assert np.all(np.isfinite(low)) and np.linalg.norm(low - high) < 1e-9 * np.linalg.norm(low)


@pytest.mark.parametrize("material", [fx.Gent(mu=1.0, Jm=20.0), fx.ArrudaBoyce(mu=1.0, N=8.0)],
                         ids=lambda m: type(m).__name__)
def test_stress_grows_up_to_the_limiting_stretch(material):
    """The stress grows without bound up to the limit; beyond it an error states the limit."""
    for mode in MODES:
        limit = material.largest_stretch(mode)
        assert material.stress(mode, limit * (1 - 1e-6)) > 1e3 * material.stress(mode, 0.9 * limit)
        with pytest.raises(fx.InputError, match=f"a stretch of {limit * 1.01:.6g} in {mode} tension is beyond its limit"
                                                f".*I1.*less than {material.largest_I1:g}.*less than {limit:.6g}"):
            material.stress(mode, [1.2, limit * 1.01])
        stable = material.check_stability((0.9, 20))
        assert stable.finite[mode][1] == stable.drucker[mode][1] == pytest.approx(limit, rel=1e-6)


@pytest.mark.parametrize("material", [fx.Gent(mu=1.0, Jm=20.0), fx.ArrudaBoyce(mu=1.0, N=8.0)],
                         ids=lambda m: type(m).__name__)
def test_inflation_to_the_limit(material, caplog):
    """A step that is far too long leaves the domain, is halved, and the path goes on to 99.8 % of the limit.

    (On this mesh the quadrature points come to the limit when the pole itself is at 99.88 % of it; where they lock,
    one row of elements does not keep its volumes, which ends a run without `allow_inadmissible`.)
    """
    mesh = fx.mesh.disc(radius=1.25, thickness=0.082, elements=(10, 1))
    scene = fx.Scene(mesh=mesh, materials=material, supports=[fx.Symmetry("axis"), fx.SimplySupported("rim")],
                     loads=[fx.Pressure("bottom")])
    limit = material.largest_stretch("equibiaxial")
    caplog.set_level("INFO", "formingx")
    path = fx.trace(scene, until=fx.pole_stretch(0.998 * limit), step=fx.StepControl(length=2.0),
                    allow_inadmissible=True)
    assert "volumes" in path.last.inadmissible_reason and not path.states[len(path) // 2].inadmissible_reason
    assert path.counts.failures >= 1 and "was stretched beyond its limit, I1 <" in caplog.text
    assert path.counts.steps < 40 and path.last.measures["pole_stretch"] == pytest.approx(0.998 * limit, rel=1e-8)


    name = type(material).__name__
    with pytest.raises(fx.InputError, match=rf"pole stretch = {limit:g}: must be less than {limit:.6g}, where"
                                            rf" I1 reaches the limit {material.largest_I1:g} of {name}"):
        fx.trace(scene, until=fx.pole_stretch(limit))


def test_stability_bounds_are_the_closed_ones():
    # P = mu (l^(a-1) - l^(-a/2-1)) with a = -1, mu < 0: dP/dl = 0 at l^(3/2) = 4; sums of exponentials are convex
    found = fx.Ogden(mu=-1.0, alpha=-1.0).check_stability((0.2, 8.0))
    assert found.load["uniaxial"] == pytest.approx((0.2, 4 ** (2 / 3)), rel=1e-9)
    assert found.load["pure_shear"] == (0.2, 8.0) and not found.stable
    assert found.drucker == {mode: (0.2, 8.0) for mode in MODES}
    assert "uniaxial: the force rises only at stretches from 0.2 to 2.5198" in str(found)
    # an energy that softens: its force has a maximum, and its Kirchhoff stress later
    a, b = 1.0, 0.01
    soft = fx.Hyperelastic(lambda I1, I2, a, b: a * (I1 - 3) - b * (I1 - 3) ** 2, a=a, b=b).check_stability((0.9, 9.0))

    def slope(l):                        # of P = 2 (l - l^-3) (a - 2 b (l - 1/l)^2)
        return (1 + 3 * l**-4) * (a - 2 * b * (l - 1 / l) ** 2) - (l - l**-3) * 4 * b * (l - 1 / l) * (1 + l**-2)
    assert soft.load["pure_shear"][1] == pytest.approx(brentq(slope, 2, 8), rel=1e-9)
    assert soft.drucker["pure_shear"][1] > soft.load["pure_shear"][1]


@pytest.mark.parametrize("material", [m for m, _ in CASES if type(m) in (
    fx.NeoHookean, fx.MooneyRivlin, fx.Gent, fx.ArrudaBoyce)], ids=lambda m: type(m).__name__)
def test_convex_energies_are_stable(material):
    assert material.check_stability((0.5, 5.0)).stable
    assert "stable at stretches from 0.5 to 5" in str(material.check_stability([0.5, 2, 5.0]))


def test_plot():
    axes = fx.Gent(mu=0.3, Jm=80.0).plot(unit="MPa")
    assert [line.get_label() for line in axes.lines] == ["uniaxial", "pure shear", "equibiaxial"]
    assert axes.get_ylabel() == "nominal stress (MPa)" and axes.get_xlabel() == "stretch"
    assert fx.NeoHookean(c10=1.0).plot(axes, stretches=[1, 2]) is axes


def test_isotropy_holds_for_every_material():
    for (material, _), l in itertools.product(CASES, ([1.3, 0.9], [2.0, 1.1])):
        P, Q = (material.response.stress(np.array([[a], [b]]), material.parameters.values())[:, 0]
                for a, b in (l, l[::-1]))
        assert P[::-1] == pytest.approx(Q, rel=1e-12)


def test_published_constants():
    """Each set has a source with a year, and the modulus of the source in MPa."""
    found = fx.published()
    assert all(re.search(r"(19|20)\d\d", p.source) and p.unit == "MPa" for p in found.values() if p.unit == "MPa")
    c10 = {name: p.material.parameters["c10"] for name, p in found.items() if p.unit == "MPa"}
    melt = found["LDPE melt 150 C"]
    assert melt.unit == "Pa" and melt.material.relaxation_modulus(0.0) == pytest.approx(320971)
    assert c10["PMMA 160 C"] == pytest.approx(0.448, abs=5e-4)             # as given in MPa beside the psi
    assert c10["natural rubber, 0.25 mm"] == pytest.approx(0.1213, abs=5e-5)
    assert c10["natural rubber, 0.76 mm"] == pytest.approx(0.1731, abs=5e-5)
    assert c10["natural rubber, Mooney"] == pytest.approx(0.143, abs=5e-4)
    assert found["natural rubber, Mooney"].material.parameters["c01"] == pytest.approx(0.03327, abs=5e-6)
    sheet = found["natural rubber, Treloar's sheet"].material          # his own equibiaxial data below stretch 3
    l, P = (x[:10] for x in fx.treloar1944()["equibiaxial"])
    assert np.sqrt(np.mean((sheet.stress("equibiaxial", l) - P) ** 2)) < 0.03


@pytest.mark.parametrize("material", [fx.Gent(mu=0.3, Jm=40.0), fx.Viscoelastic(fx.NeoHookean(c10=0.1), [(0.3, 1.0)]),
                                      fx.KBKZ([(0.3, 1.0)], fx.PSM(10.0, 0.05), equilibrium=fx.NeoHookean(c10=0.1))],
                         ids=lambda m: type(m).__name__)
def test_any_two_stretches_and_true_stress(material):
    """The three tests agree with the biaxial test; swapped stretches swap the stresses; true stress is P l."""
    l = np.array([1.2, 2.0])
    for mode, other in (("uniaxial", l**-0.5), ("pure_shear", np.ones(2)), ("equibiaxial", l)):
        P = material.stress(stretches=(l, other))
        assert P[0] == pytest.approx(material.stress(mode, l), rel=1e-9)
        assert material.stress(mode, l, true=True) == pytest.approx(l * P[0], rel=1e-9)
        assert material.stress(stretches=(other, l), true=True) == pytest.approx((P * [l, other])[::-1], abs=1e-12)
    assert np.abs(material.stress(stretches=(l, l**-0.5))[1]).max() < 1e-12
    with pytest.raises(fx.InputError, match="must be .l1, l2."):
        material.stress(stretches=2.0)


@pytest.mark.parametrize("material, options, words", [
    (fx.Gent(mu=0.3, Jm=40.0), {}, ["largest stretch, equibiaxial", "4.637"]),
    (fx.KBKZ([(0.3, 1.0)], fx.PSM(10.0, 0.05), shift=fx.WLF(17.44, 51.6, 100.0)),
     {"temperatures": [100.0, 120.0]},
     ["stretch at which it ruptures when stretched suddenly, equibiaxial", "1.795",
      "<td>temperature</td><td>120</td>"])])
def test_material_report_is_one_page(tmp_path, material, options, words):
    """The card is one page with an embedded picture; an error names a missing temperature."""
    page = material.report(tmp_path / "card.html", **options).read_text()
    assert all(word in page for word in (*words, "data:image/png;base64,", "crystallisation")), page[:500]
    if options:
        with pytest.raises(fx.InputError, match="depend on the temperature: give temperatures"):
            material.report(tmp_path / "card.html")


OWN_LAWS = {
    "Alexander": lambda I1, I2: 0.3 * (I1 - 3) + 0.3 * ufl.ln((I2 - 3 + 0.2) / 0.2),
    "saturating": lambda I1, I2: 0.3 * (I1 - 3) + 0.02 * (1 - ufl.exp(-12 * (I2 - 3))),
    "small power of I1": lambda I1, I2: 0.5 * (I1 - 3 + 0.4) ** 0.5 + 0.1 * (I2 - 3),
    "stiff in volume": lambda I1, I2: 0.3 * (I1 - 3) + 0.05 * (I2 - 3),
}


@pytest.mark.parametrize("name", OWN_LAWS)
def test_own_laws_of_invariants_run_as_solids(name):
    """The pressure of a thick sphere is that of the closed form, also of laws that do not resist a volume change."""
    from scipy.integrate import quad
    material = fx.Hyperelastic(OWN_LAWS[name])
    assert material._isochoric is (name != "stiff in volume")
    mesh = fx.mesh.sphere(inner_radius=1.0, thickness=0.5, elements=(6, 2))
    scene = fx.Scene(mesh=mesh, materials=material, loads=[fx.Pressure("inner")],
                     supports=[fx.Symmetry("axis"), fx.Symmetry("equator", "z")])
    path = fx.trace(scene, until=fx.displacement(1.0, at=(0.0, 1.0)), progress=False)

    def slope(R):
        """dp/dR, from the Kirchhoff stress of an equibiaxial stretch r/R, with r^3 = R^3 + 7."""
        r = (R**3 + 7) ** (1 / 3)
        return 2 * material.stress("equibiaxial", r / R) * r / R * R**2 / r**3
    exact, _ = quad(slope, 1.0, 1.5)
    assert path["pressure"][-1] == pytest.approx(exact, rel=1e-3)
