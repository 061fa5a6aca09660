"""Measure how far branches with Gaussian springs are from a K-BKZ melt, and the past states that K-BKZ needs.

Prints tables and writes results/kbkz_branches/summary.json, from which docs/make_pages.py takes the tables of
docs/kbkz.md. The melts are illustrative: a spectrum of five decades and two dampings, no measured material. Takes
seconds.
"""

import argparse
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "demos"))
from common import say, summarise  # noqa: E402

import formingx as fx  # noqa: E402

SPECTRUM = [(0.10, 0.01), (0.06, 0.1), (0.03, 1.0), (0.012, 10.0), (0.004, 100.0)]      # MPa, s
DAMPING = fx.PSM(alpha=10.0, beta=0.05)
MELT, MILDER = fx.KBKZ(SPECTRUM, DAMPING), fx.KBKZ(SPECTRUM, fx.Wagner(alpha=0.1, beta=0.15))
MODES, RATES, STRETCHES = ("uniaxial", "equibiaxial"), (0.1, 1.0, 10.0), (1.5, 2.0, 3.0, 5.0)


def measured(modes=MODES):
    """Return tests of the melt, as a laboratory would measure them."""
    l = np.linspace(1.1, 5.0, 14)
    return [fx.TimedTest.constant_rate(mode, rate, l, MELT.constant_rate(mode, rate, l))
            for mode in modes for rate in RATES]


def misfits(law, melt):
    """Return {mode: {rate: {stretch: stress of a law over that of a melt, minus 1}}}."""
    return {mode: {f"{rate:g}": {f"{l:g}": float(a / b - 1) for l, a, b in zip(
        STRETCHES, law.constant_rate(mode, rate, STRETCHES), melt.constant_rate(mode, rate, STRETCHES))}
        for rate in RATES} for mode in MODES}


def strained(damping, l1, l2):
    """Return tau_1 - tau_3 and tau_2 - tau_3 over the modulus, after a step of strain."""
    squares = np.array([l1**2, l2**2, (l1 * l2) ** -2])
    return damping(squares.sum(), (1 / squares).sum()) * (squares[:2] - squares[2])


def no_potential(damping):
    """Return two measures of the lack of a potential, 0 if there is one.

    They are the work by the stretches 1, 1 -> 3, 1 -> 3, 3 over that straight on, minus 1, and the asymmetry of the
    tangent at 3, 1.5. The steps of strain are so fast that nothing relaxes.
    """
    x, w = np.polynomial.legendre.leggauss(40)
    end = np.log(3.0)
    e, w = end * (1 + x) / 2, end * w / 2
    straight = sum(wi * strained(damping, np.exp(a), np.exp(a)).sum() for a, wi in zip(e, w))
    first = sum(wi * strained(damping, np.exp(a), 1.0)[0] for a, wi in zip(e, w))
    second = sum(wi * strained(damping, 3.0, np.exp(a))[1] for a, wi in zip(e, w))
    d = 1e-5
    at = np.array([3.0, 1.5])
    K = np.stack([(strained(damping, *(at * np.exp(d * unit))) - strained(damping, *(at * np.exp(-d * unit)))) / (2 * d)
                  for unit in np.eye(2)], axis=1)
    return (first + second) / straight - 1, abs(K[0, 1] - K[1, 0]) / np.abs(K).max()


def kept(mode, rate, count, steps=160):
    """Return the largest error of the stress if only some past states are kept, at ages in geometric progression.

    The path leads to stretch 5 in equal steps of strain. The integrand is linear between the kept states.
    """
    times = np.linspace(0, np.log(5.0) / rate, steps + 1)
    worst = 0.0
    for n in range(steps // 4, steps + 1, steps // 4):
        ages = np.geomspace(1, n, min(count, n))
        states = np.unique(np.append(0, np.round(ages))).astype(int)               # steps before now
        age, l = times[states], np.exp(rate * times[states])                       # relative stretch
        k = {"uniaxial": -0.5, "equibiaxial": 1.0}[mode]
        square = l[:, None] ** (2 * np.array([1, k, -1 - k]))
        f = DAMPING(square.sum(1), (1 / square).sum(1)) * (square[:, 0] - square[:, 2])
        total = MELT.relaxation_modulus(age[-1]) * f[-1]
        for G, tau in SPECTRUM:
            x, decay = np.diff(age) / tau, np.exp(-age / tau)
            mean = (decay[:-1] - decay[1:]) / x
            total += G * np.sum(f[:-1] * (decay[:-1] - mean) + f[1:] * (mean - decay[1:]))
        exact = MELT.constant_rate(mode, rate, [l[-1]])[0] * l[-1]
        worst = max(worst, abs(total / exact - 1))
    return worst


def row(*cells):
    """Return a line of a Markdown table."""
    return f"| {' | '.join(cells)} |"


def head(*cells):
    """Return the first two lines of a Markdown table."""
    return row(*cells) + "\n" + "|---" * len(cells) + "|"


def main():
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--out", type=Path, default=Path("results/kbkz_branches"), help="folder for results")
    out = options.parse_args().out
    out.mkdir(parents=True, exist_ok=True)
    fit = fx.fit(fx.Viscoelastic(None, SPECTRUM), measured())
    only = fx.fit(fx.Viscoelastic(None, SPECTRUM), measured(("uniaxial",)))
    same = fx.Viscoelastic(None, SPECTRUM)
    cases = {"same spectrum": (same, MELT), "same spectrum, Wagner": (same, MILDER),
             "fitted to both": (fit.material, MELT), "fitted to uniaxial": (only.material, MELT)}
    summary = {"worst_uniaxial": {}}
    for name, (law, melt) in cases.items():
        summary[name] = found = misfits(law, melt)
        say(f"\n{name}: {law} against {melt}", head("rate", *(f"{mode} {l:g}" for mode in MODES for l in STRETCHES)))
        for rate in RATES:
            say(row(f"{rate:g} /s", *(f"{100 * found[mode][f'{rate:g}'][f'{l:g}']:+.0f} %"
                                      for mode in MODES for l in STRETCHES)))
    for l in STRETCHES:
        summary["worst_uniaxial"][f"{l:g}"] = max(abs(summary[name]["uniaxial"][f"{rate:g}"][f"{l:g}"])
                                                  for name in cases if name.startswith("same") for rate in RATES)
    summary["undetermined"] = {"both": fit.undetermined, "uniaxial": only.undetermined}
    say(f"\nnot determined by both: {fit.undetermined}; by uniaxial: {only.undetermined}")
    say("", head("damping", "work by another path", "asymmetry of the tangent"))
    for damping in (DAMPING, MILDER.damping, fx.PSM(10.0, 0.5), fx.PSM(10.0, 1.0), fx.Wagner(1.0, 0.15)):
        work, asymmetry = no_potential(damping)
        summary[f"no potential: {damping}"] = {"work": work, "asymmetry": asymmetry}
        say(row(f"`{damping}`", f"{100 * work:+.0f} %" if abs(work) > 1e-6 else "0", f"{100 * asymmetry:.0f} %"))
    say("", head("states kept", *(f"{mode} {rate:g} /s" for mode in MODES for rate in RATES)))
    for count in (4, 8, 16, 32, 64, 160):
        errors = {mode: {f"{rate:g}": kept(mode, rate, count) for rate in RATES} for mode in MODES}
        summary[f"kept {count}"] = errors
        say(row(str(count), *(f"{100 * v:.2g} %" for rates in errors.values() for v in rates.values())))
    summarise(out, summary)


if __name__ == "__main__":
    main()
