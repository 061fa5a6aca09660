"""The factorised K-BKZ equation in homogeneous tests: closed forms, the network without damping, small strains."""

import numpy as np
import pytest

import formingx as fx

SPECTRUM = [(0.3, 0.5), (0.4, 5.0), (0.2, 60.0)]
DAMPINGS = [fx.PSM(alpha=12.0, beta=0.1), fx.Wagner(alpha=0.2, beta=0.15), fx.SoskeyWinter(alpha=0.1, a=0.2, b=1.4)]
MODES = {"uniaxial": -0.5, "pure_shear": 0.0, "equibiaxial": 1.0}
L = np.array([1.1, 1.5, 2.0, 3.0, 5.0])


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("rate", [0.01, 1.0, 100.0])
def test_without_damping_it_is_the_transient_network(mode, rate):
    network = fx.TransientNetwork(None, SPECTRUM)
    assert fx.KBKZ(SPECTRUM).constant_rate(mode, rate, L) == pytest.approx(network.constant_rate(mode, rate, L),
                                                                           rel=1e-6)


def test_stress_of_a_strain_history_with_jumps_and_unloading():
    times, l = [0, 0, 1, 3, 3, 3.001, 50], [1.2, 2, 3, 3, 1.5, 2.5, 2.5]
    network = fx.TransientNetwork(None, SPECTRUM).stress("uniaxial", l, times=times)
    assert fx.KBKZ(SPECTRUM).stress("uniaxial", l, times=times) == pytest.approx(network, rel=1e-6, abs=1e-9)


@pytest.mark.parametrize("damping", DAMPINGS, ids=str)
@pytest.mark.parametrize("mode", MODES)
def test_a_step_of_strain_separates_time_and_strain(damping, mode):
    t, k = np.geomspace(1e-3, 300, 7), MODES[mode]
    melt = fx.KBKZ(SPECTRUM, damping)
    for l in L:
        squares = np.array([l**2, l ** (2 * k), l ** (-2 - 2 * k)])
        h = damping(squares.sum(), (1 / squares).sum())
        expected = melt.relaxation_modulus(t) * h * (squares[0] - squares[2]) / l
        assert melt.relaxation(mode, l, t) == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("damping", DAMPINGS[:1], ids=str)
@pytest.mark.parametrize("mode", MODES)
def test_small_strains_are_linear(damping, mode):
    """Nominal stress (4 + 2 k) e G where e is put on at once: here at a rate, integral of G(t - t') de."""
    rate, e, k = 0.7, 1e-5, MODES[mode]
    G, tau = np.array(SPECTRUM).T
    expected = (4 + 2 * k) * rate * np.sum(G * tau * (1 - np.exp(-e / rate / tau)))
    assert fx.KBKZ(SPECTRUM, damping).constant_rate(mode, rate, [np.exp(e)])[0] == pytest.approx(expected, rel=1e-4)


@pytest.mark.parametrize("damping", DAMPINGS, ids=str)
def test_steady_extension(damping):
    """After many relaxation times the stress is the integral over all ages: by another rule, and without a start."""
    from scipy.integrate import quad
    rate, G, tau = 0.4, 2.0, 1.0
    melt = fx.KBKZ([(G, tau)], damping)

    def integrand(s):
        l = np.exp(rate * s)
        return G / tau * np.exp(-s / tau) * (l**2 - 1 / l) * damping(l**2 + 2 / l, l**-2 + 2 * l)
    l = np.exp(rate * 40.0)
    found = melt.constant_rate("uniaxial", rate, [l])[0] * l
    assert found == pytest.approx(quad(integrand, 0, 60, epsabs=1e-12, epsrel=1e-10, limit=200)[0], rel=1e-6)


def test_sudden_and_slow_stretches_have_their_limits():
    melt = fx.KBKZ(SPECTRUM, DAMPINGS[0])
    assert melt.constant_rate("equibiaxial", 1e7, L) == pytest.approx(melt.stress("equibiaxial", L), rel=1e-5)
    assert melt.stress("uniaxial", 2.0) == pytest.approx(melt.relaxation("uniaxial", 2.0, 0.0))
    assert "PSM(alpha=12.0" in str(melt)


def test_soskey_and_winter_with_the_power_2_is_psm():
    I1, I2 = np.array([3.0, 5.0, 40.0]), np.array([3.0, 4.0, 12.0])
    for found, expected in zip(fx.SoskeyWinter(alpha=0.3, a=0.125, b=2.0).derivatives(I1, I2),
                               fx.PSM(alpha=8.0, beta=0.3).derivatives(I1, I2)):
        assert found == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("damping", [None, *DAMPINGS], ids=str)
def test_shear_at_a_constant_rate(damping):
    """By another rule; without damping G tau rate (1 - exp(-t/tau)), which a damping lowers."""
    from scipy.integrate import quad
    rate, t = 3.0, 4.0
    found = fx.KBKZ(SPECTRUM, damping).shear(rate, [t])[0]

    def slope(s):                                           # by parts: the integral of G d(h strain)/dt
        def strained(x):
            return x * (1.0 if damping is None else damping(3 + x**2, 3 + x**2))
        return sum(G * np.exp(-s / tau) for G, tau in SPECTRUM) * (strained(rate * s + 1e-5) - strained(
            rate * s - 1e-5)) / 2e-5 * rate
    assert found == pytest.approx(quad(slope, 0, t, limit=200)[0], rel=1e-6)
    lodge = sum(G * tau * rate * -np.expm1(-t / tau) for G, tau in SPECTRUM)
    assert found == pytest.approx(lodge, rel=1e-9) if damping is None else found < 0.9 * lodge


def test_damping_functions_and_their_slopes():
    """h as its authors write it, from the invariants of a strain, and its derivatives by both invariants."""
    I1, I2, h = 7.0, 9.0, 1e-5
    s, J = np.sqrt(0.3 * I1 + 0.7 * I2 - 3), 0.4 * I1 + 0.6 * I2 - 3
    for law, exact in ((fx.PSM(8.0, 0.3), 8 / (5 + 0.3 * I1 + 0.7 * I2)), (fx.Wagner(0.3, 0.2), np.exp(-0.2 * s)),
                       (fx.DoubleWagner(0.3, 0.6, 0.3, 0.1), 0.6 * np.exp(-0.3 * s) + 0.4 * np.exp(-0.1 * s)),
                       (fx.SoskeyWinter(0.4, 0.2, 1.5), 1 / (1 + 0.2 * J**0.75))):
        value, by_I1, by_I2 = law.derivatives(I1, I2)
        assert value == law(I1, I2) == pytest.approx(exact, rel=1e-12)
        assert by_I1 == pytest.approx((law(I1 + h, I2) - law(I1 - h, I2)) / (2 * h), rel=1e-7)
        assert by_I2 == pytest.approx((law(I1, I2 + h) - law(I1, I2 - h)) / (2 * h), rel=1e-7)


def test_shear_starts_without_stress():
    """Without damping the stress is a sum of G tau rate (1 - exp(-t/tau)); negative times are refused."""
    melt, rate, t = fx.KBKZ(SPECTRUM), 3.0, np.array([0.0, 1e-9, 1e-4])
    expected = [sum(G * tau * rate * -np.expm1(-time / tau) for G, tau in SPECTRUM) for time in t]
    assert melt.shear(rate, t) == pytest.approx(expected, rel=1e-12, abs=0)
    with pytest.raises(fx.InputError, match=r"shear: times = \[0.0, -1.0\]: must not be negative"):
        melt.shear(rate, [0.0, -1.0])
    for times in ([[0.0, 1.0]], [[]]):
        with pytest.raises(fx.InputError, match=r"shear: times = .*: must not be negative, of shape \(n,\)"):
            melt.shear(rate, times)
