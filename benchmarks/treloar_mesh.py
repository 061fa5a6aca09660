"""Inflate Treloar's sheet under mesh refinement, also with the thesis' penalty.

Writes results/treloar_mesh/summary.json, for docs/validation.md. About 2 minutes (--quick: seconds).
"""

import argparse
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "demos"))
from common import COMM, say  # noqa: E402

import formingx as fx  # noqa: E402
from formingx.exact.inflation import membrane_inflation, membrane_limit_point  # noqa: E402
from formingx.results import files  # noqa: E402

STRETCHES = (1.2, 1.5, 2.0, 3.0, 4.0, 6.0, 8.5)


def pressures(elements, support, model=None, grading=1.0, until=8.5, max_steps=200):
    """Return the limit pressure and pressures at the stretches; None where the run stopped before."""
    mesh = fx.mesh.disc(radius=1.25, thickness=0.082, elements=elements, grading=grading)
    scene = fx.Scene(mesh=mesh, materials=fx.NeoHookean(c10=2.0), supports=[fx.Symmetry("axis"), support],
                     loads=[fx.Pressure("bottom")], model=model)
    targets = [fx.pole_stretch(s) for s in STRETCHES if s <= until]
    try:
        path = fx.trace(scene, until=targets[-1], intermediate=targets[:-1], max_steps=max_steps, progress=False)
        stopped = None
    except fx.ConvergenceError as error:
        path, stopped = error.path, f"stopped at stretch {error.path.last.measures['pole_stretch']:.2f}"
    limit = path.limit_points[0].measures["pressure"] if path.limit_points else None
    at = [(state := path.target_state(t)) and state.measures["pressure"] for t in targets]
    return {"limit": limit, "at": at, "steps": path.counts.steps, "iterations": path.counts.iterations,
            "volume_error": path.last.measures["volume_error"], "seconds": path.counts.seconds, "stopped": stopped}


def show(name, found):
    cells = [f"{v:10.6f}" if v is not None else f"{'-':>10}" for v in (found["limit"], *found["at"])]
    say(f"{name:34}" + "".join(cells) + f"{found['steps']:6d}{found['iterations']:6d}{found['volume_error']:9.1e}"
        f"{found['seconds']:8.2f}" + (f"  {found['stopped']}" if found["stopped"] else ""))


def main():
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--quick", action="store_true", help="coarse meshes only")
    options.add_argument("--out", type=Path, default=Path("results/treloar_mesh"))
    args = options.parse_args()
    head = f"{'':34}{'limit':>10}" + "".join(f"{'at ' + format(s, 'g'):>10}" for s in STRETCHES)
    say(head + f"{'steps':>6}{'iter':>6}{'rms J-1':>9}{'s':>8}")
    results = {}

    def study(name, *arguments, **options):
        results[name] = pressures(*arguments, **options)
        show(name, results[name])

    meshes = [(10, 1), (20, 1), (40, 2), (80, 4)] + ([] if args.quick else [(160, 8)])
    hinge, clamp, pin = fx.SimplySupported("rim"), fx.Clamped("rim"), fx.PinnedNode(1.25, 0.041)
    for n in meshes:
        study(f"simply supported {n[0]}x{n[1]}", n, hinge)
    for n in meshes[:3]:
        study(f"clamped {n[0]}x{n[1]}", n, clamp)
    for n, grading in [((40, 2), 0.3), ((40, 4), 0.3), ((60, 4), 0.2), ((80, 4), 1.0)][:2 if args.quick else None]:
        study(f"clamped {n[0]}x{n[1]}, rim {grading:g} of pole", n, clamp, grading=grading, until=3.0, max_steps=120)
    for space in () if args.quick else ("P1dg", "P1"):
        for n in ((60, 3), (80, 4)):
            study(f"clamped {n[0]}x{n[1]}, {space}", n, clamp, fx.MixedPressure(space=space), max_steps=100)
    for n in ((10, 1), (20, 2), (40, 4))[:2 if args.quick else None]:
        study(f"pinned node {n[0]}x{n[1]}", n, pin, until=3.0, max_steps=120)
    for eps in (8e-2, 2e-2, 1e-3):
        study(f"10x1, penalty with pressure {eps:g}", (10, 1), hinge, fx.MixedPressure(eps=eps))
    for points in (3, 4, 7):
        study(f"10x1, displacement only, {points} points, 8e-2", (10, 1), hinge,
              fx.DisplacementPenalty(eps=8e-2, points=points), max_steps=120)
    sheet = {"radius": 1.25, "thickness": 0.082, "c10": 2.0}
    results["membrane theory"] = {"limit": membrane_limit_point(**sheet)[1].pressure,
                                  "at": [membrane_inflation(s, **sheet).pressure for s in STRETCHES]}
    files.write_summary(args.out / "summary.json", results, COMM)


if __name__ == "__main__":
    main()
