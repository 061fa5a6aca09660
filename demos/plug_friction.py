"""Push Williams' plug under five coefficients of friction: force, wall and snaps (Song 1993, section 6.3).

The sheet of `williams_plug` (neo-Hookean, c10 = 0.448 MPa; r0 = 8.89 cm, h0 = 0.6985 cm; plug radius 1.905 cm, its edge
rounded) is pushed by 20 cm, beside a membrane that slides over the same edge. Where points of the sheet leave the edge
of the plug there may be no state nearby. Then the sheet snaps to its next equilibrium (`Path.jumps`), marked in the
curves.

The less friction, the more of the face slides over the edge, and the thinner it becomes: a membrane under mu = 0.1 is
stretched 130 times in both directions at 20 cm. The size of the elements is therefore in proportion to their distance
from the axis, so that the same number lies around the edge at any travel. Their pressures are continuous, because the
elements are slim. Much friction shears the sheet; there the elements at the plug are the thinnest. Forces and walls of
the first 8 cm come from a run with smaller elements. Lengths in cm, forces in N.
"""

from typing import NamedTuple

import numpy as np
import plugs
from common import parser, save, say, summarise, sweep
from mpi4py import MPI
from scipy.interpolate import PchipInterpolator
from williams_plug import C10, PLUG, RADIUS, THICKNESS, TRAVELS

import formingx as fx
from formingx import figures
from formingx.exact.plug import membrane_sliding_over_plug
from formingx.results import files

FRICTIONS = (1.0, 0.1, 0.5, 0.3, 0.2)      # begun in this order, two processes are busy to the end
MOST = 25                                   # stretch of the face that elements are made for, at most
FIRST = 8                                   # travel, cm, up to which elements of its own give forces and walls
ROUGH, THROUGH = 0.5, (4, 2, 1)             # mu from which friction shears the sheet: flat elements at the plug
HELD = 1.0                                  # mu from which so little slides that elements made for it are halved
FACE_STRETCHES = (1.01, 1.05, 1.1, 1.2, 1.35, 1.5, 1.75, 2, 2.5, 3.2, 5, 10, 25, 80, 200)


def main():
    options = parser("plug_friction", __doc__)
    options.add_argument("--fillet", type=float, default=0.35, help="radius of the plug's edge, cm")
    options.add_argument("--refine", type=int, default=1, help="divisor of the size of all elements")
    options.add_argument("--mu", type=float, nargs="+", default=FRICTIONS, help="coefficients of friction")
    args = options.parse_args()
    frictions, travels = ((0.3,), (2, 4, 6, 8)) if args.quick else (args.mu, TRAVELS)
    args.out.mkdir(parents=True, exist_ok=True)
    cases = [(mu, args.fillet, args.refine, travels, args.out) for mu in frictions]
    runs = dict(sorted(zip(frictions, map(run, cases) if args.quick else sweep(run, cases))))
    for mu, found in runs.items():
        print_numbers(mu, found["numbers"])
    save(draw(runs), args.out / "plug_friction.png")
    summarise(args.out, {**{f"mu_{mu:g}": found["numbers"] for mu, found in runs.items()},
                         "fillet_cm": args.fillet, "versions": files.versions()})


def run(case) -> dict:
    """Return the numbers of one coefficient of friction, and the curves to be drawn."""
    mu, fillet, refine, travels, folder = case
    membrane, rough = membrane_curve(mu, fillet, travels[-1]), mu >= ROUGH
    path, end, elements = pushed(mu, fillet, membrane, travels, refine * (2 if mu >= HELD else 1),
                                 np.repeat(THROUGH if rough else (1,), refine), ramp=2e-2)
    numbers = {"elements": list(elements), **key_numbers(path, end, travels)}
    first, first_end, first_elements = pushed(mu, fillet, membrane, [t for t in travels if t <= FIRST], 2 * refine,
                                              (1,) * (refine * (4 if rough else 2)), ramp=2e-3)
    for name, values in at_travels(first, travels).items():
        numbers[name] |= values
    numbers[f"first_{FIRST}_cm"] = {"elements": list(first_elements), "ended": first_end, **plugs.cost(first)}
    numbers["membrane_force_N_at_travel_cm"] = {
        f"{t:g}": float(np.interp(t, membrane.travel, membrane.force)) for t in travels}
    path.to_csv(folder / f"mu_{mu:g}.csv")
    profile = path.profile()
    return {"numbers": numbers, "travel": path["travel"], "force": plugs.NEWTON * path["tool_force"],
            "jumps": [(state.measures["travel"], plugs.force(state)) for state in path.jumps],
            "membrane": (membrane.travel, membrane.force), "radius": profile.reference_radius,
            "wall": profile.wall_ratio}


def pushed(mu, fillet, membrane, travels, refine, through, ramp) -> tuple:
    """Return the path of a sheet whose elements suit the last travel, how it ended, and the elements."""
    stretch = float(np.interp(travels[-1], membrane.travel, membrane.face_stretch))
    made, elements = plugs.sliding(RADIUS, THICKNESS, PLUG, fillet, fx.NeoHookean(c10=C10), mu, min(stretch, MOST),
                                   refine, through, penalty=2e5, ramp=ramp, elastic_slip=5e-3,
                                   comm=MPI.COMM_SELF)
    return *plugs.push(made, travels, smallest=1e-3, progress=False), elements


class Membrane(NamedTuple):
    """Curves of a membrane that slides over the plug.

    Attributes:
        travel: travel of the plug, cm, shape (n,).
        force: force on the plug, N, shape (n,).
        stretch: stretch of the face of the membrane, shape (n,).
    """

    travel: np.ndarray
    force: np.ndarray
    face_stretch: np.ndarray


def membrane_curve(mu, fillet, last) -> Membrane:
    """Return the curves of the membrane, up to a travel."""
    found = [(0.0, 0.0, 1.0)]
    for stretch in FACE_STRETCHES:
        state = membrane_sliding_over_plug(stretch, radius=RADIUS, plug_radius=PLUG, fillet=fillet,
                                           thickness=THICKNESS, c10=C10, mu=mu)
        found.append((state.travel, plugs.NEWTON * state.force, stretch))
        if state.travel > last:
            break
    travels, forces, stretches = np.transpose(found)
    fine = np.linspace(0, last, 400)
    return Membrane(fine, *(PchipInterpolator(travels, values)(fine) for values in (forces, stretches)))


def at_travels(path, travels) -> dict:
    """Return forces and minimum walls at the travels that a path met."""
    met = {f"{t:g}": path.target_state(fx.travel(t)) for t in travels}
    met = {t: state for t, state in met.items() if state is not None}
    return {
        "force_N_at_travel_cm": {t: plugs.force(state) for t, state in met.items()},
        "least_wall_ratio_at_travel_cm": {t: float(path.profile(s).wall_ratio.min()) for t, s in met.items()},
    }


def key_numbers(path, end, travels) -> dict:
    """Return forces, walls, jumps and cost of one path."""
    return {
        **at_travels(path, travels),
        "jumps": len(path.jumps),
        "jumps_at_travel_cm": [state.measures["travel"] for state in path.jumps],
        "dissipated_in_jumps_MPa_cm3": [state.jump["dissipated"] for state in path.jumps],
        "moved_in_jumps_cm": [state.jump["moved"] for state in path.jumps],
        "reached_travel_cm": float(path["travel"].max()),
        "pole_stretch": path.last.measures["pole_stretch"],
        "ended": end,
        **plugs.cost(path),
    }


def print_numbers(mu, n) -> None:
    """Print the numbers of one run."""
    say(f"mu = {mu:g}: to {n['reached_travel_cm']:.4g} cm, {n['steps']} states, {n['newton_iterations']} Newton"
        f" iterations, {n['cutbacks']} cut back, {n['jumps']} jumps, {n['solve_seconds']:.1f} s; force (membrane), N: "
        + ", ".join(f"{t} cm {f:.1f} ({n['membrane_force_N_at_travel_cm'][t]:.0f})"
                    for t, f in n["force_N_at_travel_cm"].items()),
        *(f"  ended before its target: {end[:200]} ..." for end in (n["ended"], n[f"first_{FIRST}_cm"]["ended"])
          if end != "done"))


def draw(runs):
    """Return a figure: force over travel, jumps as rings, the membrane dashed, and the wall at the end."""
    figure, (forces, walls) = figures.figure(2, width=5.0)
    for k, (mu, found) in enumerate(runs.items()):
        forces.plot(found["travel"], found["force"], color=f"C{k}", label=f"$\\mu$ = {mu:g}")
        forces.plot(*np.transpose(found["jumps"] or [(0, 0)]), "o", color=f"C{k}", fillstyle="none", markersize=3)
        forces.plot(*found["membrane"], "--", color=f"C{k}", linewidth=1)
        walls.semilogy(found["radius"], found["wall"], color=f"C{k}", label=f"$\\mu$ = {mu:g}")
    forces.set(xlabel="travel, cm", ylabel="force on the plug, N", title="force (rings: jumps; dashed: membrane)",
               ylim=(0, None), xlim=(0, max(found["travel"].max() for found in runs.values())))
    walls.set(xlabel="reference radius R, cm", ylabel="wall / original", title="thickness at the end", xlim=(0, RADIUS))
    walls.axvline(PLUG, color="0.7", linewidth=1)
    for axes in (forces, walls):
        axes.grid(alpha=0.3)
        axes.legend(frameon=False, fontsize="small")
    return figure


if __name__ == "__main__":
    main()
