"""How far branches with Gaussian springs are from a K-BKZ melt, and what K-BKZ would need in a scene.

Prints the tables of docs/kbkz.md and writes results/kbkz/summary.json. The melt is illustrative: five decades of
relaxation times and a damping of the usual size, no measured material. Less than a minute.
"""

import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "demos"))
from common import parser, say, summarise  # noqa: E402

import formingx as fx  # noqa: E402

SPECTRUM = [(0.10, 0.01), (0.06, 0.1), (0.03, 1.0), (0.012, 10.0), (0.004, 100.0)]      # MPa, s
DAMPING = fx.PSM(alpha=10.0, beta=0.05)
MELT = fx.KBKZ(SPECTRUM, DAMPING)
MODES, RATES, STRETCHES = ("uniaxial", "equibiaxial"), (0.1, 1.0, 10.0), (1.5, 2.0, 3.0, 5.0)


def measured(modes=MODES):
    """What tests of the melt would give."""
    l = np.linspace(1.1, 5.0, 14)
    return [fx.TimedTest.constant_rate(mode, rate, l, MELT.constant_rate(mode, rate, l))
            for mode in modes for rate in RATES]


def misfits(law):
    """{mode/rate/stretch: how much of the melt's stress a law has too much}."""
    return {f"{mode}/{rate:g}/{l:g}": float(a / b - 1) for mode in MODES for rate in RATES
            for l, a, b in zip(STRETCHES, law.constant_rate(mode, rate, STRETCHES),
                               MELT.constant_rate(mode, rate, STRETCHES))}


def strained(damping, l1, l2):
    """tau_1 - tau_3 and tau_2 - tau_3 over the modulus, of a step of strain."""
    squares = np.array([l1**2, l2**2, (l1 * l2) ** -2])
    return damping(squares.sum(), (1 / squares).sum()) * (squares[:2] - squares[2])


def no_potential(damping):
    """(how much less work 1, 1 -> 3, 1 -> 3, 3 takes than 1, 1 -> 3, 3 straight on; asymmetry of the tangent there).

    Steps of strain, so fast that nothing relaxes. Both are 0 if the stress has a potential.
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
    return 1 - (first + second) / straight, abs(K[0, 1] - K[1, 0]) / np.abs(K).max()


def kept(mode, rate, count, steps=160):
    """Largest error of the stress if only so many past states are kept, at ages in geometric progression.

    The path to stretch 5 in equal steps of strain; what is integrated goes linearly between the states that are kept.
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


def main():
    out = parser("kbkz", __doc__.splitlines()[0]).parse_args().out
    out.mkdir(parents=True, exist_ok=True)
    fit = fx.fit(fx.Viscoelastic(None, SPECTRUM), measured())
    only = fx.fit(fx.Viscoelastic(None, SPECTRUM), measured(("uniaxial",)))
    laws = {"same spectrum": fx.Viscoelastic(None, SPECTRUM), "fitted to both": fit.material,
            "fitted to uniaxial": only.material}
    summary = {"misfit": {name: misfits(law) for name, law in laws.items()},
               "branches": {name: law.branches for name, law in laws.items()}}
    for name, found in summary["misfit"].items():
        say(f"\n{name}: stress over that of {MELT}, minus 1, %")
        say("rate 1/s      " + "".join(f"{mode:>14} {l:g}" for mode in MODES for l in STRETCHES))
        for rate in RATES:
            row = [100 * found[f"{mode}/{rate:g}/{l:g}"] for mode in MODES for l in STRETCHES]
            say(f"{rate:8g}      " + "".join(f"{x:16.1f}" for x in row))
    say(f"\nnot determined: {fit.undetermined} of both, {only.undetermined} of uniaxial")
    for damping in (fx.PSM(10.0, 1.0), DAMPING, fx.PSM(10.0, 0.5), fx.Wagner(1.0, 0.15), fx.Wagner(0.1, 0.15)):
        work, asymmetry = no_potential(damping)
        summary[f"no potential: {damping}"] = {"work": work, "asymmetry": asymmetry}
        say(f"{damping}: work by another path {100 * work:.2g} % less, tangent unsymmetric by {100 * asymmetry:.2g} %")
    for count in (4, 8, 16, 32, 64, 160):
        errors = {f"{mode}/{rate:g}": kept(mode, rate, count) for mode in MODES for rate in RATES}
        summary[f"kept {count}"] = errors
        say(f"{count:4d} states kept: " + ", ".join(f"{k} {100 * v:.2g} %" for k, v in errors.items()))
    summarise(out, summary)


if __name__ == "__main__":
    main()
