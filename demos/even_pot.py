"""Find the plug and the heat for the most even pot: travel, nose and friction, and the temperature over R.

A clamped sheet of radius 3 cm and thickness 0.1 cm relaxes, and is softer where it is hotter. A plug pushes it into a
mould 2.6 cm deep in half a second; air presses it onto the mould, to which it sticks, in another half. The goal is the
smallest standard deviation over mean (cv) of the wall up to R = 2.7 cm. Seven numbers are found by derivatives of runs
(`fx.Design`), and by the search of Nelder and Mead from the same start (`Study.refine`). Lengths in cm, stresses in
MPa, times in s, temperatures in C.
"""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
from common import parser, save, say, summarise

import formingx as fx
from formingx.figures import figure
from formingx.results import files

RADIUS, SHEET, PART, PRESSURE, KNOTS = 3.0, 0.1, 2.7, 1.0, 4
SOFTER = fx.table({100.0: 0.8, 120.0: 0.5, 140.0: 0.3, 160.0: 0.18, 180.0: 0.11})
PLUG = {"travel": (1.6, 0.8, 2.3), "nose": (0.6, 0.2, 1.2), "mu": (0.3, 0.05, 0.6)}
HEAT = (140.0, 105.0, 175.0)                                 # of every knot: start, lowest, highest
STEP = fx.StepControl(target=8)


def pot(travel, nose, mu, heat, elements=(24, 1)):
    """Return the scene of a pot and its stages; heat is the temperature over R/R0."""
    mesh = fx.mesh.disc(radius=RADIUS, thickness=SHEET, elements=elements)
    mould = fx.tools.cup(radius=3.0, depth=2.6, mouth=SHEET, draft=8.0, fillet=0.6, lip=0.15)
    plug = fx.tools.male(radius=1.5, height=8.0, base=-8.0, draft=3.0, fillet=nose)
    sheet = fx.Viscoelastic(fx.NeoHookean(c10=SOFTER), branches=[(1.0, 0.5)])
    scene = fx.Scene(mesh=mesh, materials=sheet, temperature=lambda R, Z: heat(R / RADIUS),
                     supports=[fx.Symmetry("axis"), fx.Clamped("rim")], loads=[fx.Pressure("bottom", name="air")],
                     contacts=[fx.Contact("top", mould, "stick", separates=False, name="mould"),
                               fx.Contact("bottom", plug, mu, direction=(0, 1), name="plug")])
    return scene, [fx.Stage("plug", control="plug", until=fx.travel(travel), duration=0.5),
                   fx.Stage("air", control="air", until=fx.pressure(PRESSURE), duration=0.5)]


def run(travel, nose, mu, elements=(24, 1), **heat):
    """Return the path of a pot; the temperatures of the knots are numbers."""
    places, T = np.linspace(0, 1, len(heat)), list(heat.values())
    scene, stages = pot(travel, nose, mu, lambda s: np.interp(s, places, T), elements)
    return fx.Process(scene).run(stages, step=STEP, progress=False)


def cv(path):
    """Return the standard deviation over the mean of the wall."""
    profile = path.profile()
    wall = profile.thickness[profile.reference_length <= PART]
    return wall.std() / wall.mean()


def main():
    options = parser("even_pot", __doc__)
    options.add_argument("--runs", type=int, default=8, help="largest number of runs of the search with derivatives")
    options.add_argument("--search", type=int, default=32, help="runs of Nelder and Mead's search")
    args = options.parse_args()
    elements, runs, search = ((12, 1), 2, 2) if args.quick else ((24, 1), args.runs, args.search)
    design = fx.Design(lambda **values: pot(**values, elements=elements),
                       {**PLUG, "heat": fx.spline(KNOTS, start=HEAT[0], low=HEAT[1], high=HEAT[2])}, step=STEP)
    result = design.fit(even=True, within=(0.0, PART), volume=None, max_runs=runs, min_change=2e-3)
    say(str(result))
    heats = {f"heat_{k}": HEAT for k in range(KNOTS)}
    bounds = {**PLUG, **heats}
    with ThreadPoolExecutor(1) as here:
        study = fx.study(lambda **values: run(**values, elements=elements),
                         [{name: b[0] for name, b in bounds.items()}], {"cv": cv}, goal={"cv": "min"}, executor=here,
                         progress=False)
        study.refine(search, {name: b[1:] for name, b in bounds.items()}, executor=here)
    found = [one.measures.get("cv", np.inf) for one in study.runs]
    reached = next((k + 1 for k, value in enumerate(found) if value <= result.cv[1]), None)
    say(f"Nelder and Mead: cv {min(found):.4f} in {len(found)} runs; that of the derivatives"
        f" {'after ' + str(reached) + ' runs' if reached else 'was not reached'}")
    drawing, axes = figure(2)
    result.plot_wall(axes[0])
    axes[0].set(xlabel="reference radius R, cm", ylabel="wall, cm")
    axes[1].plot(range(1, len(result.runs) + 1), [one.wall[result.inside].std() / one.wall[result.inside].mean()
                                                  for one in result.runs], "C0o-", label="with derivatives")
    axes[1].plot(range(1, len(found) + 1), np.minimum.accumulate(found), "0.5", label="Nelder and Mead")
    axes[1].set(xlabel="runs", ylabel="standard deviation / mean of the wall", ylim=(0, None))
    axes[1].legend()
    save(drawing, args.out / "even_pot.png")
    values = {name: value.values.tolist() if name == "heat" else value for name, value in result.values.items()}
    summarise(args.out, {
        "cv_before": result.cv[0], "cv_after": result.cv[1], "paths": result.paths, "values": values,
        "refine": {"cv_after": min(found), "paths": len(found), **({"paths_to_the_same": reached} if reached else {})},
        "elements_along": elements[0], "versions": files.versions()})


if __name__ == "__main__":
    main()
