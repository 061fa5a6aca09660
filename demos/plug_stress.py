"""Find where a sheet under a plug has its largest stress and strain, with and without slip (Song 1993, section 6.4).

Sheet and plug as in demos/williams_plug.py, at two travels. The thesis prints none; with slip, the stretch at the pole
is its 1.25 near 4.8 cm. Principal values as in the thesis (figs. 6.11 to 6.15): 1 is the larger and 2 the smaller one
in the (r, z) plane, 3 the one around the axis. Euler strain eps = (1 - 1/l^2) / 2. Each mesh is refined once, to see
which values have converged. Lengths in cm, stresses in MPa.
"""

import numpy as np
import plugs
from common import COMM, parser, save, say, summarise
from williams_plug import C10, PLUG, RADIUS, THICKNESS

import formingx as fx
from formingx import figures
from formingx.results import files
from formingx.results.files.fields import Fields

LAWS = {"held": (60, 3), "frictionless": (80, 3)}            # elements
NEAR = 2 * PLUG                                              # a clamped rim has a peak of its own
CORNERS = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
THESIS = {"held": "largest sigma_1, sigma_2, sigma_3 on top at R = 1.905 cm; largest eps_1 on top near R = 2.1 cm;"
                  " the two less than 10 % of rp apart",
          "frictionless": "largest stresses at R = 1.905 cm; largest eps_1 in the middle of the sheet"}
LABELS = {"sigma_1": r"$\sigma_1$, MPa", "sigma_3": r"$\sigma_3$, MPa", "eps_1": r"$\epsilon_1$",
          "eps_2": r"$\epsilon_2$", "eps_3": r"$\epsilon_3$"}


class Corners:
    """Values at the corners of all cells near the plug, shape (cells, 3)."""

    def __init__(self, path, state):
        fields, stress = Fields(path), path.stress(state).in_cells(CORNERS)
        u = fields.evaluate(state)["displacement"]
        sigma, F = stress.cauchy, stress.deformation_gradient
        plane = np.linalg.eigvalsh(sigma[:, :2, :2])
        value, vector = np.linalg.eigh((F @ F.transpose(0, 2, 1))[:, :2, :2])
        strain = (1 - 1 / np.column_stack([value[:, ::-1], F[:, 2, 2] ** 2])) / 2
        columns = np.column_stack([plane[:, ::-1], sigma[:, 2, 2], strain, vector[:, :, 1]]).reshape(len(u), 3, -1)
        rows = np.concatenate([fields.points[:, :3], (fields.points + u)[:, :3], columns], axis=2)
        rows = np.concatenate(COMM.allgather(rows))
        rows = rows[rows[:, :, 0].mean(1) < NEAR]
        self.rest, self.now, self.direction = rows[..., :2], rows[..., 2:4], rows[..., 10:]
        names = ("sigma_1", "sigma_2", "sigma_3", "eps_1", "eps_2", "eps_3")
        self.values = {name: rows[..., 4 + k] for k, name in enumerate(names)}

    def largest(self, name) -> dict:
        """Return the largest value and its place: R, height in the reference sheet, side."""
        k = np.unravel_index(self.values[name].argmax(), self.values[name].shape)
        R, Z = self.rest[k]
        side = "top" if Z > 0.95 * THICKNESS else "bottom" if Z < 0.05 * THICKNESS else "inside"
        return {"value": float(self.values[name][k]), "R_cm": float(R), "Z_over_h0": float(Z / THICKNESS), "side": side,
                "r_cm": float(self.now[k][0]), "z_cm": float(self.now[k][1])}


def press(law, elements, fillet, travels):
    """Return the path through the travels."""
    made = plugs.scene(RADIUS, THICKNESS, PLUG, fillet, fx.NeoHookean(c10=C10), law, elements)
    *through, until = [fx.travel(t) for t in sorted(travels)]
    return fx.trace(made, until=until, intermediate=through, step=fx.StepControl(target=6), max_steps=400)


def key_numbers(path, state, corners) -> dict:
    """Return the numbers of the summary of one state."""
    found = {f"largest_{name}": corners.largest(name) for name in corners.values}
    sigma, eps = found["largest_sigma_1"], found["largest_eps_1"]
    apart = np.hypot(sigma["r_cm"] - eps["r_cm"], sigma["z_cm"] - eps["z_cm"])
    peak = path.stress(state).peak(radii=(0.0, NEAR))
    return {**found, "distance_of_largest_sigma_1_and_eps_1_over_rp": float(apart / PLUG),
            "peak_of_sigma_1": {"value": peak.value, "error": peak.error, "converged": bool(peak.converged),
                                "in_words": str(peak)}}


def main():
    options = parser("plug_stress", __doc__)
    options.add_argument("--fillet", type=float, default=0.35, help="radius of the plug's edge, cm")
    options.add_argument("--travels", type=float, nargs="+", default=[4.8, 6.0], help="of the plug, cm; pictures of"
                         " the last")
    args = options.parse_args()
    summary: dict = {"thesis": THESIS}
    paths, corners = {}, {}
    for law, elements in LAWS.items():
        meshes = {"coarse": (40, 2)} if args.quick else {"standard": elements, "refined": (elements[0] * 3 // 2, 4)}
        summary[law] = {}
        for mesh, elements in meshes.items():
            paths[law] = path = press(law, elements, args.fillet, args.travels)
            summary[law][mesh] = {"elements": list(elements)}
            for travel in sorted(args.travels):
                state = path.target_state(fx.travel(travel))
                corners[law] = Corners(path, state)
                summary[law][mesh][f"{travel:g}"] = n = key_numbers(path, state, corners[law])
                print_numbers(f"{law}, {elements[0]} x {elements[1]} elements, {travel:g} cm", n)
    tool, travel = plugs.plug(PLUG, THICKNESS, args.fillet), max(args.travels)
    for law, found in corners.items():
        save(draw(found, tool, travel, law), args.out / f"contours_{law}.png")
    save(draw_faces(paths), args.out / "faces.png")
    summarise(args.out, {**summary, "fillet_cm": args.fillet, "versions": files.versions()})


def print_numbers(name, n) -> None:
    """Print the numbers of one state."""
    say(f"{name}:", *(f"  largest {key[8:]:8} {m['value']:8.4f} at R = {m['R_cm']:.3f} cm, Z = {m['Z_over_h0']:.2f} h0,"
                      f" {m['side']}" for key, m in n.items() if key.startswith("largest")),
        f"  largest sigma_1 and eps_1 are {n['distance_of_largest_sigma_1_and_eps_1_over_rp']:.3f} rp apart",
        f"  {n['peak_of_sigma_1']['in_words']}")


def draw(found, tool, travel, law):
    """Return a figure of contours near the plug and of the first direction of strain: figs. 6.11 to 6.15.

    The scales show units to the right and, as in the thesis, values from 0 to 1 to the left. A ring marks the
    largest value.
    """
    figure, axes = figures.figure(3, width=4.6, height=3.5, rows=2)
    x, triangles = found.now.reshape(-1, 2), np.arange(found.now[..., 0].size).reshape(-1, 3)
    near = x[:, 0] < 1.6 * PLUG
    low = x[near, 1].min()
    for ax, name in zip(axes, ("sigma_1", "sigma_3", None, "eps_1", "eps_2", "eps_3")):
        if name is None:
            rest, middle, way = found.rest.mean(1), found.now.mean(1), found.direction.mean(1)
            fewer = np.unique((rest // [0.14, 0.14]).astype(int), axis=0, return_index=True)[1]
            ends = np.stack([middle - 0.07 * way, middle + 0.07 * way], 1)[fewer]
            ax.tripcolor(*x.T, triangles, np.full(len(x), 0.12), cmap="Greys", vmin=0, vmax=1)
            ax.plot(*ends.transpose(2, 1, 0), color="C0", linewidth=1.2)
            ax.set(title=r"direction of $\epsilon_1$")
        else:
            v = found.values[name].ravel()
            levels = np.linspace(v[near].min(), v[near].max(), 11)
            shades = ax.tricontourf(*x.T, triangles, v, levels=levels, cmap="viridis", extend="both")
            bar = figure.colorbar(shades, ax=ax, shrink=0.8, ticks=levels[::2], format="%.3g",
                                  extendrect=True, extendfrac=0)
            ends = levels[[0, -1]]
            left = bar.ax.secondary_yaxis("left", functions=(lambda y, a=ends: (y - a[0]) / (a[1] - a[0]),
                                                             lambda y, a=ends: a[0] + y * (a[1] - a[0])))
            left.tick_params(labelsize="x-small")
            most = found.largest(name)
            ax.plot(most["r_cm"], most["z_cm"], "o", color="red", fillstyle="none", markersize=9)
            ax.set(title=LABELS[name])
        ax.plot(*(tool.outline() - [0, travel]).T, "k", linewidth=1.2)
        ax.set(xlim=(0, 1.6 * PLUG), ylim=(low - 0.1, low + 2.2))
        ax.set_aspect("equal")
        ax.grid(False)
    axes[0].set(ylabel="z, cm")
    axes[3].set(ylabel="z, cm")
    for ax in axes[3:]:
        ax.set(xlabel="r, cm")
    figure.suptitle(f"{law}, travel {travel:g} cm (ring: largest value; left scales: 0 to 1, as in the thesis)")
    return figure


def draw_faces(paths):
    """Return a figure of the first principal stress along both faces: fig. 6.14."""
    figure, axes = figures.figure(len(paths), width=4.8)
    R = np.linspace(0, 0.97 * RADIUS, 400)
    for ax, (law, path) in zip(axes, paths.items()):
        field = path.stress()
        for face, Z in (("top", THICKNESS), ("bottom", 0.0)):
            sigma = field.at_points(np.column_stack([R, np.full_like(R, Z)])).cauchy
            ax.plot(R, np.linalg.eigvalsh(sigma[:, :2, :2])[:, 1], label=face)
        ax.axvline(PLUG, color="0.7", linewidth=1)
        ax.set(xlabel="reference radius R, cm", ylabel=r"$\sigma_1$, MPa", title=law)
        ax.legend(frameon=False)
    return figure


if __name__ == "__main__":
    main()
