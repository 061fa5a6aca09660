"""Measure error against time of three scenes, for every way to model them.

Prints a table per scene, draws error against time with its Pareto front, writes results/trade/. The errors are relative
to a fine reference. Each way runs in a process of its own (peak memory), twice: the first compiles. "solve" is the run
alone, "total" includes mesh and set-up. About 15 minutes (--quick: one scene, coarse ways).
"""

import argparse
import json
import resource
import subprocess
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "demos"))
from common import COMM, save, say  # noqa: E402

import formingx as fx  # noqa: E402
from formingx import figures  # noqa: E402
from formingx.results import files

# scene: size, materials (c10, c01), target pole height, in the thesis' units; Treloar's target lies beyond its limit
SCENES = {
    "treloar": {"radius": 1.25, "thickness": {"sheet": 0.082}, "materials": {"sheet": (2.0, 0.0)}, "height": 2.5},
    "thick_plate": {"radius": 7.5, "thickness": {"sheet": 0.5}, "materials": {"sheet": (80.0, 20.0)}, "height": 7.5},
    "two_layer": {"radius": 19.1, "thickness": {"lower": 0.635, "upper": 0.635},
                  "materials": {"lower": (0.552, 0.138), "upper": (0.759, 0.276)}, "height": 16.08},
}
MODELS = {
    "membrane": lambda: fx.Membrane(),
    "P2/P0": lambda: fx.MixedPressure(space="P0"),
    "P2/P1": lambda: fx.MixedPressure(space="P1"),
    "P2+/P1dg": lambda: fx.MixedPressure(space="P1dg"),
    "P2+/P1dg eps 1e-2": lambda: fx.MixedPressure(space="P1dg", eps=1e-2),
    "P2+/P1dg eps 1e-4": lambda: fx.MixedPressure(space="P1dg", eps=1e-4),
    "u only, 3 points, eps 1e-2": lambda: fx.DisplacementPenalty(eps=1e-2, points=3),
    "u only, 3 points, eps 1e-4": lambda: fx.DisplacementPenalty(eps=1e-4, points=3),
    "u only, 4 points, eps 1e-2": lambda: fx.DisplacementPenalty(eps=1e-2, points=4),
    "u only, 7 points, eps 1e-2": lambda: fx.DisplacementPenalty(eps=1e-2, points=7),
}
REFERENCE = {"model": "P2+/P1dg", "along": 160, "through": 8}
QUANTITIES = ("pressure", "pole_thickness", "rim_stress")


def ways(quick):
    """Yield every way to model a scene: model, elements, and options that are not the defaults."""
    meshes = ((5, 1), (10, 1), (20, 1), (40, 2), (80, 4))
    for model in ("membrane", "P2/P0", "P2/P1", "P2+/P1dg"):
        for along, through in meshes[:3] if quick else meshes:
            yield {"model": model, "along": along, "through": through}
    if quick:
        return
    for model in list(MODELS)[4:]:
        yield {"model": model, "along": 20, "through": 1}
    for change in ({"grading": 0.3}, {"grading": 3.0}, {"quadrature_degree": 3}, {"quadrature_degree": 8},
                   {"tolerance": 1e-4}, {"tolerance": 1e-6}):
        yield {"model": "P2+/P1dg", "along": 20, "through": 1, **change}
    for through in (1, 2, 4):
        yield {"model": "P2+/P1dg", "along": 40, "through": through}


def one(scene, way):
    """Return key numbers and cost of one scene in one way (its elements, or an accuracy that chooses them)."""
    size = SCENES[scene]
    began = time.perf_counter()
    mesh = fx.mesh.disc(radius=size["radius"], thickness=size["thickness"], **(
        {"accuracy": way["accuracy"]} if "accuracy" in way else
        {"elements": (way["along"], way["through"]), "grading": way.get("grading", 1.0)}))
    given = fx.Scene(
        mesh=mesh, materials={n: fx.MooneyRivlin(c10=a, c01=b) for n, (a, b) in size["materials"].items()},
        supports=[fx.Symmetry("axis"), fx.SimplySupported("rim")], loads=[fx.Pressure("bottom")],
        model=MODELS[way["model"]](), quadrature_degree=way.get("quadrature_degree", 5))
    tolerances = fx.Tolerances(correction=way["tolerance"]) if "tolerance" in way else None
    try:
        path = fx.trace(given, until=fx.pole_height(size["height"]), tolerances=tolerances, progress=False,
                        max_steps=300)
    except fx.ConvergenceError as error:
        return {"failed": str(error).split(".")[0], "iterations": error.path.counts.iterations,
                "seconds": time.perf_counter() - began}
    seconds = time.perf_counter() - began
    pressures = [s.measures["pressure"] for s in path.limit_points] or [path.last.measures["pressure"]]
    profile, thickness = path.profile(), sum(size["thickness"].values())
    rim_stress = None
    if way["model"] != "membrane":
        layer = list(size["thickness"])[-1]
        point = (size["radius"] - thickness, thickness)           # top face, one thickness inside the rim
        rim_stress = float(path.stress().at_points([point], layer).on_face((0.0, 1.0)).meridional[0])
    return {"pressure": pressures[0], "pole_thickness": profile.thickness[0], "rim_stress": rim_stress,
            "seconds": path.counts.seconds, "total_seconds": seconds, "steps": path.counts.steps,
            "failures": path.counts.failures, "iterations": path.counts.iterations, "unknowns": path.problem.n_unknowns,
            "peak_MB": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024}


def measured(scene, way):
    """Return the numbers of a way from a process of its own, with forms compiled before."""
    for _ in range(2):
        done = subprocess.run([sys.executable, __file__, "--one", json.dumps([scene, way])], capture_output=True,
                              text=True, timeout=900)
        if done.returncode:
            raise RuntimeError(done.stderr[-2000:])
    return json.loads(done.stdout.strip().splitlines()[-1])


def label(way):
    changes = ", ".join(f"{k.replace('_', ' ')} {v:g}" for k, v in way.items()
                        if k not in ("model", "along", "through"))
    return f"{way['model']} {way['along']}x{way['through']}" + (f", {changes}" if changes else "")


def pareto(points):
    """Return those of (seconds, error, name) that no other one beats in both, sorted by time."""
    best, front = float("inf"), []
    for point in sorted(points):
        if point[1] < best:
            best = point[1]
            front.append(point)
    return front


def draw(results, out):
    """Draw the larger error of pressure and pole thickness against time, a plot for each scene."""
    figure, axes = figures.figure(len(results), width=5.2, height=4.6)
    axes = [axes] if len(results) == 1 else axes
    for a, (scene, rows) in zip(axes, results.items(), strict=True):
        points = []
        for k, model in enumerate(("membrane", "P2/P0", "P2/P1", "P2+/P1dg", "other")):
            mine = [(r["seconds"], r["error"], n) for n, r in rows.items() if r.get("error") and (
                r["model"] == model or model == "other" and (r["model"] not in list(MODELS)[:4]))]
            if mine:
                a.loglog([m[0] for m in mine], [m[1] for m in mine], "osDv^"[k], color=f"C{k}",
                         label="penalty" if model == "other" else model)
            points += mine
        front = pareto(points)
        a.loglog([p[0] for p in front], [p[1] for p in front], "k-", linewidth=0.8, label="Pareto front")
        a.set(title=scene.replace("_", " "), xlabel="seconds to solve", ylabel="error of pressure and pole thickness")
    axes[0].legend(frameon=False, fontsize=8)
    save(figure, out / "trade.png")


def main():
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--quick", action="store_true", help="one scene, coarse ways")
    options.add_argument("--out", type=Path, default=Path("results/trade"), help="folder for results")
    options.add_argument("--one", help=argparse.SUPPRESS)
    args = options.parse_args()
    if args.one:
        print(json.dumps(one(*json.loads(args.one)), default=float))
        return
    results = {}
    for scene in list(SCENES)[:1 if args.quick else None]:
        reference = measured(scene, {**REFERENCE, **({"along": 80, "through": 4} if args.quick else {})})
        say("", f"{scene}: reference {label(REFERENCE)}: " + ", ".join(f"{q} {reference[q]:.7g}" for q in QUANTITIES),
            f"{'':44}{'unknowns':>9}{'solve s':>8}{'total s':>8}{'iter':>6}{'MB':>6}"
            + "".join(f"{q:>16}" for q in QUANTITIES))
        rows = results[scene] = {}
        for way in ways(args.quick):
            row = rows[label(way)] = {**way, **measured(scene, way)}
            if "failed" in row:
                say(f"{label(way):44}{row['iterations']:>22} iterations  {row['failed']}")
                continue
            errors = {q: abs(row[q] / reference[q] - 1) for q in QUANTITIES if row[q] is not None}
            row["errors"], row["error"] = errors, max(errors["pressure"], errors["pole_thickness"])
            say(f"{label(way):44}{row['unknowns']:9d}{row['seconds']:8.2f}{row['total_seconds']:8.2f}"
                f"{row['iterations']:6d}{row['peak_MB']:6.0f}"
                + "".join(f"{errors[q]:16.1e}" if q in errors else f"{'-':>16}" for q in QUANTITIES))
        say("Pareto front: " + "; ".join(f"{p[2]} ({p[0]:.2f} s, {p[1]:.0e})" for p in pareto(
            [(r["seconds"], r["error"], n) for n, r in rows.items() if "error" in r])))
    files.write_summary(args.out / "summary.json", results, COMM)
    draw(results, args.out)


if __name__ == "__main__":
    main()
