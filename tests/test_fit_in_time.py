"""Fits to tests in time: constants recovered, what the data leave open, bad input."""

import numpy as np
import pytest

import formingx as fx

T, L = np.geomspace(0.05, 40, 25), np.linspace(1.1, 3.5, 13)


def relaxation(material, mode, stretch, times=T, noise=0.0):
    P = material.relaxation(mode, stretch, times)
    return fx.TimedTest.relaxation(mode, stretch, times, P * (1 + noise * np.random.default_rng(3).normal(size=len(P))))


def rates(material, mode, rate, noise=0.0):
    P = material.constant_rate(mode, rate, L)
    return fx.TimedTest.constant_rate(mode, rate, L, P * (1 + noise * np.random.default_rng(4).normal(size=len(P))))


P1 = fx.Viscoelastic(fx.NeoHookean(c10=0.05), [(0.3, 0.5), (0.4, 5.0)])


@pytest.mark.parametrize("law, stress, time", [
    (fx.Viscoelastic, 1.0, 1.0),
    pytest.param(fx.TransientNetwork, 1.0, 1.0, marks=pytest.mark.slow),
    pytest.param(fx.Viscoelastic, 1e6, 1 / 3600, marks=pytest.mark.slow),
    pytest.param(fx.TransientNetwork, 1e6, 1 / 3600, marks=pytest.mark.slow)])
def test_constants_are_recovered(law, stress, time):
    """Relaxation and three rates in two modes determine all constants and the number of branches, in any units."""
    material = law(fx.NeoHookean(c10=0.05 * stress), [(0.3 * stress, 0.5 * time), (0.4 * stress, 5.0 * time)])
    data = [relaxation(material, "uniaxial", 2.0, T * time)]
    data += [rates(material, mode, rate / time) for mode in ("uniaxial", "equibiaxial") for rate in (0.1, 1, 10)]
    found = fx.fit(law, data)
    assert found.material.parameters == pytest.approx(material.parameters, rel=1e-4)
    assert found.rms_total < 1e-5 * stress and found.undetermined == () and len(found.rms) == 7
    assert isinstance(found.material, law) and all(0 <= e < 1e-3 * found.material.parameters[k]
                                                   for k, e in found.errors.items())


@pytest.mark.slow
def test_other_equilibrium_and_no_equilibrium():
    material = fx.Viscoelastic(fx.Gent(mu=0.1, Jm=30.0), [(0.5, 2.0)])
    data = [rates(material, "uniaxial", rate) for rate in (0.01, 1)] + [relaxation(material, "equibiaxial", 2.5)]
    guess = fx.Viscoelastic(fx.Gent(mu=1.0, Jm=100.0), [(1.0, 1.0)])
    assert fx.fit(guess, data).material.parameters == pytest.approx(material.parameters, rel=1e-3)
    melt = fx.Viscoelastic(None, [(0.5, 2.0)])
    found = fx.fit(fx.Viscoelastic(None, [(1.0, 1.0)]), [rates(melt, "uniaxial", 1.0), rates(melt, "uniaxial", 0.1)])
    assert found.material.parameters == pytest.approx(melt.parameters, rel=1e-4)


@pytest.mark.slow
def test_constants_are_recovered_from_noisy_tests():
    """With 2 % noise, constants are within 5 %, the misfit equals the noise, and there is no third branch."""
    data = [relaxation(P1, "uniaxial", 2.0, noise=0.02)] + [rates(P1, "uniaxial", r, 0.02) for r in (0.1, 1, 10)]
    found = fx.fit(fx.Viscoelastic, data)
    assert len(found.material.branches) == 2
    assert found.material.parameters == pytest.approx(P1.parameters, rel=0.05)
    measured = np.concatenate([t.stress[1:] for t in data])
    assert 0.01 < found.rms_total / np.sqrt(np.mean(measured**2)) < 0.025


def test_undetermined_branches_are_named():
    """A fast test alone determines neither the time of the slow branch nor the equilibrium modulus."""
    fast = fx.fit(P1, [rates(P1, "uniaxial", 100.0)])
    assert {"tau_2", "c10"} <= set(fast.undetermined) and "do not determine" in str(fast)
    assert fx.fit(P1, [relaxation(P1, "uniaxial", 2.0), rates(P1, "uniaxial", 1.0)]).undetermined == ()


@pytest.mark.slow
def test_too_many_branches_are_named():
    assert fx.fit(fx.Viscoelastic, [relaxation(P1, "uniaxial", 2.0), rates(P1, "uniaxial", 1.0)], terms=4).undetermined


def test_from_a_file_and_drawn(tmp_path):
    """Tests in time are read from a file, with empty cells for unmeasured stresses, and drawn in two panels."""
    l = np.append(1, L)
    pulled = P1.stress("uniaxial", l, times=np.log(l))
    tests = [relaxation(P1, "uniaxial", 2.0), fx.TimedTest("uniaxial", np.log(l), l, pulled)]
    rows = [f"{t.mode};{l!r};{'' if np.isnan(P) else repr(float(P))};{time!r}"
            for t in tests for l, P, time in zip(*(np.asarray(x).tolist() for x in (t.stretches, t.stress, t.times)))]
    (tmp_path / "tests.csv").write_text("test;stretch;stress;time\n# made up\n" + "\n".join(rows))
    found = fx.fit(P1, tmp_path / "tests.csv")
    assert list(found.rms) == ["1 uniaxial", "2 uniaxial"] and found.points == 39
    assert found.material.parameters == pytest.approx(P1.parameters, rel=1e-4)
    held, pulled = found.plot(unit="MPa")
    assert held.get_xscale() == "log" and pulled.get_xlabel() == "stretch" and len(held.lines) == len(pulled.lines) == 2
    with pytest.raises(fx.InputError, match="axes: 1 given: these tests need 2"):
        found.plot(held)
    with pytest.raises(fx.InputError, match="has times"):
        fx.fit(fx.Gent, tmp_path / "tests.csv")


@pytest.mark.slow
def test_result_is_admissible():
    """For tests that soften more than any such material, moduli and times are positive."""
    data = fx.TimedTest.relaxation("uniaxial", 2.0, T, 1 / (1 + T) - 0.05)
    found = fx.fit(fx.Viscoelastic, [data], terms=3)
    assert all(mu > 0 and tau > 0 for mu, tau in found.material.branches)
    assert found.material.equilibrium.parameters["c10"] >= 0


@pytest.mark.parametrize("first", [0.05, 3.0])
def test_a_constant_stretch_is_applied_at_time_0(first):
    """A constant stretch whose rows begin later was applied at time 0: else G(0) would be 12 % too low."""
    exact = fx.Viscoelastic(fx.NeoHookean(c10=0.2), branches=[(0.4, 1.0)])
    times = first * np.geomspace(1, 100, 12)
    stress = exact.relaxation("uniaxial", 1.5, times)
    found = fx.fit(fx.Viscoelastic, [fx.TimedTest("uniaxial", times, np.full(12, 1.5), stress)], terms=1).material
    assert found.relaxation_modulus(0.0) == pytest.approx(exact.relaxation_modulus(0.0), rel=1e-3)
    rising = np.linspace(1.5, 2.0, 12)
    with pytest.raises(fx.InputError, match="begins at time .* with a stretch of 1.5: since when"):
        fx.fit(fx.Viscoelastic, [fx.TimedTest("uniaxial", times, rising, stress)])


def moduli(omega, spectrum):
    x = omega[:, None] * np.array([tau for _, tau in spectrum])
    G = np.array([G for G, _ in spectrum])
    return (G * x**2 / (1 + x**2)).sum(1), (G * x / (1 + x**2)).sum(1)


def test_a_spectrum_has_the_moduli_and_the_relaxation_of_the_melt():
    """A fitted spectrum has the moduli, the viscosity and the relaxation of the melt, to the noise of 1 %."""
    melt = [(1e4 * tau**-0.4 * np.exp(-tau / 30), tau) for tau in np.geomspace(1e-3, 100, 23)]
    omega = np.geomspace(1e-3, 1e3, 60)
    storage, loss = (m * (1 + 0.01 * np.random.default_rng(2).standard_normal(60)) for m in moduli(omega, melt))
    found = fx.fit_spectrum(omega, storage, loss)
    assert found.deviation < 0.012 and all(G > 0 for G, _ in found.pairs)
    assert found.viscosity == pytest.approx(sum(G * tau for G, tau in melt), rel=0.01)
    t = np.geomspace(0.002, 40, 12)
    assert fx.KBKZ(found.pairs).relaxation_modulus(t) == pytest.approx(fx.KBKZ(melt).relaxation_modulus(t), rel=0.05)


@pytest.mark.parametrize("damping", [fx.PSM(alpha=8.0, beta=0.2), fx.Wagner(alpha=0.1, beta=0.25),
                                     fx.SoskeyWinter(alpha=0.1, a=0.3, b=1.5)], ids=str)
def test_a_damping_is_recovered(damping):
    melt = fx.KBKZ([(1e4, 0.3), (1e3, 8.0)], damping)
    l = np.exp(np.linspace(0.2, 2.2, 8))
    tests = [fx.TimedTest.constant_rate(mode, rate, l, melt.constant_rate(mode, rate, l))
             for mode, rate in (("uniaxial", 0.2), ("equibiaxial", 0.5))]
    first = type(damping)(**{name: 0.7 * getattr(damping, name) for name in damping.bounds})
    found = fx.fit(fx.KBKZ(melt.spectrum, first), tests)
    assert found.constants == pytest.approx({name: getattr(damping, name) for name in damping.bounds}, rel=1e-4)
    assert vars(found.material.damping) == found.constants and found.undetermined == ()
    assert found.material.tested.ranges["uniaxial"] == pytest.approx((l[0], l[-1]))
    assert found.material.tested.rates == pytest.approx((0.2, 0.5))


def test_one_mode_does_not_determine_the_share_of_the_invariants():
    """Uniaxial extension alone does not determine the share alpha of the invariants."""
    melt = fx.KBKZ([(1e4, 0.3), (1e3, 8.0)], fx.SoskeyWinter(alpha=0.02, a=0.3, b=1.5))
    l = np.exp(np.linspace(0.2, 2.0, 10))
    test = fx.TimedTest.constant_rate("uniaxial", 0.2, l, melt.constant_rate("uniaxial", 0.2, l))
    assert "alpha" in fx.fit(melt, [test]).undetermined


OMEGA = np.geomspace(1e-2, 1e2, 15)


def oscillation(material, mode="shear", shift=1.0):
    """Moduli of small oscillations from the sum over the branches, written here anew."""
    x = OMEGA[:, None] * shift * np.array([tau for _, tau in material.branches])
    mu, factor = np.array([mu for mu, _ in material.branches]), {"shear": 1.0, "uniaxial": 3.0}[mode]
    storage = material.equilibrium.shear_modulus + (x**2 / (1 + x**2)) @ mu
    return fx.OscillationTest(OMEGA, factor * storage, factor * (x / (1 + x**2)) @ mu, mode)


@pytest.mark.parametrize("mode", ["shear", "uniaxial"])
def test_oscillations_beside_a_tensile_test_give_the_constants(mode):
    found = fx.fit(fx.Viscoelastic, [oscillation(P1, mode), rates(P1, "uniaxial", 0.1)])
    assert found.material.parameters == pytest.approx(P1.parameters, rel=1e-4)
    assert found.shares["tau_1"][f"1 {mode} oscillation"] > 0.5 and max(found.deviations.values()) < 1e-5
    assert [panel.get_xscale() for panel in found.plot()] == ["linear", "log"]


def test_small_oscillations_are_the_limit_of_the_law_in_time():
    """A uniaxial strain 1e-4 sin(omega t), computed by the law in time, has the amplitude of the complex modulus."""
    omega, periods, n = 0.7, 40, 4000
    t = np.linspace(0, periods * 2 * np.pi / omega, n + 1)
    stress = P1.stress("uniaxial", 1 + 1e-4 * np.sin(omega * t), times=t) / 1e-4
    last = slice(n - n // periods + 1, None)
    moduli = [2 * np.mean(stress[last] * wave(omega * t[last])) for wave in (np.sin, np.cos)]
    test = fx.OscillationTest([omega, 2 * omega], [moduli[0], np.nan], [moduli[1], np.nan], "uniaxial")
    assert fx.fit(P1, [test, oscillation(P1)]).deviations["1 uniaxial oscillation"] < 3e-3


def test_oscillations_at_several_temperatures_give_the_shift():
    true = fx.WLF(6.0, 90.0, 130.0)
    tests = [oscillation(P1, shift=float(true(T))) for T in (118.0, 130.0, 150.0)]
    found = fx.fit(fx.Viscoelastic, tests, temperature=[118.0, 130.0, 150.0], reference=130.0)
    assert found.shift(np.array([118.0, 150.0])) == pytest.approx(true(np.array([118.0, 150.0])), rel=1e-3)
    assert found.constants["mu_2"] == pytest.approx(0.4, rel=1e-3) and len(found.material.branches) == 2


def test_low_moduli_count_as_much_as_high_ones():
    """The modulus at 0.01 /s is 1e-4 of the highest; its misfit is relative to itself, also beside errors of 2 %."""
    x = OMEGA[:, None] * np.array([0.01, 100.0])
    mu = np.array([1e5, 10.0])
    wrong = 1 + 0.02 * np.where(OMEGA > 1.0, np.cos(np.arange(len(OMEGA))), 0.0)
    test = fx.OscillationTest(OMEGA, wrong * ((x**2 / (1 + x**2)) @ mu), wrong * ((x / (1 + x**2)) @ mu))
    found = fx.fit(fx.TransientNetwork(None, [(1e4, 0.1), (1e3, 10.0)]), [test])
    assert found.constants["mu_2"] == pytest.approx(10.0, rel=0.02)


@pytest.mark.parametrize("test, message", [
    (fx.OscillationTest([1.0, 2.0], [1.0, 2.0], [1.0]), "have the shapes"),
    (fx.OscillationTest([1.0, 2.0], [1.0, 2.0], [1.0, -1.0]), "must be above 0"),
    (fx.OscillationTest([1.0, 2.0], [1.0, 2.0], [1.0, 1.0], "bending"), "mode 'bending'")])
def test_wrong_oscillations(test, message):
    with pytest.raises(fx.InputError, match=message):
        fx.fit(fx.Viscoelastic, [test])


def test_oscillations_do_not_determine_a_damping():
    with pytest.raises(fx.InputError, match="fit_spectrum fits the spectrum"):
        fx.fit(fx.KBKZ([(1.0, 1.0)], fx.PSM(alpha=10.0, beta=0.1)), [oscillation(P1)])
