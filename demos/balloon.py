"""Inflate a balloon that relaxes: at a given flow of air, or under a constant pressure until it snaps.

A thin hollow sphere, R0/H0 = 100 (R0 to the middle of the wall), c10 = 0.05, branches (0.3, 0.5 s), (0.4, 5 s); MPa, s.
Flow: the volume grows from V0 = 4/3 pi R0^3 to 27 V0 at a rate of q V0 per second; then it is constant. Pressure: it is
applied at once and stays constant, and the balloon creeps until no state follows. There the time has a maximum along
the path, and the run ends. Pressures are given as p R0/H0; stretches are those of the middle of the wall.
"""

import numpy as np
from common import parser, save, say, summarise
from relaxing import P1, at_time, cost, times

import formingx as fx
from formingx import figures
from formingx.results import files

R0, H0 = 1.0, 0.01
VOLUME = 4 / 3 * np.pi * R0**3                               # V0
FLOWS, STRETCHES, HELD = (2.6, 26, 260), (1.1, 1.25, 1.5, 2, 2.5, 3), (0.1, 0.5, 1, 2, 5, 20)
PRESSURES, CREPT = (0.1, 0.2, 0.4, 0.8), (1.1, 1.2, 1.3, 1.5)
LONG = 1000.0                                                # s: 200 times the longest relaxation


def balloon(n):
    """Return the scene of half a sphere, with n elements along the meridian."""
    return fx.Scene(mesh=fx.mesh.sphere(inner_radius=R0 - H0 / 2, thickness=H0, elements=(n, 1)), materials=P1,
                    supports=[fx.Symmetry("axis"), fx.Symmetry("equator", normal="z")],
                    loads=[fx.Pressure("inner", name="air")])


def blow(q, n, accuracy):
    """Return the path of a flow of q V0 per second, and its numbers."""
    full = STRETCHES[-1] ** 3 - 1
    at = [(stretch**3 - 1) / q for stretch in STRETCHES]     # volume grows with the middle of the wall
    end = at[-1]
    stage = fx.Stage("blow", control="air",
                     amplitudes={fx.enclosed_volume: [(0, 0), (end, full * VOLUME), (end + HELD[-1], full * VOLUME)]},
                     intermediate=times(0.0, at) + times(end, HELD[:-1]))
    path = fx.Process(balloon(n)).run([stage], accuracy=accuracy, max_steps=100_000)

    def scaled(time):
        return float(at_time(path, "blow", time).measures["pressure"] * R0 / H0)
    return path, {"p_R0_over_H0_at_stretch": {f"{s:g}": scaled(t) for s, t in zip(STRETCHES, at)},
                  "held": {f"{t:g}": scaled(end + t) for t in HELD}}


def creep(p, n, accuracy):
    """Return the path under a constant pressure p R0/H0 (MPa), and its numbers."""
    through = [fx.pole_stretch(s) for s in CREPT]
    stages = [fx.Stage("put on", control="air", until=fx.pressure(p * H0 / R0), intermediate=through),
              fx.Stage("creep", duration=LONG, intermediate=through, at_limit_point="stop")]
    path = fx.Process(balloon(n)).run(stages, accuracy=accuracy, max_steps=100_000)
    met = {f"{s:g}": path.target_state(target) for s, target in zip(CREPT, through)}
    found: dict = {"time_at_stretch": {s: float(state.time) for s, state in met.items() if state is not None}}
    if path.limit_points:
        found |= {"snap_time_s": float(path.limit_points[-1].time),
                  "stretch_at_snap": float(path.limit_points[-1].measures["pole_stretch"])}
    else:
        found |= {"stretch_at_the_end": float(path.last.measures["pole_stretch"])}
    return path, found


def draw(flows, creeps):
    """Return a figure: pressure over stretch, pressure over time after the flow, stretch over time."""
    figure, (blown, held, crept) = figures.figure(3, width=3.9)
    for k, (q, path) in enumerate(flows.items()):
        end = (STRETCHES[-1] ** 3 - 1) / q
        p, t = path["pressure"] * R0 / H0, path["process_time"]
        blown.plot(path["pole_stretch"][t <= end], p[t <= end], color=f"C{k}", label=f"q = {q:g}/s")
        held.semilogx(t[t > end] - end, p[t > end], color=f"C{k}")
    for k, (p, path) in enumerate(creeps.items()):
        t, stretch = path["process_time"], path["pole_stretch"]
        crept.semilogx(t[t > 0], stretch[t > 0], color=f"C{k}", label=f"{p:g} MPa")
        if path.limit_points:
            crept.plot(t[-1], stretch[-1], "o", color=f"C{k}")
    blown.set(xlabel="stretch", ylabel="p R$_0$/H$_0$, MPa", title="flow", ylim=(0, None))
    blown.legend(frameon=False)
    held.set(xlabel="time after the flow, s", ylabel="p R$_0$/H$_0$, MPa", title="held at stretch 3", xlim=(1e-2, None),
             ylim=(0, None))
    crept.set(xlabel="time, s", ylabel="stretch", title="pressure held; dot: snap", xlim=(1e-3, None))
    crept.legend(frameon=False, title="p R$_0$/H$_0$")
    return figure


def main():
    options = parser("balloon", __doc__, elements=8, accuracy=2e-5)
    args = options.parse_args()
    n, accuracy = (4, 1.5e-3) if args.quick else (args.elements, args.accuracy)
    summary: dict = {}
    flows, creeps = {}, {}
    for q in FLOWS:
        flows[q], found = blow(q, n, accuracy)
        summary[f"flow_{q:g}"] = found
        met = ", ".join(f"{p:.5f} at {s}" for s, p in found["p_R0_over_H0_at_stretch"].items())
        say(f"q = {q:g}/s: p R0/H0 = {met}; {found['held']['20']:.5f} after 20 s; {len(flows[q])} states,"
            f" {flows[q].counts.seconds:.1f} s")
        flows[q].to_csv(args.out / f"flow_{q:g}.csv")
    for p in PRESSURES:
        creeps[p], found = creep(p, n, accuracy)
        summary[f"pressure_{p:g}"] = found
        say(f"p R0/H0 = {p:g} held: " + ", ".join(f"{t:.5g} s at {s}" for s, t in found["time_at_stretch"].items())
            + (f"; snaps at {found['snap_time_s']:.6g} s, stretch {found['stretch_at_snap']:.4f}"
               if "snap_time_s" in found else f"; comes to rest at {found['stretch_at_the_end']:.5f}")
            + f"; {len(creeps[p])} states, {creeps[p].counts.seconds:.1f} s")
        creeps[p].to_csv(args.out / f"pressure_{p:g}.csv")
    save(draw(flows, creeps), args.out / "balloon.png")
    every = [*flows.values(), *creeps.values()]
    summary["cost"] = {k: sum(cost(path)[k] for path in every) for k in cost(every[0])}
    summarise(args.out, summary | {"elements": n, "accuracy": accuracy, "versions": files.versions()})


if __name__ == "__main__":
    main()
