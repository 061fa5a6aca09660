"""Stretch a block that relaxes: constant stretch, constant rate, creep under a dead force and recovery.

One element in uniaxial and in equibiaxial extension, solved as a scene; MPa, s, and true stress sigma1 - sigma3. The
material P0 (c10 = 0.05, a branch of 0.5 and 1 s) is stretched at once; then its stretch is constant. P1 (c10 = 0.05,
branches of 0.3 and 0.5 s, 0.4 and 5 s) is pulled at constant Hencky rates, and by a dead force of 0.2 MPa times its
reference area. The stresses are compared with those of the material's homogeneous tests (`relaxation`,
`constant_rate`), which integrate the same law by another method.
"""

import numpy as np
from common import parser, save, say, summarise
from relaxing import P0, P1, at_time, cost, times

import formingx as fx
from formingx import figures
from formingx.results import files

PULLED = {"uniaxial": ("top", "z", np.pi), "equibiaxial": ("rim", "r", 2 * np.pi)}      # face, direction, its area
STRETCHES, TIMES = (1.5, 2, 3, 5, 10), (0.1, 0.25, 0.5, 1, 2, 5)
RATES, MET = (0.1, 1, 10), (1.1, 1.25, 1.5, 2, 3, 5)
FORCE, CREEP, RECOVERY = 0.2, (0.5, 1, 2, 5), (0.5, 1, 2, 5, 10, 20, 50)
MANY = 100_000                                               # states: as many as it takes


def block(material, mode):
    """Return the scene of a cylinder of radius and height 1, pulled at its top or at its rim."""
    face, direction, _ = PULLED[mode]
    return fx.Scene(mesh=fx.mesh.disc(radius=1.0, thickness=1.0, elements=(1, 1)), materials=material,
                    supports=[fx.Symmetry("axis"), fx.Symmetry("bottom", normal="z", guide=True),
                              fx.PrescribedDisplacement(face, direction, name="pull")])


def run(scene, stages, accuracy):
    return fx.Process(scene).run(stages, accuracy=accuracy, max_steps=MANY)


def true_stress(state, mode):
    """Return sigma1 - sigma3: nominal stress times stretch; the force is that of the body on its support."""
    return float(-state.measures["support_force"] / PULLED[mode][2] * (1 + state.measures["travel"]))


def relax(mode, stretch, accuracy):
    """Return the path at a constant stretch, and {time: stress}."""
    path = run(block(P0, mode), [fx.Stage("pull", control="pull", until=fx.travel(stretch - 1.0)),
                                 fx.Stage("hold", duration=TIMES[-1], intermediate=times(0.0, TIMES[:-1]))], accuracy)
    return path, {f"{t:g}": true_stress(at_time(path, "hold", t), mode) for t in (0, *TIMES)}


def pull(mode, rate, accuracy):
    """Return the path at a constant Hencky rate, and {stretch: stress}."""
    at = [np.log(stretch) / rate for stretch in MET]
    stage = fx.Stage("pull", control="pull", amplitudes={fx.travel: lambda t: np.expm1(rate * t)},
                     until=fx.process_time(at[-1]), intermediate=times(0.0, at[:-1]))
    path = run(block(P1, mode), [stage], accuracy)
    return path, {f"{s:g}": true_stress(at_time(path, "pull", t), mode) for s, t in zip(MET, at)}


def creep(accuracy):
    """Return the path of a dead force that is applied at once and removed at once.

    Beside the path: {time: stretch} under the force, and after its removal.
    """
    force, end = fx.force(-FORCE * np.pi), CREEP[-1]
    path = run(block(P1, "uniaxial"), [
        fx.Stage("load", control="pull", until=force),
        fx.Stage("creep", control="pull", constant=force, duration=end, intermediate=times(0.0, CREEP[:-1])),
        fx.Stage("unload", control="pull", until=fx.force(0.0)),
        fx.Stage("recovery", control="pull", constant=fx.force(0.0), duration=RECOVERY[-1],
                 intermediate=times(end, RECOVERY[:-1]))], accuracy)

    def stretch(stage, begin, after):
        return {f"{t:g}": float(1 + at_time(path, stage, begin + t).measures["travel"]) for t in after}
    return path, stretch("creep", 0.0, (0, *CREEP)), stretch("recovery", end, (0, *RECOVERY))


def deviation(found, sought, stretches):
    """Return the largest relative difference of true stresses from nominal ones of a homogeneous test."""
    return float(np.abs(np.array(list(found.values())) / (np.asarray(sought) * stretches) - 1).max())


def draw(relaxing, pulling, path):
    """Return a figure: stress over time, stress over stretch, stretch over time."""
    figure, (held, pulled, crept) = figures.figure(3, width=3.9)
    for k, (stretch, run_) in enumerate(relaxing.items()):
        held.loglog(*over_time(run_), color=f"C{k}", label=f"{stretch:g}")
    for k, (rate, run_) in enumerate(pulling.items()):
        pulled.semilogy(1 + run_["travel"][1:], [true_stress(s, "uniaxial") for s in run_.states[1:]], color=f"C{k}",
                        label=f"{rate:g}/s")
    crept.plot(path["process_time"], 1 + path["travel"])
    held.set(xlabel="time, s", ylabel="$\\sigma_1-\\sigma_3$, MPa", title="held, uniaxial")
    held.legend(frameon=False, title="stretch", ncols=2)
    pulled.set(xlabel="stretch", ylabel="$\\sigma_1-\\sigma_3$, MPa", title="constant Hencky rate, uniaxial",
               ylim=(0.05, None))
    pulled.legend(frameon=False)
    crept.set(xlabel="time, s", ylabel="stretch", title="creep and recovery", xlim=(-1, 30))
    return figure


def over_time(path):
    """Return times at constant stretch, from 10 ms on, and true stresses."""
    states = [s for s in path.states if s.stage == "hold" and s.time >= 0.01]
    return [s.time for s in states], [true_stress(s, "uniaxial") for s in states]


def main():
    options = parser("relaxation", __doc__)
    options.add_argument("--accuracy", type=float, help="relative error in time (None: 5e-7, with --quick 2e-3)")
    args = options.parse_args()
    accuracy = args.accuracy or (2e-3 if args.quick else 5e-7)
    summary: dict = {"relaxation": {}, "rate": {}, "largest_error_of_homogeneous_tests": {}, "accuracy": accuracy}
    paths: dict = {}
    for mode in PULLED:
        paths[mode, "held"] = {s: relax(mode, s, accuracy) for s in STRETCHES}
        paths[mode, "rate"] = {r: pull(mode, r, accuracy) for r in RATES}
        for key, name in (("held", "relaxation"), ("rate", "rate")):
            summary[name][mode] = {f"{k:g}": found for k, (_, found) in paths[mode, key].items()}
        errors = [deviation(found, P0.relaxation(mode, s, (0, *TIMES)), s)
                  for s, (_, found) in paths[mode, "held"].items()]
        rates = [deviation(found, P1.constant_rate(mode, r, MET), MET) for r, (_, found) in paths[mode, "rate"].items()]
        summary["largest_error_of_homogeneous_tests"][mode] = {"relaxation": max(errors), "rate": max(rates)}
        say(f"{mode}: off homogeneous tests by {max(errors):.1e} (relaxation), {max(rates):.1e} (constant rate);"
            f" {sum(len(p) for kind in ('held', 'rate') for p, _ in paths[mode, kind].values())} states")
    path, summary["creep"], summary["recovery"] = creep(accuracy)
    say("creep: " + ", ".join(f"{v:.6f} at {t} s" for t, v in summary["creep"].items()),
        "recovery: " + ", ".join(f"{v:.6f} at {t} s" for t, v in summary["recovery"].items()))
    path.to_csv(args.out / "creep.csv")
    for stretch, (held, _) in paths["uniaxial", "held"].items():
        held.to_csv(args.out / f"held_at_{stretch:g}.csv")
    uniaxial = [{k: run_ for k, (run_, _) in paths["uniaxial", kind].items()} for kind in ("held", "rate")]
    save(draw(*uniaxial, path), args.out / "relaxation.png")
    every = [p for group in paths.values() for p, _ in group.values()] + [path]
    summary["cost"] = {k: sum(cost(p)[k] for p in every) for k in cost(path)}
    summarise(args.out, summary | {"versions": files.versions()})


if __name__ == "__main__":
    main()
