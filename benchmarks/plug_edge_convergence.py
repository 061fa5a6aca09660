"""Refine the mesh at the edge of a plug: the stress peak converges with a fillet, not at a sharp edge.

Sheet and plug of Williams' experiments (Song 1993, section 6.2): r0 = 8.89 cm, h0 = 0.6985 cm, neo-Hookean, c10 = 0.448
MPa, plug radius 1.905 cm; it travels 2 cm at most. Elements are small around the edge, in R and towards the face that
the plug touches; they are halved again and again. For every mesh: the largest sigma_1 within two plug radii, the
estimated error of the stress there, and the place at which a larger one is possible by the estimate
(`StressField.peak`). A peak has converged if no larger one is possible within 5 % of it. Contact acts at nodes, so a
sharp edge acts like a fillet of an element's size: its peak grows with every refinement.
"""

import argparse
import logging
import time
from pathlib import Path

from mpi4py import MPI

import formingx as fx
from formingx import figures
from formingx.results import files
from formingx.results.files.fields import Fields

RADIUS, THICKNESS, C10, PLUG = 8.89, 0.6985, 0.448, 1.905            # cm, cm, MPa, cm
CASES = {"fillet": (THICKNESS / 2, 0.3), "sharp": (0.0, 0.3), "fillet, stick": (THICKNESS / 2, "stick"),
         "sharp, stick": (0.0, "stick")}
TRAVELS = (1.0, 2.0)
KEYS = ("sigma_1_MPa", "R_cm", "Z_cm", "error_MPa", "doubtful_MPa", "doubtful_R_cm", "doubtful_Z_cm",
        "doubtful_error_MPa", "converged")


def press(fillet, friction, refinement, travels=TRAVELS):
    """Return the path as far as it came, and how it ended; the smallest elements are 0.07 cm / refinement."""
    edge = PLUG - 0.7 * fillet                                         # where it touches
    layers = {"lower": THICKNESS / 2, "middle": THICKNESS / 3, "upper": THICKNESS / 6}
    mesh = fx.mesh.disc(radius=RADIUS, thickness=layers, elements=(28 * refinement, refinement),
                        concentrate={edge: 0.08, RADIUS: 0.3})
    plug = fx.tools.male(radius=PLUG, height=4.0, base=-4.0, fillet=fillet).mirrored().moved(z=THICKNESS)
    scene = fx.Scene(mesh=mesh, materials=fx.NeoHookean(c10=C10), supports=[fx.Symmetry("axis"), fx.Clamped("rim")],
                     contacts=[fx.Contact("top", plug, friction, direction=(0, -1), penalty=2e4, ramp=1e-5)])
    targets = [fx.travel(t) for t in travels]
    try:
        return fx.trace(scene, until=targets[-1], intermediate=targets[:-1], step=fx.StepControl(target=8),
                        max_steps=300,
                        progress=False), "done"
    except fx.ConvergenceError as error:
        return error.path, str(error).split(". The last")[0]


def peak(path, travel):
    """Return the peak at a travel, or None if it was not reached."""
    state = path.target_state(fx.travel(travel))
    return None if state is None else path.stress(state).peak(radii=(0.0, 2 * PLUG))


def draw(rows, last, out):
    """Draw peaks against element size, and the estimated error around the edge on the finest meshes."""
    figure, axes = figures.figure(1 + len(last), width=4.6, height=4.0)
    for k, case in enumerate(dict.fromkeys(row["case"] for row in rows)):
        mine = [row for row in rows if row["case"] == case and row["travel_cm"] == TRAVELS[-1] and row["sigma_1_MPa"]]
        axes[0].plot([r["refinement"] for r in mine], [r["sigma_1_MPa"] for r in mine], f"C{k}.-", label=case)
        mine = [row for row in mine if not row["converged"]]
        axes[0].plot([r["refinement"] for r in mine], [r["sigma_1_MPa"] for r in mine], f"C{k}o", fillstyle="none",
                     markersize=10)
    axes[0].set(xlabel="n, elements of 0.07 cm / n at the edge", ylabel="largest $\\sigma_1$, MPa", ylim=(0, None),
                title=f"{TRAVELS[-1]:g} cm travel (ringed: not converged)")
    axes[0].xaxis.get_major_locator().set_params(integer=True)
    axes[0].legend(frameon=False, loc="lower left")
    for a, (case, path) in zip(axes[1:], last.items()):
        shades = _error_map(a, path)
        a.set(title=f"estimated error of stress, {case}")
    figure.colorbar(shades, ax=axes[1:].tolist(), label="$|\\sigma^* - \\sigma_h|$, MPa", shrink=0.8)
    out.mkdir(parents=True, exist_ok=True)
    figure.savefig(out / "peaks.png", dpi=150)


def _error_map(axes, path):
    """Draw the deformed elements around the edge; return their colours by the estimated errors."""
    from matplotlib.collections import PolyCollection
    from matplotlib.colors import LogNorm
    fields = Fields(path)
    found = fields.evaluate(path.last)
    corners = (fields.points + found["displacement"])[:, :3]
    shades = PolyCollection(corners, array=found["stress_error"][:, 0, 0], norm=LogNorm(1e-3, 1.0), cmap="viridis",
                            edgecolors="face", linewidths=0.5)
    axes.add_collection(shades)
    tool = path.problem.scene.contacts[0].tool.moved(z=-path.last.measures["travel"]).outline()
    axes.plot(*tool.T, "k", linewidth=1.2)
    low = corners[..., 1][corners[..., 0] < PLUG].min()
    axes.set(xlim=(1.0, 2.8), ylim=(low - 0.05, low + 1.15), xlabel="r, cm", ylabel="z, cm", aspect="equal")
    axes.grid(False)
    return shades


def main():
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--refinements", nargs="+", type=int, default=[1, 2, 3, 4], help="elements per layer")
    options.add_argument("--cases", nargs="+", choices=CASES, default=list(CASES), help="edges and friction")
    options.add_argument("--out", type=Path, default=Path("results/plug_edge_convergence"), help="folder for results")
    args = options.parse_args()
    logging.getLogger("formingx").setLevel(logging.ERROR)              # the table says it
    rows, last = [], {}
    for case in args.cases:
        print(f"\n{case}\n{'n':>3}{'travel':>8}{'sigma_1':>10}{'at (R, Z)':>18}{'error':>9}{'doubtful':>11}{'+-':>9}"
              f"{'at (R, Z)':>18}  converged", flush=True)
        for n in args.refinements:
            began = time.perf_counter()
            path, end = press(*CASES[case], n)
            last[case] = path
            for travel in TRAVELS:
                p = peak(path, travel)
                row: dict = {"case": case, "refinement": n, "travel_cm": travel}
                row |= dict.fromkeys(KEYS, "") if p is None else dict(zip(KEYS, (
                    p.value, *p.point, p.error, p.doubtful, *p.doubtful_point, p.doubtful_error, p.converged)))
                rows.append(row)
                if p is not None:
                    here, there = ("({:.3f}, {:.3f})".format(*point) for point in (p.point, p.doubtful_point))
                    print(f"{n:3d}{travel:8g}{p.value:10.4f}{here:>18}{p.error:9.4f}{p.doubtful:11.4f}"
                          f"{p.doubtful_error:9.4f}{there:>18}  {'yes' if p.converged else 'no'}", flush=True)
            print(f"   {path.counts.steps} states, {path.counts.iterations} Newton iterations,"
                  f" {time.perf_counter() - began:.0f} s, {end}", flush=True)
    files.write_rows(args.out / "table.csv", list(rows[0]), [list(row.values()) for row in rows], MPI.COMM_WORLD)
    draw(rows, {case: last[case] for case in list(last)[:2]}, args.out)


if __name__ == "__main__":
    main()
