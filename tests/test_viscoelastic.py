"""Viscoelastic materials: potential of a step by differences, order in time, limits, dissipation, tests, errors."""

import functools
import math

import basix.ufl
import numpy as np
import pytest
import ufl
from scipy.integrate import quad, solve_ivp
from ufl.algorithms import expand_derivatives, expand_indices

import formingx as fx
from formingx.materials.homogeneous import MODES, _Program
from formingx.materials.viscoelastic import TransientNetwork, Viscoelastic

RUBBER = fx.NeoHookean(c10=0.05)
P0, P1 = [(0.5, 1.0)], [(0.3, 0.5), (0.4, 5.0)]
KINDS = {"second": Viscoelastic, "first": functools.partial(Viscoelastic, order=1), "network": TransientNetwork}
LAWS = pytest.mark.parametrize("law", KINDS.values(), ids=KINDS)
SHEAR = np.array([[1.9, 0.7, 0], [-0.2, 0.8, 0], [0, 0, 0.62]])


def matrix(v):
    return np.array([[v[0], v[2], 0], [v[2], v[1], 0], [0, 0, v[3]]])


def isochoric(F):
    return np.linalg.det(F) ** (-2 / 3) * F.T @ F


@functools.cache
def program(kind, branches, what):
    """A quantity of a material's step as numpy operations, and the names of its tensors; constants are inputs."""
    material = KINDS[kind](RUBBER, [(1.0, 1.0)] * branches)
    mesh = ufl.Mesh(basix.ufl.element("Lagrange", "triangle", 1, shape=(2,)))
    sizes = {name: np.size(rest) for name, rest in material.internal.items()}
    inputs = [ufl.Constant(mesh) for _ in range(6 + sum(sizes.values()) + len(material.parameters))]
    f = [ufl.variable(x) for x in inputs[:5]]
    F = ufl.as_tensor([[f[0], f[1], 0], [f[2], f[3], 0], [0, 0, f[4]]])
    rest = iter(inputs[5:])
    state = {name: ufl.as_vector([next(rest) for _ in range(n)]) if n > 1 else next(rest) for name, n in sizes.items()}
    dt, *values = rest
    constants, names = dict(zip(material.parameters, values)), list(state)
    if what == "updated":
        after = material.updated(F, state, dt, **constants)
        assert set(after) == set(names)
        outputs = [v for name in names for v in (after[name] if sizes[name] > 1 else [after[name]])]
    elif what in ("stored_energy", "dissipation"):
        outputs = [getattr(material, what)(F, state, **constants)]
    elif what == "stress":
        W = expand_indices(expand_derivatives(material.step_energy(F, state, dt, **constants)))
        outputs = [ufl.diff(W, x) for x in f]
    else:
        outputs = [getattr(material, what)(F, state, dt, **constants)]
    return _Program(inputs, [expand_indices(expand_derivatives(ufl.as_ufl(x))) for x in outputs]), names


class Evaluated:
    """A material's UFL expressions as functions of numbers: F (3, 3), internal {name: (4,) or ()}, dt."""

    def __init__(self, material):
        self.material = material
        self.kind = "network" if isinstance(material, TransientNetwork) else "second" if "C" in material.internal \
            else "first"
        assert material.equilibrium is None or isinstance(material.equilibrium, fx.NeoHookean)
        self.constants = [*([] if material.equilibrium else [0.0]), *material.parameters.values()]

    def rest(self):
        return {name: np.array(value) for name, value in self.material.internal.items()}

    def __call__(self, what, F, internal, dt=0.0):
        steps, names = program(self.kind, len(self.material.branches), what)
        known = np.concatenate([[F[0, 0], F[0, 1], F[1, 0], F[1, 1], F[2, 2]], *map(np.ravel, internal.values()), [dt]])
        found = steps(known[:, None], self.constants)[:, 0]
        if what == "updated":
            rest = iter(found)
            return {name: np.array([next(rest) for _ in range(np.size(self.material.internal[name]))]).reshape(
                np.shape(self.material.internal[name])) for name in names}
        return found if len(found) > 1 else found[0]

    def run(self, history, times):
        """Internal state after steps through F(t)."""
        state = self.rest()
        for before, now in zip(times[:-1], times[1:]):
            state = self("updated", history(now), state, now - before)
        return state


def shear_history(t):
    """Deformation gradient of an extension with shear, fast at first, with det F other than 1."""
    s = 1 - np.exp(-2 * t)
    return np.eye(3) + s * (SHEAR - np.eye(3))


@LAWS
@pytest.mark.parametrize("dt", [0.0, 1e-9, 0.3, 7.0, 1e4])
def test_stress_is_the_derivative_of_the_energy(law, dt):
    """Central differences from a state after some flow; the tangent is symmetric."""
    material = Evaluated(law(RUBBER, P1))
    state = material.run(shear_history, np.linspace(0, 0.6, 7))
    h, places = 1e-3, [(0, 0), (0, 1), (1, 0), (1, 1), (2, 2)]

    def slope(what, place):
        def at(step):
            F = SHEAR.copy()
            F[place] += step * h
            return material(what, F, state, dt)
        return (at(3) - 9 * at(2) + 45 * at(1) - 45 * at(-1) + 9 * at(-2) - at(-3)) / (60 * h)
    stress, tangent = material("stress", SHEAR, state, dt), np.stack([slope("stress", p) for p in places])
    assert [slope("step_energy", p) for p in places] == pytest.approx(stress, abs=1e-11)
    assert tangent == pytest.approx(tangent.T, abs=1e-11)


@LAWS
@pytest.mark.parametrize("dt", [0.0, 0.3, 7.0, 1e3])
def test_stress_belongs_to_the_end_of_the_step(law, dt):
    """The derivative of the step potential equals that of the stored energy at constant updated tensors."""
    material = Evaluated(law(None, P1))
    state = material.run(shear_history, np.linspace(0, 0.6, 4))
    after, C = material("updated", SHEAR, state, dt), isochoric(SHEAR)
    S = sum(mu * (matrix(after[f"A_{k}"]) if "A_1" in after else np.linalg.inv(matrix(after[f"Cv_{k}"])))
            for k, (mu, _) in enumerate(P1, 1))
    S = S - np.sum(S * C) / 3 * np.linalg.inv(C)                          # what Cbar leaves of it
    P = np.linalg.det(SHEAR) ** (-2 / 3) * SHEAR @ S
    assert material("stress", SHEAR, state, dt) == pytest.approx(P[[0, 0, 1, 1, 2], [0, 1, 0, 1, 2]], rel=1e-11)


@pytest.mark.parametrize("order", [1, 2])
def test_step_solves_its_implicit_equation(order):
    """First order: Cv - Cv_n = x [C - tr(C Cv^-1)/3 Cv] up to the factor that keeps det Cv = 1; second: its formula."""
    material = Evaluated(Viscoelastic(None, P0, order=order))
    state, C, x = material.run(shear_history, np.linspace(0, 0.6, 4)), isochoric(SHEAR), 0.8
    n = matrix(state["Cv_1"])
    G, step = n, x
    if order == 2:
        before = matrix(state["C"])
        G, step = n + x / 2 * before, x / 2 * (1 + x / 3 * np.trace(before @ np.linalg.inv(n)))
    Cv = matrix(material("updated", SHEAR, state, x)["Cv_1"])
    b, a = np.linalg.det(G + step * C), np.linalg.det(G)
    assert Cv == pytest.approx((G + step * C) / np.cbrt(b), rel=1e-12)
    assert material("step_energy", SHEAR, state, x) == pytest.approx(
        1.5 * 0.5 * ((np.cbrt(b) - np.cbrt(a)) / step - 1), rel=1e-12)


@LAWS
@pytest.mark.parametrize("ratio", [1e-9, 1e-3, 1.0, 1e3, 1e9])
def test_steps_of_any_length(law, ratio):
    """det Cv = 1, positive definite, finite and never negative dissipation, through jumps and steps of length 0."""
    material = Evaluated(law(RUBBER, [(0.4 / k, 2.0**k) for k in range(1, 21)]))
    state = material.rest()
    F = SHEAR
    for step in range(12):
        state = material("updated", F, state, 0.0 if step % 4 == 3 else ratio)
        for name, v in state.items():
            if name in material.material.motion_variables:
                continue
            assert np.linalg.eigvalsh(matrix(v)).min() > 0
            if not name.startswith("A"):
                assert np.linalg.det(matrix(v)) == pytest.approx(1, rel=1e-12)
        assert material("dissipation", F, state) >= 0 and np.isfinite(material("dissipation", F, state))
        assert np.isfinite(material("step_energy", F, state, ratio))
        F = [SHEAR, SHEAR @ SHEAR, np.linalg.inv(SHEAR)][step % 3]


@LAWS
def test_steps_of_zero_and_infinite_length(law):
    material, rubber = Evaluated(law(RUBBER, P1)), Evaluated(law(RUBBER, [(1e-12, 1.0)]))
    at_once = material("stress", SHEAR, material.rest(), 0.0)
    C, J = isochoric(SHEAR), np.linalg.det(SHEAR)
    P = 0.1 * SHEAR + 0.7 * J ** (-2 / 3) * SHEAR @ (np.eye(3) - np.trace(C) / 3 * np.linalg.inv(C))
    assert at_once == pytest.approx(P[[0, 0, 1, 1, 2], [0, 1, 0, 1, 2]], rel=1e-12)
    assert material("step_energy", SHEAR, material.rest(), 0.0) == pytest.approx(
        0.05 * (np.sum(SHEAR**2) - 3) + 0.35 * (np.trace(C) - 3), rel=1e-12)
    relaxed = rubber("stress", SHEAR, rubber.rest(), 0.0)
    left = material("stress", SHEAR, material("updated", SHEAR, material.rest(), 0.0), 5e9) - relaxed
    assert np.abs(left).max() < 1e-8
    held = material.rest()
    for _ in range(60):
        held = material("updated", SHEAR, held, 5.0)
    assert np.abs(material("stress", SHEAR, held, 5.0) - relaxed).max() < 1e-8


def exact_tensor(law, tau, history, end):
    """Cv or A of a branch by integration of its nine components."""
    def rate(t, y):
        A, C = y.reshape(3, 3), isochoric(history(t))
        if law is TransientNetwork:
            return ((np.linalg.inv(C) - A) / tau).ravel()
        return ((C - np.trace(C @ np.linalg.inv(A)) / 3 * A) / tau).ravel()
    return solve_ivp(rate, (0, end), np.eye(3).ravel(), method="DOP853", rtol=1e-12, atol=1e-13).y[:, -1].reshape(3, 3)


@pytest.mark.parametrize("law, name, order", [
    (Viscoelastic, "Cv_1", 2), (lambda *a: Viscoelastic(*a, order=1), "Cv_1", 1), (TransientNetwork, "A_1", 3)],
    ids=["second", "first", "network"])
@pytest.mark.parametrize("jump", [False, True])
def test_order_in_time(law, name, order, jump):
    """Order of the error against the integrated law, also after a sudden deformation."""
    def history(t):
        return shear_history(t + 0.5 * jump)
    material = Evaluated(law(None, P0))
    exact = exact_tensor(law if law is TransientNetwork else Viscoelastic, 1.0, history, 1.5)

    def error(n):
        state = material("updated", history(0), material.rest(), 0.0)
        for i in range(n):
            state = material("updated", history(1.5 * (i + 1) / n), state, 1.5 / n)
        return np.abs(matrix(state[name]) - exact).max()
    errors = np.array([error(n) for n in (20, 40, 80, 160)])
    slopes = np.log2(errors[:-1] / errors[1:])
    assert errors[-1] < 1e-2 and slopes[-1] == pytest.approx(order, abs=0.06), (errors, slopes)


def test_order_in_time_of_steps_far_longer_than_tau():
    """The elastic strain is tau times the strain rate at the end of a step, with an error of second order."""
    tau, end = 1e-5, 1.5
    material = Evaluated(TransientNetwork(None, [(1 / tau, tau)]))
    (start, last), h = [np.linalg.inv(isochoric(shear_history(end + d))) for d in (-1e-5, 1e-5)], 1e-5
    exact = -(last - start) / (2 * h)                       # (A - C^-1)/tau, but for tau itself

    def error(n):
        state = material("updated", shear_history(0), material.rest(), 0.0)
        for i in range(n):
            state = material("updated", shear_history(end * (i + 1) / n), state, end / n)
        left = (matrix(state["A_1"]) - np.linalg.inv(isochoric(shear_history(end)))) / tau
        return np.abs(left - exact).max() / np.abs(exact).max()
    errors = np.array([error(n) for n in (20, 40, 80)])
    assert errors[0] < 0.02 and np.log2(errors[:-1] / errors[1:]) == pytest.approx(2, abs=0.15), errors


@pytest.mark.parametrize("law", [Viscoelastic, TransientNetwork])
def test_energy_balance(law):
    """Work = stored + dissipated along F(t), each by its own integral."""
    material = Evaluated(law(RUBBER, P1))
    imbalance = []
    for n in (50, 100):
        times, state, work, lost = np.linspace(0, 1.5, n + 1), material.rest(), 0.0, 0.0
        F, stress, rate = np.eye(3), np.zeros(5), 0.0
        stress = material("stress", F, state, 0.0)
        for before, now in zip(times[:-1], times[1:]):
            new = shear_history(now)
            after = material("stress", new, state, now - before)
            state = material("updated", new, state, now - before)
            change = (new - F)[[0, 0, 1, 1, 2], [0, 1, 0, 1, 2]]
            work += (stress + after) / 2 @ change
            power = material("dissipation", new, state)
            lost += (rate + power) / 2 * (now - before)
            F, stress, rate = new, after, power
        imbalance.append(work - lost - material("stored_energy", F, state))
        assert lost > 0.1 * work
    assert abs(imbalance[1]) < 1e-4 * work and imbalance[0] / imbalance[1] == pytest.approx(4, abs=0.2)


@LAWS
def test_small_strain_modulus(law):
    """G(t) = 2 c10 + sum mu exp(-t/tau), from the step and from the homogeneous test."""
    material = law(RUBBER, P1)
    steps, e = Evaluated(material), 1e-6
    F = np.array([[1, e, 0], [0, 1, 0], [0, 0, 1.0]])
    assert material.shear_modulus == pytest.approx(0.8) and material.relaxation_modulus(0.0) == pytest.approx(0.8)
    state, n = steps("updated", F, steps.rest(), 0.0), 500
    for _ in range(n):
        state = steps("updated", F, state, 2.0 / n)
    wanted = 0.1 + 0.3 * math.exp(-4) + 0.4 * math.exp(-0.4)
    assert steps("stress", F, state, 0.0)[1] / e == pytest.approx(wanted, rel=1e-5 if "C" in state else 2e-3)
    t = np.array([0, 0.1, 1, 2, 10])
    assert material.relaxation_modulus(t) == pytest.approx(0.1 + 0.3 * np.exp(-t / 0.5) + 0.4 * np.exp(-t / 5))
    for mode, factor in (("uniaxial", 3), ("pure_shear", 4), ("equibiaxial", 6)):
        P = material.relaxation(mode, 1 + 1e-3, t) - material.relaxation(mode, 1 - 1e-3, t)
        assert P / (factor * 2e-3) == pytest.approx(material.relaxation_modulus(t), rel=1e-5)


@pytest.mark.parametrize("mode", MODES)
def test_relaxation_by_quadrature(mode):
    """At constant C the law is solved by Cv = (I + s C)/det(I + s C)^(1/3), t = tau int ds/det(I + s C)^(1/3)."""
    material = Viscoelastic(RUBBER, [(0.5, 2.0)])
    for l in (0.5, 1.5, 3.0, 10.0):
        C = np.array([l, l ** MODES[mode], l ** (-1 - MODES[mode])]) ** 2
        s = np.array([0.0, 1e-4, 1e-2, 0.1, 1.0, 30.0])
        t = [2.0 * quad(lambda x, C=C: np.prod(1 + x * C) ** (-1 / 3), 0, end, epsabs=1e-13, epsrel=1e-13)[0]
             for end in s]
        Cv = (1 + s[:, None] * C) / np.prod(1 + s[:, None] * C, axis=1)[:, None] ** (1 / 3)
        wanted = RUBBER.stress(mode, l) + 0.5 * (C[0] / Cv[:, 0] - C[2] / Cv[:, 2]) / l
        assert material.relaxation(mode, l, t) == pytest.approx(wanted, rel=1e-8)


@pytest.mark.parametrize("law", [Viscoelastic, TransientNetwork])
@pytest.mark.parametrize("mode", MODES)
def test_stress_of_a_history_against_the_steps(law, mode):
    """Pulled, held, released suddenly, held: steps of second order converge to the integrated law."""
    material = law(RUBBER, P1)
    times, stretches = np.array([0, 1.0, 1.5, 1.5, 2.5]), np.array([1.2, 2.5, 2.5, 1.6, 1.6])
    found = material.stress(mode, stretches, times=times)
    steps, k = Evaluated(material), MODES[mode]

    def F(l):
        return np.diag([l, l**k, l ** (-1 - k)])

    def nominal(n):
        state = steps("updated", F(1.2), steps.rest(), 0.0)
        result = []
        for i in range(len(times)):
            if i:
                m = n if times[i] > times[i - 1] else 1
                for j in range(1, m + 1):
                    l = stretches[i - 1] + (stretches[i] - stretches[i - 1]) * j / m
                    state = steps("updated", F(l), state, (times[i] - times[i - 1]) / m)
            P = steps("stress", F(stretches[i]), state, 0.0)[[0, 3, 4]]
            result.append(P[0] - stretches[i] ** (-2 - k) * P[2])
        return np.array(result)
    coarse, fine = nominal(50), nominal(100)
    assert np.abs(fine - found).max() < 2e-4 * np.abs(found).max()
    assert np.abs((4 * fine - coarse) / 3 - found).max() < 4e-6 * np.abs(found).max()


def test_transient_network_at_a_constant_rate():
    """Upper-convected Maxwell, started up: c_1 = [1 - 2 r e^(-(1 - 2 r) t/tau)]/(1 - 2 r), r = rate tau; see Bird."""
    material, rate, l = TransientNetwork(None, [(0.5, 2.0)]), 0.4, np.array([1.1, 1.5, 2.0, 4.0])
    r, x = rate * 2.0, np.log(l) / (rate * 2.0)
    along, across = ((1 - s * r * np.exp(-(1 - s * r) * x)) / (1 - s * r) for s in (2, -1))
    assert material.constant_rate("uniaxial", rate, l) == pytest.approx(0.5 * (along - across) / l, rel=1e-8)
    across = (1 + 4 * r * np.exp(-(1 + 4 * r) * x)) / (1 + 4 * r)
    assert material.constant_rate("equibiaxial", rate, l) == pytest.approx(0.5 * (along - across) / l, rel=1e-8)


def test_steps_that_grow_do_not_amplify_errors():
    """An error of one step, over its length, is multiplied by s p/(1 + p) in the next, s times as long."""
    network = TransientNetwork(None, P0)
    state = {"C": ufl.as_vector([1.0, 1.0, 0.0, 1.0]), "change": ufl.as_vector([0.0] * 4)}
    for s in (0.1, 1.0, 2.0, 2.5, 3.0, 3.9, 5.0, 50.0):
        p = float(ufl.as_ufl(network._past(state | {"pace": ufl.as_ufl(2.0)}, ufl.as_ufl(s / 2.0))[2])(()))
        assert 0 <= s * p / (1 + p) <= 1
        assert s > 2 or p == pytest.approx(s / (1 + s))                        # BDF2 of second order


def test_viscosity_in_steady_extension():
    """The stress of a branch converges to 3 mu tau rate (uniaxial) and 6 mu tau rate (equibiaxial), at any rate."""
    for rate in (0.1, 5.0):
        l = np.array([math.exp(9 * max(rate, 1) + 2)])
        for mode, factor in (("uniaxial", 3), ("equibiaxial", 6)):
            P = Viscoelastic(None, [(0.5, 2.0)]).constant_rate(mode, rate, l)
            assert P * l == pytest.approx(factor * 0.5 * 2.0 * rate, rel=1e-4)


@pytest.mark.parametrize("law", [Viscoelastic, TransientNetwork])
def test_unit_of_time(law):
    seconds, hours = law(RUBBER, P1), law(RUBBER, [(mu, tau / 3600) for mu, tau in P1])
    t, l = np.array([0, 0.5, 2, 9.0]), np.array([1.0, 2, 3, 1.5])
    assert hours.stress("uniaxial", l, times=t / 3600) == pytest.approx(seconds.stress("uniaxial", l, times=t),
                                                                       rel=1e-8)
    a, b = Evaluated(seconds), Evaluated(hours)
    assert a("stress", SHEAR, a.rest(), 3.6) == pytest.approx(b("stress", SHEAR, b.rest(), 1e-3), rel=1e-13)
    assert b("dissipation", SHEAR, b.rest()) == pytest.approx(3600 * a("dissipation", SHEAR, a.rest()), rel=1e-13)


def test_a_stretch_between_times():
    """`between` names the quantity with a constant rate; with many times both choices agree."""
    material = Viscoelastic(RUBBER, P1)
    t, l = np.linspace(0, 1, 5), np.linspace(1, 3, 5)
    straight = material.stress("uniaxial", l, times=t)
    whole = material.stress("uniaxial", [1, 3], times=[0, 1])
    assert straight[-1] == pytest.approx(whole[-1], rel=1e-9)
    curved = material.stress("uniaxial", [1, 3], times=[0, 1], between="strain")
    assert curved[-1] == pytest.approx(material.constant_rate("uniaxial", math.log(3), [3.0])[0], rel=1e-9)
    assert abs(curved[-1] - whole[-1]) > 1e-3
    dense = np.exp(np.linspace(0, math.log(3), 200))
    assert material.stress("uniaxial", dense, times=np.linspace(0, 1, 200))[-1] == pytest.approx(curved[-1], rel=1e-5)


def test_as_a_material():
    """Without times the response is instantaneous; the relaxed material is the equilibrium; names of the constants."""
    material = Viscoelastic(fx.Gent(mu=0.1, Jm=80.0), P1)
    assert list(material.parameters) == ["mu", "Jm", "mu_1", "tau_1", "mu_2", "tau_2"]
    assert material.shear_modulus == pytest.approx(0.8) and material.rest_stress == pytest.approx(0.1)
    assert material.largest_I1 == 83 and material.branches == P1
    l = np.array([1.2, 2.0, 4.0])
    assert material.stress("uniaxial", l) == pytest.approx(
        material.equilibrium.stress("uniaxial", l) + fx.NeoHookean(c10=0.35).stress("uniaxial", l), rel=1e-12)
    assert material.relaxation("equibiaxial", 2.0, [1e4]) == pytest.approx(
        material.equilibrium.stress("equibiaxial", 2.0), rel=1e-8)
    other = material.with_constants([0.2, 60, 0.1, 1, 0.2, 2])
    assert other.equilibrium.parameters == {"mu": 0.2, "Jm": 60} and other.branches == [(0.1, 1), (0.2, 2)]
    assert material.equilibrium.parameters == {"mu": 0.1, "Jm": 80}
    assert material.constants_at([x for x, *_ in material.coordinates()]) == pytest.approx(
        list(material.parameters.values()))
    assert Viscoelastic(None, P0).shear_modulus == pytest.approx(0.5) and Viscoelastic(None, P0).rest_stress == 0
    assert "branches=[(0.3, 0.5), (0.4, 5.0)]" in str(material) and "Gent(mu=0.1" in str(material)


def test_plot():
    axes = Viscoelastic(RUBBER, P0).plot(rates=(0.1, 10), unit="MPa")
    at_once, fast, slow, relaxed = (line.get_ydata()[-1] for line in axes.get_lines())
    assert at_once > fast > slow > relaxed and axes.get_ylabel() == "nominal stress (MPa)"
