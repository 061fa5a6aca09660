"""Press a stuck block whose side rolls onto the plates (Song 1993, section 7.3.3, figs. 7.4 to 7.10).

I1 constant 1.0 MPa, I2 constant 0.1 MPa; compression ratios H/h to 5.23, on the thesis' 64 triangles and finer grids.
"""

import numpy as np
from common import parser, save, say, summarise
from plates import HALF_HEIGHT, NEWTON, block, draw_grids, force, positions, press

import formingx as fx
from formingx import figures
from formingx.contact import resultants
from formingx.results import files

RATIOS = (1.19, 1.47, 1.87, 2.5, 3.4, 5.23)
GRIDS = ((8, 4), (16, 8), (24, 16))


def travel(ratio):
    """Return the travel of the plate (cm) at a compression ratio H/h."""
    return HALF_HEIGHT * (1 - 1 / ratio)


def plate_stress(path, state):
    """Return r and the normal stress on the plate, of both faces that touch it, sorted by r."""
    found = []
    for contact in path.problem.contacts:
        with path.problem.state_context(state):
            points, traction = resultants.traction(contact, state.x, state.control)
        moved = positions(path, state, points)
        order = np.argsort(points @ (1, -1))                 # along the top outwards, then down the side
        moved, traction, points = moved[order], traction[order, 0], points[order]
        along = np.hypot(*np.gradient(moved, axis=0).T) / np.hypot(*np.gradient(points, axis=0).T)
        hoop = np.divide(moved[:, 0], points[:, 0], out=along.copy(), where=points[:, 0] > 1e-9)
        found.append(np.column_stack([moved[:, 0], traction / (along * hoop)])[traction > 0])
    rows = np.vstack(found)
    return rows[np.argsort(rows[:, 0])].T


def compress(elements, friction="stick"):
    """Return the path, {ratio as text: state that met it}, and how the path ended."""
    scene = block(fx.MooneyRivlin(c10=1.0, c01=0.1), friction, elements, roll_over=True, nodes_per_step=1)
    path, end = press(scene, [travel(r) for r in RATIOS], max_steps=400)
    met = {f"{r:g}": path.target_state(fx.travel(travel(r))) for r in RATIOS}
    return path, {r: state for r, state in met.items() if state is not None}, end


def main():
    options = parser("compression_roll_over", __doc__)
    options.add_argument("--friction", type=str, default="stick", help="stick, none, or a coefficient of friction")
    args = options.parse_args()
    friction = args.friction if args.friction in ("stick", "none") else float(args.friction)
    grids, pictures = {}, None
    for elements in GRIDS[:1] if args.quick else GRIDS:
        path, met, end = compress(elements, friction)
        reached = HALF_HEIGHT / (HALF_HEIGHT - path.last.measures["travel"])
        found = grids[f"{elements[0]}x{elements[1]}"] = {
            "force_N_at_ratio": {r: force(s) for r, s in met.items()},
            "mid_radius_cm_at_ratio": {r: float(positions(path, s, [(1.32, 0.0)])[0, 0]) for r, s in met.items()},
            "reached_ratio": reached, "ended": end, "steps": path.counts.steps,
            "newton_iterations": path.counts.iterations, "cutbacks": path.counts.failures,
            "max_penetration_cm": path["penetration"].max(),
        }
        say(f"{elements[0]} x {elements[1]} x 2 triangles: to ratio {reached:.3f}; {path.counts.steps} states,"
            f" {path.counts.iterations} iterations, {path.counts.failures} cut back"
            + ("" if end == "done" else f"; {end[:400]}"))
        for r, state in met.items():
            say(f"  ratio {r}: {force(state):9.2f} N, radius at the middle"
                f" {found['mid_radius_cm_at_ratio'][r]:.4f} cm")
        if pictures is None or len(met) >= len(pictures[1]):
            pictures, best = (path, met, elements), found
    path, met, elements = pictures
    states = list(met.values())
    labels = ["H/h = 1", *(f"H/h = {r}" for r in met)]
    draw_grids(path, [path.states[0], *states], labels, elements, args.out / "grids.png")
    figure, (left, middle, right) = figures.figure(3, width=4.4)
    left.plot(HALF_HEIGHT / (HALF_HEIGHT - path["travel"][1:]), NEWTON * path["tool_force"][1:], ".-")
    left.set(xlabel="H / h", ylabel="force, N", title="force on one plate", yscale="log")
    Z = np.linspace(0, HALF_HEIGHT, 101)
    for k, (r, state) in enumerate(met.items()):
        middle.plot(*positions(path, state, np.column_stack([0 * Z + 1.32, Z])).T, color=f"C{k}", label=f"H/h = {r}")
        right.plot(*plate_stress(path, state), ".-", color=f"C{k}", markersize=3)
    middle.set(xlabel="r, cm", ylabel="z, cm", title="outer surface")
    middle.legend(frameon=False)
    right.set(xlabel="r, cm", ylabel="normal stress, MPa", title="pressure on the plate", yscale="log", ylim=(0.3, 300))
    save(figure, args.out / "curves.png")
    path.to_csv(args.out / "path.csv")
    summarise(args.out, {**best, "grids": grids, "versions": files.versions()})


if __name__ == "__main__":
    main()
