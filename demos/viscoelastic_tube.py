"""Inflate a thick tube and a thick sphere that relax at a given speed, hold and release them.

Inner radius 1, outer radius 2; plane strain along the tube. c10 = 0.05, branches (0.3, 0.5 s), (0.4, 5 s); MPa, s. The
inner radius grows from 1 to 2 at a speed of 0.1, 1 or 10 and is constant for 2 s; the run finds the pressure. Then the
pressure is removed at once, and the body recovers for 50 s. Beside the numbers stand their changes with half the
elements.
"""

import numpy as np
from common import parser, save, say, summarise
from relaxing import P1, at_time, cost, times

import formingx as fx
from formingx import figures
from formingx.results import files

INNER, OUTER = 1.0, 2.0
SPEEDS, RADII = (0.1, 1, 10), (1.1, 1.25, 1.5, 1.75, 2)
HELD, AFTER = (0, 0.1, 0.5, 1, 2), (0, 0.5, 1, 2, 5, 10, 20, 50)


def body(kind, n):
    """Return the scene of a tube, n elements through the wall, or of half a sphere, n along the meridian."""
    if kind == "tube":
        mesh = fx.mesh.disc(radius=OUTER, inner_radius=INNER, thickness=0.5, elements=(n, 1))
        supports = [fx.Symmetry("bottom", normal="z"), fx.Symmetry("top", normal="z")]
    else:
        mesh = fx.mesh.sphere(inner_radius=INNER, thickness=OUTER - INNER, elements=(n, n))
        supports = [fx.Symmetry("axis"), fx.Symmetry("equator", normal="z")]
    return fx.Scene(mesh=mesh, materials=P1, supports=supports, loads=[fx.Pressure("inner", name="air")])


def inflate(kind, speed, n, accuracy):
    """Return the path of the whole process."""
    scene, full = body(kind, n), (OUTER - INNER) / speed
    at = tuple(scene.mesh.nodes_of("inner")[-1])             # the sphere's node on the equator

    def moved(value):
        return fx.displacement(value, at=at, component="r")
    end = full + HELD[-1]
    return fx.Process(scene).run([
        fx.Stage("inflate", control="air", amplitudes={moved: [(0, 0), (full, OUTER - INNER), (end, OUTER - INNER)]},
                 intermediate=times(0.0, [(r - INNER) / speed for r in RADII]) + times(full, HELD[1:-1])),
        fx.Stage("release", control="air", until=fx.pressure(0.0)),
        fx.Stage("recovery", duration=AFTER[-1], intermediate=times(end, AFTER[1:-1]))],
        accuracy=accuracy, max_steps=100_000, record={"moved": moved(0.0)})


def numbers(path, speed):
    """Return the numbers of the summary of one run."""
    full = (OUTER - INNER) / speed
    end = full + HELD[-1]

    def pressure(t):
        return float(at_time(path, "inflate", t).measures["pressure"])
    return {"pressure_at_inner_radius": {f"{r:g}": pressure((r - INNER) / speed) for r in RADII},
            "held": {f"{t:g}": pressure(full + t) for t in HELD},
            "inner_radius_after_release": {
                f"{t:g}": float(INNER + at_time(path, "recovery", end + t).measures["moved"]) for t in AFTER}}


def change(fine, coarse):
    """Return the largest relative difference of the numbers of two runs."""
    return float(max(abs(coarse[group][k] / v - 1) for group in fine for k, v in fine[group].items()))


def draw(paths):
    """Return a figure: pressure over inner radius, and inner radius over time after the release, of both shapes."""
    figure, axes = figures.figure(2, width=5.2)
    for kind, style in (("tube", "-"), ("sphere", "--")):
        for k, speed in enumerate(SPEEDS):
            path, end = paths[kind, speed], (OUTER - INNER) / speed + HELD[-1]
            until = [s for s in path.states if s.stage == "inflate"]
            axes[0].plot([INNER + s.measures["moved"] for s in until], [s.measures["pressure"] for s in until],
                         style, color=f"C{k}", label=f"{kind}, speed {speed:g}/s")
            after = [s for s in path.states if s.stage == "recovery"]
            axes[1].plot([s.time - end for s in after], [INNER + s.measures["moved"] for s in after], style,
                         color=f"C{k}")
    axes[0].set(xlabel="inner radius / its first value", ylabel="pressure, MPa", ylim=(0, 1.25 * axes[0].get_ylim()[1]))
    axes[0].legend(frameon=False, fontsize="small", ncols=2)
    axes[1].set(xlabel="time after the release, s", ylabel="inner radius / its first value", xlim=(0, 20),
                ylim=(1, None))
    return figure


def main():
    options = parser("viscoelastic_tube", __doc__, elements=14, accuracy=3e-5)
    args = options.parse_args()
    n, accuracy = (4, 5e-3) if args.quick else (args.elements, args.accuracy)
    summary: dict = {"sphere": {}}
    paths = {}
    for kind, group in (("tube", summary), ("sphere", summary["sphere"])):
        for speed in SPEEDS:
            path = paths[kind, speed] = inflate(kind, speed, n, accuracy)
            group[f"speed_{speed:g}"] = found = numbers(path, speed)
            say(f"{kind}, speed {speed:g}/s: " + ", ".join(f"{p:.5f} MPa at {r}"
                                                        for r, p in found["pressure_at_inner_radius"].items())
                + f"; {found['held']['2']:.5f} MPa after 2 s; recovered to"
                f" {found['inner_radius_after_release']['0']:.5f} at once,"
                f" {found['inner_radius_after_release']['50']:.5f} in 50 s; {len(path)} states,"
                f" {path.counts.seconds:.1f} s")
            path.to_csv(args.out / f"{kind}_speed_{speed:g}.csv")
    half = {kind: numbers(inflate(kind, 1, n // 2, accuracy), 1) for kind in ("tube", "sphere")}
    summary["largest_change_from_half_the_elements"] = {
        "tube": change(summary["speed_1"], half["tube"]),
        "sphere": change(summary["sphere"]["speed_1"], half["sphere"])}
    say("change from half the elements, speed 1: " + ", ".join(
        f"{kind} {v:.1e}" for kind, v in summary["largest_change_from_half_the_elements"].items()))
    save(draw(paths), args.out / "viscoelastic_tube.png")
    summary["cost"] = {k: float(np.sum([cost(p)[k] for p in paths.values()])) for k in cost(path)}
    summarise(args.out, summary | {"elements": n, "accuracy": accuracy, "versions": files.versions()})


if __name__ == "__main__":
    main()
