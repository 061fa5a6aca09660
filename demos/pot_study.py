"""Find the most even yoghurt pot: travel, radius and friction of the plug in 60 runs in parallel, then a search.

A sheet of radius 40 mm and thickness 1.2 mm (Mooney, 0.35 and 0.05 MPa: a soft sheet, as an example) is clamped. A plug
stretches it into a mould 60 mm deep; vacuum takes it off the plug and presses it onto the mould, to which it sticks. An
elastic sheet keeps the effect of the plug only through friction and through the mould. Evenness is `Part.uniformity`:
minimum over mean wall of the part, trimmed at 38 mm. Lengths in mm, stresses in MPa. The 60 runs take 120 s of
processor time, shared by the cores. (Friction is at most 0.45: with 0.6 five of the eight runs at travels of 48 and
54 mm ended as the vacuum began, because contact did not settle.)
"""

import os
import time

from common import parser, save, say, summarise
from mpi4py import MPI

import formingx as fx
from formingx.results import files

SHEET, THICKNESS, DEPTH, TRIM = 40.0, 1.2, 60.0, 38.0
PRESSURE = 0.4
DESIGN = {"travel": [30.0, 36.0, 42.0, 48.0, 54.0], "radius": [16.0, 19.0, 22.0, 25.0], "friction": [0.1, 0.3, 0.45]}
QUICK = {"travel": [30.0, 48.0], "radius": [16.0, 22.0], "friction": [0.3]}
UNITS = fx.Units("mm", "MPa")


def pot(travel, radius, friction, elements=(30, 1)):
    """Return the path of one pot, computed on this process alone."""
    mesh = fx.mesh.disc(radius=SHEET, thickness=THICKNESS, elements=elements, comm=MPI.COMM_SELF)
    mould = fx.tools.cup(radius=38.0, depth=DEPTH, mouth=THICKNESS, draft=6.0, fillet=5.0, lip=2.0)
    plug = fx.tools.male(radius=radius, height=120.0, base=-120.0, draft=3.0, fillet=6.0)
    scene = fx.Scene(mesh=mesh, materials=fx.MooneyRivlin(c10=0.35, c01=0.05),
                     supports=[fx.Symmetry("axis"), fx.Clamped("rim")], loads=[fx.Pressure("bottom", name="vacuum")],
                     contacts=[fx.Contact("top", mould, "stick", separates=False, name="mould"),
                               fx.Contact("bottom", plug, friction, direction=(0, 1), name="plug")])
    stages = [fx.Stage("plug", control="plug", until=fx.travel(travel)),
              fx.Stage("vacuum", control="vacuum", until=fx.pressure(PRESSURE))]
    return fx.Process(scene).run(stages, step=fx.StepControl(target=8), max_steps=600, progress=False)


def uniformity(path):
    """Return the minimum wall over the mean wall of the trimmed part."""
    return path.part(trim=TRIM).uniformity


def min_wall(path):
    """Return the minimum wall of the trimmed part, mm."""
    return path.part(trim=TRIM).min_wall


def plug_force(path):
    """Return the largest force on the plug (N)."""
    return path.tool_forces()["plug"].max()


MEASURES = {"evenness": uniformity, "least_wall": min_wall, "plug_force": plug_force}


def main():
    options = parser("pot_study", __doc__)
    options.add_argument("--workers", type=int, help="parallel processes (None: one for each core)")
    options.add_argument("--search", type=int, default=15, help="runs of the search after the 60 runs")
    args = options.parse_args()
    began, spent = time.perf_counter(), sum(os.times()[:4])
    found = fx.study(pot, QUICK if args.quick else DESIGN, MEASURES, goal={"evenness": "max", "plug_force": "min"},
                     folder=args.out / "runs", workers=args.workers)
    seconds, spent = time.perf_counter() - began, sum(os.times()[:4]) - spent      # its processes have ended
    workers = args.workers or os.cpu_count()
    say(str(found), f"in {seconds:.1f} s by {workers} at a time, {spent:.1f} s of processors")
    design = found.best
    effects = found.plot_effects("evenness")
    for axes, label in zip(effects.axes, ("travel of the plug, mm", "radius of the plug, mm", "friction of the plug")):
        axes.set_xlabel(label)
    save(effects, args.out / "effects.png")
    front = found.plot_pareto("evenness", "plug_force")
    front.axes[0].set(xlabel="evenness (minimum over mean wall)", ylabel="largest force on the plug, N")
    save(front, args.out / "pareto.png")
    if not args.quick:
        found.refine(evaluations=args.search)
        say(f"after a search: evenness {found.best.measures['evenness']:.4f} at {found.best.values}")
    found.to_csv(args.out / "runs.csv")
    found.report(args.out / "study.html", "Yoghurt pot: what makes it even")
    path = pot(**found.best.values)
    path.report(args.out / "best.html", "The most even pot", units=UNITS, density=1.05, trim=TRIM)
    path.animate(args.out / "best.gif", frames=12 if args.quick else 60, units=UNITS)
    summarise(args.out, {"runs": len(found.runs), "failed": len(found.runs) - len(found.successful), "seconds": seconds,
                         "processor_seconds": spent, "workers": workers,
                         "best_of_the_design": {**design.values, **design.measures},
                         "best": {**found.best.values, **found.best.measures},
                         "effects_on_evenness": found.effects("evenness") if args.quick else {
                             name: {str(k): v for k, v in levels.items() if k in DESIGN[name]}
                             for name, levels in found.effects("evenness").items()},
                         "versions": files.versions()})


if __name__ == "__main__":
    main()
