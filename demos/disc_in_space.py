"""Inflate Treloar's disc as a three-dimensional membrane, against the membrane of revolution (Adkins, Rivlin 1952).

Neo-Hookean, radius 1, a quarter of the disc in linear triangles. Each state has the pole height of the exact membrane
at a pole stretch. Flat triangles are too stiff, in proportion to the square of their size. So the pressures of two
sizes are extrapolated: those of 0.1 and 0.05 are 1.2 and 0.3 % off at stretch 3, the extrapolated one 1e-4.
"""

import numpy as np
from common import parser, say, summarise

import formingx as fx
from formingx.exact.inflation import membrane_inflation, membrane_limit_point
from formingx.results import files

THICKNESS, C10 = 0.01, 1.0
STRETCHES = (1.5, 2, 3)
EXACT = {s: membrane_inflation(s, radius=1.0, thickness=THICKNESS, c10=C10) for s in STRETCHES}


def inflate(size):
    """Return the path to pole stretch 3, on triangles of a size, and its targets."""
    sheet = fx.mesh.sheet(fx.mesh.circle(1.0, part="quarter"), size=size)
    scene = fx.Scene(mesh=sheet, thickness=THICKNESS, materials=fx.NeoHookean(c10=C10), loads=[fx.Pressure("bottom")],
                     supports=[fx.SimplySupported("rim"), fx.Symmetry("x0", "x"), fx.Symmetry("y0", "y")])
    targets = [fx.displacement(EXACT[s].height, at=(0, 0)) for s in STRETCHES]
    return fx.trace(scene, until=targets[-1], intermediate=targets[:-1]), targets


def key_numbers(path, targets):
    """Return the numbers of the summary of one path."""
    limit = membrane_limit_point(radius=1.0, thickness=THICKNESS, c10=C10)[1].pressure
    states = {f"{s:g}": (path.target_state(target), EXACT[s]) for s, target in zip(STRETCHES, targets)}
    return {
        "pressure_over_axisymmetric": {s: state.measures["pressure"] / exact.pressure
                                       for s, (state, exact) in states.items()},
        "pole_thickness_over_axisymmetric": {
            s: path.wall(state).thickness_at(0, 0) / THICKNESS / exact.thickness_ratio[0]
            for s, (state, exact) in states.items()},
        "limit_pressure_over_axisymmetric": path.limit_points[0].measures["pressure"] / limit,
        "unknowns": path.problem.n_unknowns, "states": len(path), "iterations": path.counts.iterations,
        "failures": path.counts.failures, "seconds": path.counts.seconds}


def main():
    options = parser("disc_in_space", __doc__)
    options.add_argument("--sizes", type=float, nargs="+", default=[0.1, 0.05, 0.025], help="sizes of the triangles")
    args = options.parse_args()
    sizes, summary = [0.1, 0.05] if args.quick else args.sizes, {}
    for size in sizes:
        path, targets = inflate(size)
        summary[f"size_{size:g}"] = numbers = key_numbers(path, targets)
        off = {s: f"{ratio - 1:.1e}" for s, ratio in numbers["pressure_over_axisymmetric"].items()}
        thin = {s: f"{ratio - 1:.1e}" for s, ratio in numbers["pole_thickness_over_axisymmetric"].items()}
        say(f"size {size:g}: {numbers['unknowns']} unknowns, {numbers['iterations']} iterations; at pole stretch"
            f" {', '.join(off)} the pressure is off by {', '.join(off.values())}, the wall at the pole by"
            f" {', '.join(thin.values())}")
    coarse, fine = (summary[f"size_{size:g}"]["pressure_over_axisymmetric"] for size in sizes[:2])
    finer = sizes[0] / sizes[1]
    summary["order_of_pressure"] = {s: np.log((coarse[s] - 1) / (fine[s] - 1)) / np.log(finer) for s in fine}
    summary["extrapolated"] = {"pressure_over_axisymmetric": {
        s: fine[s] + (fine[s] - coarse[s]) / (finer**2 - 1) for s in fine}}
    say("pressure extrapolated from the first two: off by " + ", ".join(
        f"{ratio - 1:.1e}" for ratio in summary["extrapolated"]["pressure_over_axisymmetric"].values()))
    path.to_csv(args.out / "disc.csv")
    if not args.quick:
        path.view3d(args.out / "disc_3d.png", grid=0.1)
    summarise(args.out, {**summary, "versions": files.versions()})


if __name__ == "__main__":
    main()
