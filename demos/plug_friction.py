"""Friction of a plug, from little to rough: force, wall, and where the sheet snaps (Williams' plug, Song 1993, 6.3).

The sheet of `williams_plug` (neo-Hookean, c10 = 0.448 MPa; r0 = 8.89 cm, h0 = 0.6985 cm; plug radius 1.905 cm, its edge
rounded) pushed 20 cm under five coefficients of friction. Where points of the sheet leave the edge of the plug there
may be no state nearby to go on to: the sheet snaps to the next one (`Path.jumps`), marked in the curves. Contact acts
at four Gauss points of each facet, which slide over the edge more smoothly than nodes. A run that no jump takes further
ends there, and its summary says so in words. Lengths in cm, forces in N.
"""

import plugs
from common import parser, save, say, summarise
from williams_plug import C10, PLUG, RADIUS, THICKNESS, TRAVELS

import formingx as fx
from formingx.results import files
from formingx.results.show import plots

FRICTIONS = (0.1, 0.2, 0.3, 0.5, 1.0)


def main():
    options = parser("plug_friction", __doc__.splitlines()[0])
    options.add_argument("--fillet", type=float, default=0.35, help="radius of the plug's edge, cm")
    options.add_argument("--refine", type=int, default=1, help="all elements divided by this")
    args = options.parse_args()
    elements = tuple(n * args.refine for n in ((60, 2) if args.quick else (80, 2)))
    summary, paths = {}, {}
    for mu in (0.3,) if args.quick else FRICTIONS:
        made = plugs.scene(RADIUS, THICKNESS, PLUG, args.fillet, fx.NeoHookean(c10=C10), mu, elements,
                            points=4, ramp=1e-3)
        path, end = plugs.push(made, TRAVELS, smallest=1e-3)
        summary[f"mu_{mu:g}"], paths[mu] = key_numbers(path, end), path
        tell(mu, summary[f"mu_{mu:g}"])
        path.to_csv(args.out / f"mu_{mu:g}.csv")
    save(draw(paths), args.out / "plug_friction.png")
    summarise(args.out, {**summary, "elements": list(elements), "fillet_cm": args.fillet,
                         "versions": files.versions()})


def key_numbers(path, end) -> dict:
    """Forces, walls, jumps and cost of one path."""
    met = {f"{t:g}": path.met(fx.travel(t)) for t in TRAVELS}
    met = {t: state for t, state in met.items() if state is not None}
    return {
        "force_N_at_travel_cm": {t: plugs.force(state) for t, state in met.items()},
        "least_wall_ratio_at_travel_cm": {t: float(path.profile(s).wall_ratio.min()) for t, s in met.items()},
        "jumps": len(path.jumps),
        "jumps_at_travel_cm": [state.measures["travel"] for state in path.jumps],
        "dissipated_in_jumps_MPa_cm3": [state.jump["dissipated"] for state in path.jumps],
        "moved_in_jumps_cm": [state.jump["moved"] for state in path.jumps],
        "reached_travel_cm": float(path["travel"].max()),
        "pole_stretch": path.last.measures["pole_stretch"],
        "ended": end,
        **plugs.cost(path),
    }


def tell(mu, n) -> None:
    """The numbers of one run."""
    say(f"mu = {mu:g}: to {n['reached_travel_cm']:.4g} cm, {n['steps']} states, {n['newton_iterations']} Newton"
        f" iterations, {n['cutbacks']} cut back, {n['jumps']} jumps, {n['solve_seconds']:.1f} s; force, N: "
        + ", ".join(f"{t} cm {f:.1f}" for t, f in n["force_N_at_travel_cm"].items()),
        *([] if n["ended"] == "done" else [f"  ended before its target: {n['ended'][:200]} ..."]))


def draw(paths):
    """Force over travel, jumps ringed, and the wall at the end."""
    figure, (forces, walls) = plots.figure(2, width=5.0)
    for k, (mu, path) in enumerate(paths.items()):
        forces.plot(path["travel"], plugs.NEWTON * path["tool_force"], color=f"C{k}", label=f"$\\mu$ = {mu:g}")
        for state in path.jumps:
            forces.plot(state.measures["travel"], plugs.force(state), "o", color=f"C{k}", fillstyle="none")
        profile = path.profile()
        walls.plot(profile.reference_radius, profile.wall_ratio, color=f"C{k}",
                   label=f"$\\mu$ = {mu:g}, {path.last.measures['travel']:.3g} cm")
    forces.set(xlabel="travel, cm", ylabel="force on the plug, N", title="force (rings: jumps)", ylim=(0, None))
    walls.set(xlabel="reference radius R, cm", ylabel="wall / original", title="thickness", ylim=(0, 1.02),
              xlim=(0, RADIUS))
    walls.axvline(PLUG, color="0.7", linewidth=1)
    for axes in (forces, walls):
        axes.grid(alpha=0.3)
        axes.legend(frameon=False, fontsize="small")
    return figure


if __name__ == "__main__":
    main()
