"""Form a deep cup by plug and vacuum, beside straight vacuum forming (Song 1993, section 6.5, figs. 6.16, 6.17).

Sheet and mould as in demos/deep_cup.py (Mooney, I1 constant 50 psi, I2 constant 15 psi; r0 = 10 cm, h0 = 0.3 cm,
clamped; cup 10 cm deep). The plug travels to 60 % of the depth. Its size is not in the thesis: radius 5 cm, edge 1.5 cm
here. An elastic sheet keeps the effect of the plug only where it sticks, so the way in which it separates decides:

lifts     The sheet separates from the plug (friction 0.3) as soon as vacuum is drawn.
holds     Points stay on plug and mould once they touch, as on a cold tool: 20 psi lay the wall on the mould, the
          pressure falls to 6 psi, the plug is removed, 60 psi fill the corner.
carries   The same, but before its removal the plug carries the base to the bottom.

Then a map over plug radius and travel, for "holds" and "carries", of base, corner and minimum wall; in parallel
processes, or with mpirun over the ranks. Lengths in cm, stresses in psi.
"""

import numpy as np
from common import COMM, parser, save, say, summarise, sweep
from deep_cup import PRESSURES, RADIUS, THICKNESS, form
from moulding import cost
from mpi4py import MPI

import formingx as fx
from formingx import figures
from formingx.results import files
from formingx.results.show import plots

DEPTH, DRAFT, FILLET, EDGE = 10.0, 5.0, 2.0, 1.5
SHARE, SEAL, LOW = 0.6, 20.0, 6.0                            # of the depth; psi, to lay the wall; psi, to let go
RADII = (3.0, 4.0, 5.0, 6.0, 7.0)                            # of the map, and its (share of the depth, way)
WAYS = ((0.4, "holds"), (0.6, "holds"), (0.8, "holds"), (0.6, "carries"))
STEP = fx.StepControl(target=8)
MOULD = fx.tools.cup(radius=RADIUS, depth=DEPTH, mouth=THICKNESS, draft=DRAFT, fillet=FILLET)
LABELS = {"straight": "straight vacuum", "lifts": "plug, sheet lifts off", "holds": "plug holds to 60 %",
          "carries": "plug carries the base"}


def plug_then_vacuum(way, radius, share, elements, comm=COMM, progress=True):
    """Return the path of the process; the plug travels a share of the depth first."""
    lifts = way == "lifts"
    mesh = fx.mesh.disc(radius=RADIUS, thickness=THICKNESS, elements=elements, comm=comm)
    plug = fx.tools.male(radius=radius, height=40.0, base=-40.0, fillet=EDGE)
    scene = fx.Scene(mesh=mesh, materials=fx.MooneyRivlin(c10=50.0, c01=15.0),
                     supports=[fx.Symmetry("axis"), fx.Clamped("rim")], loads=[fx.Pressure("bottom", name="vacuum")],
                     contacts=[fx.Contact("top", MOULD, "stick", separates=lifts, name="mould"),
                               fx.Contact("bottom", plug, 0.3 if lifts else "stick", separates=lifts, direction=(0, 1),
                                          name="plug")])
    full = [fx.pressure(p) for p in PRESSURES]
    stages = [fx.Stage("plug", control="plug", until=fx.travel(share * DEPTH))]
    if lifts:
        stages += [fx.Stage("vacuum", control="vacuum", until=full[-1], intermediate=full[:-1]),
                   fx.Stage("plug out", control="plug", until=fx.travel(0.0))]
        return fx.Process(scene).run(stages, step=STEP, max_steps=800, progress=progress)
    stages += [fx.Stage("wall", control="vacuum", until=fx.pressure(SEAL)),
               fx.Stage("relax", control="vacuum", until=fx.pressure(LOW))]
    process = fx.Process(scene)
    path = process.run(stages, step=STEP, progress=progress)
    if way == "carries":                                     # the base is pressed to the bottom by h0/100
        bottom = DEPTH + 1.01 * THICKNESS - path.profile().thickness[0]
        stages += [fx.Stage("plug on", control="plug", until=fx.travel(bottom))]
    stages += [fx.Stage("plug off", inactive=["plug"]),
               fx.Stage("vacuum", control="vacuum", until=full[-1], intermediate=full[2:-1], inactive=["plug"])]
    return process.run(stages, step=STEP, max_steps=800, start=path, progress=progress)


def end_of(path, stage):
    """Return the last state of a stage."""
    return [state for state in path.states if state.stage == stage][-1]


def thickness(path, state) -> dict:
    """Return the thickness ratios of base and corner and the smallest one."""
    arc = next(p for p in MOULD.pieces if hasattr(p, "radius"))
    angle = arc.start + arc.sweep / 2
    profile = path.profile(state)
    corner = np.hypot(*(profile.top - arc.centre - arc.radius * np.array([np.cos(angle), np.sin(angle)])).T).argmin()
    ratio = profile.wall_ratio
    return {"base": float(ratio[0]), "corner": float(ratio[corner]), "least": float(ratio.min()),
            "least_at_R_cm": float(profile.reference_radius[ratio.argmin()])}


def case(arguments):
    """Return the thickness ratios of one point of the map, or why there are none, on this process."""
    way, radius, share, elements = arguments
    try:
        path = plug_then_vacuum(way, radius, share, elements, MPI.COMM_SELF, progress=False)
    except (fx.ConvergenceError, fx.InputError) as error:
        return str(error)
    return thickness(path, path.last)


def main():
    options = parser("plug_and_vacuum", __doc__, elements=60, layers=2)
    options.add_argument("--radius", type=float, default=5.0, help="radius of the plug, cm")
    args = options.parse_args()
    elements = (30, 1) if args.quick else (args.elements, args.layers)
    paths = {"straight": form("stick", elements, DEPTH, DRAFT, FILLET)[0]}
    paths |= {way: plug_then_vacuum(way, args.radius, SHARE, elements) for way in ("lifts", "holds", "carries")}
    summary: dict = {name: thickness(path, path.last) | cost(path) for name, path in paths.items()}
    for name, n in summary.items():
        say(f"{name}: base {n['base']:.4f}, corner {n['corner']:.4f}, thinnest {n['least']:.4f} of h0 at R ="
            f" {n['least_at_R_cm']:.3g} cm; {n['steps']} states, {n['newton_iterations']} Newton iterations,"
            f" {n['cutbacks']} cut back, {n['solve_seconds']:.1f} s")
        paths[name].to_csv(args.out / f"{name}.csv")
    radii, ways = (RADII[1::2], WAYS[1::2]) if args.quick else (RADII, WAYS)
    cases = [(way, r, share, (30, 1) if args.quick else (40, 1)) for r in radii for share, way in ways]
    found = sweep(case, cases)
    summary["map"] = [{"way": way, "radius_cm": r, "travel_cm": share * DEPTH,
                       **(n if isinstance(n, dict) else {"ended": n})} for (way, r, share, _), n in zip(cases, found)]
    for n in summary["map"]:
        say(f"plug of radius {n['radius_cm']:g} cm {n['way']} at {n['travel_cm']:g} cm: " + (
            n["ended"][:200] if "ended" in n else f"base {n['base']:.4f}, corner {n['corner']:.4f}, thinnest"
            f" {n['least']:.4f} at R = {n['least_at_R_cm']:.3g} cm"))
    summary["most_even"] = best = max((n for n in summary["map"] if "least" in n), key=lambda n: n["least"])
    say(f"most even wall: a plug of radius {best['radius_cm']:g} cm that {best['way']} at {best['travel_cm']:g} cm:"
        f" thinnest {best['least']:.4f} of h0 (straight vacuum: {summary['straight']['least']:.4f})")
    save(draw(paths, args.radius), args.out / "plug_and_vacuum.png")
    save(draw_map(summary["map"], radii, ways), args.out / "map.png")
    if not args.quick:
        paths["carries"].view3d(args.out / "plug_and_vacuum_3d.png")
    summarise(args.out, {**summary, "mesh": {"radius_elements": elements[0], "thickness_elements": elements[1]},
                         "versions": files.versions()})


def draw(paths, radius):
    """Return a figure of the stages of the plug that carries the base, and of all walls: figs. 6.16 and 6.17."""
    figure, (shapes, ratios) = figures.figure(2, width=5.2, height=5.0)
    path = paths["carries"]
    shapes.plot(*MOULD.outline().T, "k", linewidth=1.5)
    for k, stage in enumerate(s for s in dict.fromkeys(s.stage for s in path.states) if s != "plug off"):
        plots.outline(path.profile(end_of(path, stage)), shapes, color=f"C{k}", label=stage)
    tool = fx.tools.male(radius=radius, height=40.0, base=-40.0, fillet=EDGE).outline()
    shapes.plot(*(tool + [0, SHARE * DEPTH]).T, "0.5", linewidth=1)
    shapes.set(xlabel="r, cm", ylabel="z, cm", xlim=(0, 1.05 * RADIUS), ylim=(-0.5, 1.1 * DEPTH))
    shapes.set_aspect("equal")
    shapes.legend(frameon=False, fontsize="small", loc="lower left")
    for (name, path), style in zip(paths.items(), ("k", "C1--", "C2", "C3")):
        profile = path.profile()
        ratios.plot(profile.reference_radius, profile.wall_ratio, style, label=LABELS[name])
    ratios.set(xlabel="reference radius R, cm", ylabel="wall / original", ylim=(0, 1.02))
    ratios.legend(frameon=False)
    return figure


def draw_map(found, radii, ways):
    """Return a figure of base, corner and minimum wall over the plug's radius, for every travel and way."""
    figure, axes = figures.figure(3, width=3.8)
    for ax, key in zip(axes, ("base", "corner", "least")):
        for share, way in ways:
            n = [next(m for m in found if (m["way"], m["radius_cm"], m["travel_cm"]) == (way, r, share * DEPTH))
                 for r in radii]
            ax.plot(radii, [m.get(key, np.nan) for m in n], "o-", label=f"{share * DEPTH:g} cm, {way}")
        ax.set(xlabel="plug radius, cm", ylabel="thickness / original",
               title={"least": "thinnest place"}.get(key, key))
    axes[0].legend(frameon=False, title="plug travel")
    return figure


if __name__ == "__main__":
    main()
