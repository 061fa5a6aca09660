"""Inflate Treloar's sheet, of a material that relaxes, at a given flow of air: as a membrane and as a solid.

r0/h0 = 100, hinged; c10 = 0.05, branches (0.3, 0.5 s), (0.4, 5 s); MPa, s. The swept volume grows evenly from 0 to
V1 r0^3 in the time T: (T, V1) = (0.4 s, 4), (4, 2), (40, 2). Then it is constant for 5, 2 and 2 s. Pressures are given
as p r0/h0. Membrane and solid are compared with each other, and with runs of the membrane with half the elements and
with half the steps.
"""

from common import parser, save, say, summarise
from relaxing import P1, at_time, cost, times

import formingx as fx
from formingx import figures
from formingx.results import files

R0, H0 = 1.0, 0.01
CASES = {0.4: (4, (1.25, 2.5, 3.75, 5)), 4: (2, (0.5, 1, 1.5, 2)), 40: (2, (0.5, 1, 1.5, 2))}    # T: V1, times held
MODELS = {"membrane": fx.Membrane(), "solid": fx.MixedPressure()}


def inflate(model, T, n, accuracy):
    """Return the path of a flow, with n elements along the radius."""
    scene = fx.Scene(mesh=fx.mesh.disc(radius=R0, thickness=H0, elements=(n, 1)), materials=P1, model=MODELS[model],
                     supports=[fx.Symmetry("axis"), fx.SimplySupported("rim")],
                     loads=[fx.Pressure("bottom", name="air")])
    volume, held = CASES[T][0] * R0**3, CASES[T][1]
    stage = fx.Stage("blow", control="air",
                     amplitudes={fx.enclosed_volume: [(0, 0), (T, volume), (T + held[-1], volume)]},
                     intermediate=times(0.0, [T * k / 8 for k in range(1, 9)]) + times(T, held[:-1]))
    return fx.Process(scene).run([stage], accuracy=accuracy, max_steps=100_000)


def numbers(path, T):
    """Return the numbers of the summary of one run."""
    volume, held = CASES[T]
    met = {f"{volume * k / 8:g}": at_time(path, "blow", T * k / 8).measures for k in range(1, 9)}
    return {"p_R0_over_h0_at_volume": {v: float(m["pressure"] * R0 / H0) for v, m in met.items()},
            "pole_thickness_ratio_at_volume": {v: float(m["pole_stretch"] ** -2) for v, m in met.items()},
            "held": {f"{t:g}": float(at_time(path, "blow", T + t).measures["pressure"] * R0 / H0) for t in held}}


def changes(numbers, others):
    """Return the largest relative difference of each group of the numbers of two runs."""
    return {group: float(max(abs(others[group][k] / v - 1) for k, v in of.items())) for group, of in numbers.items()}


def draw(paths):
    """Return a figure: pressure and pole thickness over volume, pressure at constant volume over time."""
    figure, (p_axes, t_axes, held) = figures.figure(3, width=3.9)
    for (model, T), path in paths.items():
        style, color = "-" if model == "membrane" else "k:", None if model == "solid" else f"C{list(CASES).index(T)}"
        states = [s for s in path.states if 0 < s.time <= T * (1 + 1e-12)]
        v = [s.measures["enclosed_volume"] / R0**3 for s in states]
        label = {"label": f"T = {T:g} s" if model == "membrane" else "solid" if T == 40 else None}
        colored = {"color": color} if color else {}
        p_axes.plot(v, [s.measures["pressure"] * R0 / H0 for s in states], style, **colored, **label)
        t_axes.plot(v, [s.measures["pole_stretch"] ** -2 for s in states], style, **colored)
        after = [s for s in path.states if s.time >= T]
        held.plot([s.time - T for s in after], [s.measures["pressure"] * R0 / H0 for s in after], style, **colored)
    p_axes.set(xlabel="volume/r$_0^3$", ylabel="p r$_0$/h$_0$, MPa", ylim=(0, None), xlim=(0, None))
    p_axes.legend(frameon=False)
    t_axes.set(xlabel="volume/r$_0^3$", ylabel="pole thickness/h$_0$", ylim=(0, 1.02), xlim=(0, None))
    held.set(xlabel="time after inflation, s", ylabel="p r$_0$/h$_0$, MPa", ylim=(0, None), xlim=(0, None))
    return figure


def main():
    options = parser("viscoelastic_disc", __doc__, elements=40, accuracy=1e-4)
    args = options.parse_args()
    n, accuracy = (16, 1.5e-3) if args.quick else (args.elements, args.accuracy)
    summary: dict = {}
    paths = {}
    for model in MODELS:
        summary[model] = {}
        for T in CASES:
            path = paths[model, T] = inflate(model, T, n, accuracy)
            summary[model][f"T_{T:g}"] = found = numbers(path, T)
            p, t = found["p_R0_over_h0_at_volume"], found["pole_thickness_ratio_at_volume"]
            last = list(p)[-1]
            say(f"{model}, T = {T:g} s: p r0/h0 = {max(p.values()):.5f} at most, {p[last]:.5f} at {last},"
                f" {list(found['held'].values())[-1]:.5f} held; pole {t[last]:.5f} of h0; {len(path)} states,"
                f" {path.counts.seconds:.1f} s")
            path.to_csv(args.out / f"{model}_T_{T:g}.csv")
    whole = summary["membrane"]["T_4"]
    summary["largest_change"] = {
        "membrane_to_solid": {f"T_{T:g}": changes(summary["membrane"][f"T_{T:g}"], summary["solid"][f"T_{T:g}"])
                              for T in CASES},
        "half_the_elements": changes(whole, numbers(inflate("membrane", 4, n // 2, accuracy), 4)),
        "four_times_the_error_in_time": changes(whole, numbers(inflate("membrane", 4, n, 4 * accuracy), 4))}
    for name, found in summary["largest_change"].items():
        say(f"{name.replace('_', ' ')}: {found}")
    save(draw(paths), args.out / "viscoelastic_disc.png")
    summary["cost"] = {k: sum(cost(p)[k] for p in paths.values()) for k in cost(path)}
    summarise(args.out, summary | {"elements": n, "accuracy": accuracy, "versions": files.versions()})


if __name__ == "__main__":
    main()
