"""Compute the wall in the corner of a stuck cup on columns of one size, and on columns adapted to a first run.

The sheet and the cup of `cup`, but with a corner of an eighth of the thickness (0.0375 cm). The sheet sticks to the
mould, to 160 psi. The wall is thinnest beside the corner, where contact comes last. A sticking point keeps its wall, so
the minimum wall varies with the positions of the nodes, by percents on columns of one size. `mesh.adapted` takes a run
on 20 columns. In the result the sheet rotates by at most `share` radians along a column, as it bends or over a fillet.
Each mesh is made from the run on the one before. Lengths in cm, stresses in psi.
"""

import numpy as np
from common import parser, plain_ticks, save, say, summarise
from cup import DEPTH, I1_CONSTANT, I2_CONSTANT, RADIUS, THICKNESS

import formingx as fx
from formingx import figures
from formingx.results import files

CORNER = THICKNESS / 8
PRESSURES = (15.0, 30.0, 60.0, 160.0)
UNIFORM, SHARES, REFERENCE = (20, 30, 40, 60, 80, 120), (0.5, 0.3, 0.2), 240
INSIDE = 0.95                                                # of the radius: the clamped rim has a crease of its own


def form(mesh, pressures):
    """Return the path to the last pressure."""
    mould = fx.tools.cup(radius=RADIUS, depth=DEPTH, mouth=THICKNESS, fillet=CORNER)
    scene = fx.Scene(mesh=mesh, materials=fx.MooneyRivlin(c10=I1_CONSTANT, c01=I2_CONSTANT),
                     supports=[fx.Symmetry("axis"), fx.Clamped("rim")], loads=[fx.Pressure("bottom")],
                     contacts=[fx.Contact("top", mould, "stick")])
    targets = [fx.pressure(p) for p in pressures]
    return fx.trace(scene, until=targets[-1], intermediate=targets[:-1], step=fx.StepControl(target=8), progress=False)


def disc(columns):
    """Return a mesh with columns of one size."""
    return fx.mesh.disc(radius=RADIUS, thickness=THICKNESS, elements=(columns, 2))


def minimum_walls(path, pressures) -> dict:
    """Return {pressure as text: minimum wall over h0, away from the rim}."""
    shapes = {f"{p:g}": path.profile(path.target_state(fx.pressure(p))) for p in pressures}
    return {p: float(shape.wall_ratio[shape.reference_radius < INSIDE * RADIUS].min()) for p, shape in shapes.items()}


def main():
    args = parser("cup_adapted", __doc__).parse_args()
    pressures = PRESSURES[:1] if args.quick else PRESSURES
    uniform, shares = ((20, 40), (0.5,)) if args.quick else ((*UNIFORM, REFERENCE), SHARES)
    runs = {"uniform": [form(disc(n), pressures) for n in uniform], "adapted": []}
    path = runs["uniform"][0]
    for share in shares:
        path = form(fx.mesh.adapted(path, max_rotation=share), pressures)
        runs["adapted"].append(path)
    walls = {name: {columns(p): minimum_walls(p, pressures) for p in paths} for name, paths in runs.items()}
    truth, last = walls["uniform"][uniform[-1]], f"{pressures[-1]:g}"
    summary: dict = {"reference": {"columns": uniform[-1], "least_wall": truth}}
    for name, found in walls.items():
        off = {n: {p: w[p] / truth[p] - 1 for p in w} for n, w in found.items()}
        summary[name] = {
            "least_wall": {f"{n}": w[last] for n, w in found.items()},
            "least_wall_at_psi": {f"{n}": w for n, w in found.items()},
            "largest_error": {f"{n}": max(map(abs, e.values())) for n, e in off.items()},
            "newton_iterations": {f"{columns(p)}": p.counts.iterations for p in runs[name]},
        }
        for n, w in found.items():
            say(f"{name}, {n} columns: minimum wall over h0 " + ", ".join(
                f"{v:.4f} at {p} psi ({100 * off[n][p]:+.2f} %)" for p, v in w.items()))
    save(draw(runs, walls, truth, last), args.out / "cup_adapted.png")
    summarise(args.out, {**summary, "corner_over_h0": CORNER / THICKNESS, "versions": files.versions()})


def columns(path) -> int:
    """Return the number of columns of a path's mesh."""
    return len(path.problem.scene.mesh.columns.ends) - 1


def draw(runs, walls, truth, last):
    """Draw the minimum wall over the number of columns, and the lengths of the columns."""
    figure, (left, right) = figures.figure(2, width=5.0)
    for k, (name, found) in enumerate(walls.items()):
        left.plot(list(found), [w[last] for w in found.values()], "o-", color=f"C{k}", label=name)
        ends = runs[name][-1].problem.scene.mesh.columns.ends
        right.stairs(np.diff(ends), ends, baseline=None, color=f"C{k}", label=f"{name}, {len(ends) - 1}")
    left.axhline(truth[last], color="0.5", linewidth=1)
    left.set(xlabel="columns of elements", ylabel="minimum wall / original",
             title=f"wall beside the corner, {last} psi",
             xscale="log")
    right.set(xlabel="reference radius R, cm", title="finest meshes", yscale="log",
              ylabel="reference length of a column, cm")
    plain_ticks(left.xaxis, (*UNIFORM, REFERENCE))
    plain_ticks(right.yaxis, (0.05, 0.1, 0.2, 0.5))
    for axes in (left, right):
        axes.grid(alpha=0.3)
        axes.legend(frameon=False)
    return figure


if __name__ == "__main__":
    main()
