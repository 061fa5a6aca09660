"""Predict shape and strains of a film blown over an elliptical hole, from the rise of its middle.

The experiment is that of F. Bosi's repository StressesEllipticBulging (GitHub, fbosi): a film 0.1 mm thick over an
elliptical hole with the semi-axes 30 mm (x) and 60 mm (y), blown by 0.9175 psi, measured by image correlation. The
source takes the film as incompressible and states no elastic constants. The rise of the middle, 11.231 mm, is given;
all else is a prediction. The measured values at the ten points are no part of this script.

A given rise prescribes the deformation, so the modulus cancels: only the form of the law matters. The law here is
neo-Hookean, the limit of every isotropic incompressible elastic law at small strains. Four other laws show the
sensitivity. The pressure gives the modulus that the film would have.
"""

import numpy as np
from common import parser, save, say, summarise

import formingx as fx
from formingx import figures
from formingx.results import files

HALF_WIDTH, HALF_LENGTH, THICKNESS = 30.0, 60.0, 0.1           # along x and y; mm
RISE, PRESSURE = 11.231, 0.9175 * 6.894757e-3                  # of the middle, mm; MPa
PLACES = [(10, 0), (20, 0), (25, 0), (0, 20), (0, 40), (0, 50), (15, 20), (15, 30), (10, 45), (20, 20)]    # now, mm


def softening(n):
    """Return a law whose stress grows as strain^n, linear below an equivalent strain of about 0.1 %."""
    return fx.Hyperelastic(lambda I1, I2, c, n: c * ((I1 - 3 + 1e-6) / 1e-2) ** ((n + 1) / 2), c=1e-2, n=n)


LAWS = {"neo_hookean": fx.NeoHookean(c10=1.0), "mooney_0.3": fx.MooneyRivlin(c10=0.7, c01=0.3),
        "hencky": fx.Ogden(mu=[40.0], alpha=[0.05]), "power_0.8": softening(0.8), "power_0.6": softening(0.6)}
TITLES = {"neo_hookean": "neo-Hookean", "mooney_0.3": "Mooney-Rivlin, 0.3", "hencky": "Hencky",
          "power_0.8": "power 0.8", "power_0.6": "power 0.6"}


def film(size):
    """Return a quarter of the film, in triangles of a size (mm)."""
    n = int(np.ceil(75 / size))                                # chords of the rim, a quarter of which is 72.7 mm long
    angle = np.linspace(0, np.pi / 2, n + 1)
    rim = np.column_stack([HALF_WIDTH * np.cos(angle), HALF_LENGTH * np.sin(angle)])
    rim[0, 1] = rim[-1, 0] = 0.0
    return fx.mesh.sheet([(0.0, 0.0), *map(tuple, rim)], size, names=["y0", *["rim"] * n, "x0"])


def blow(law, size):
    """Return the path to the given rise of the middle."""
    scene = fx.Scene(mesh=film(size), thickness=THICKNESS, materials=law, loads=[fx.Pressure("bottom")],
                     supports=[fx.SimplySupported("rim"), fx.Symmetry("x0", "x"), fx.Symmetry("y0", "y")])
    return fx.trace(scene, until=fx.displacement(RISE, at=(0, 0)), progress=False)


def at(place, points, values, signs, count):
    """Return values at a place (x, y), shape (k,), of quadratic polynomials fitted to the nearest points.

    The points, shape (n, 2), and values, shape (n, k), are those of the quarter; signs, shape (k,): -1 where a value
    changes its sign across a line of symmetry.
    """
    every = np.concatenate([points * mirror for mirror in ((1, 1), (-1, 1), (1, -1), (-1, -1))])
    found = np.concatenate([values, values * signs, values * signs, values])
    nearest = np.argsort(np.hypot(*(every - place).T))[:count]
    x, y = (every[nearest] - place).T
    terms = np.column_stack([np.ones(count), x, y, x * x, x * y, y * y])
    return np.linalg.lstsq(terms, found[nearest], rcond=None)[0][0]


def predicted(path):
    """Return {"x_y": {W_mm, e1, e2, wall_ratio}} at the places; e1: the principal Hencky strain nearest x.

    The directions are those of the right stretch tensor; nowhere are the two strains alike.
    """
    wall = path.wall()
    rest, now = (x[wall.triangles[:, 1:]] - x[wall.triangles[:, :1]]
                 for x in (wall.reference_points, wall.deformed_points))
    F = np.einsum("mij,mjk->mki", np.linalg.inv(rest[..., :2]), now)
    C = np.einsum("mki,mkj->mij", F, F)
    found = {}
    for place in PLACES:
        W = at(place, wall.deformed_points[:, :2], wall.deformed_points[:, 2:], np.ones(1), 12)[0]
        xx, yy, xy = at(place, wall.middle[:, :2], C[:, [0, 1, 0], [0, 1, 1]], np.array([1, 1, -1]), 24)
        squares, axes = np.linalg.eigh([[xx, xy], [xy, yy]])
        across = int(np.argmax(np.abs(axes[0])))               # the principal direction nearest x
        e1, e2 = np.log(squares[[across, 1 - across]]) / 2
        found["_".join(map(str, place))] = {"W_mm": float(W), "e1": e1, "e2": e2, "wall_ratio": np.exp(-e1 - e2)}
    return found


def largest_change(one, other):
    """Return {quantity: its largest difference over all places}."""
    return {name: max(abs(one[place][name] - other[place][name]) for place in one) for name in ("W_mm", "e1", "e2")}


def draw(path, rows, file):
    """Draw the film's rise as lines of equal height, and the strains at the places under every law."""
    figure, axes = figures.figure(2, width=5)
    axes[0].get_gridspec().set_width_ratios([1, 2])         # the film is twice as long as wide
    wall = path.wall()
    x, y, z = wall.deformed_points.T
    lines = axes[0].tricontourf(x, y, wall.triangles, z, levels=np.arange(0, 13))
    axes[0].plot(*np.array(PLACES).T, "ko", markerfacecolor="w", markersize=5, clip_on=False)
    axes[0].set(xlabel="x, mm", ylabel="y, mm", aspect="equal", title="rise, mm")
    figure.colorbar(lines, ax=axes[0])
    for k, (law, places) in enumerate(rows.items()):
        for name, mark in (("e1", "o"), ("e2", "^")):
            axes[1].plot([place.replace("_", ", ") for place in places], [p[name] for p in places.values()], mark,
                         color=f"C{k}", fillstyle="none",
                         label=TITLES[law] if name == "e1" else None)
    axes[1].tick_params(axis="x", rotation=60)
    axes[1].set(xlabel="point x, y, mm", ylabel="Hencky strain across (circles), along (triangles)", ylim=(0, None))
    axes[1].legend(frameon=False, loc="center left")
    save(figure, file)


def main():
    options = parser("measured_ellipse", __doc__)
    options.add_argument("--sizes", type=float, nargs="+", default=[2.0, 1.0, 0.5], help="sizes of the triangles, mm")
    args = options.parse_args()
    sizes = [4.0, 2.0] if args.quick else args.sizes
    meshes, summary = {}, {}
    for size in sizes:
        path = blow(LAWS["neo_hookean"], size)
        meshes[f"size_{size:g}"] = predicted(path)
        c10 = PRESSURE / path.last.measures["pressure"]        # the pressure is proportional to it
        summary[f"size_{size:g}"] = {"unknowns": path.problem.n_unknowns, "iterations": path.counts.iterations,
                                     "c10_MPa": c10, "seconds": path.counts.seconds}
        say(f"triangles of {size:g} mm: {path.problem.n_unknowns} unknowns; c10 = {c10:.5g} MPa, E = {6 * c10:.4g} MPa")
    *_, coarse, fine = meshes.values()
    summary["change_by_last_refinement"] = largest_change(fine, coarse)
    rows = {name: fine if name == "neo_hookean" else predicted(blow(law, sizes[-2])) for name, law in LAWS.items()}
    summary["change_by_law"] = {name: largest_change(places, coarse) for name, places in rows.items()
                                if name != "neo_hookean"}
    for name, changes in {"last refinement": summary["change_by_last_refinement"], **summary["change_by_law"]}.items():
        say(f"{name}: changes W by at most {changes['W_mm']:.3f} mm, e1 by {changes['e1']:.5f},"
            f" e2 by {changes['e2']:.5f}")
    for place, values in fine.items():
        say(f"{place}: " + ", ".join(f"{name} {value:.5g}" for name, value in values.items()))
    draw(path, rows, args.out / "measured_ellipse.png")
    path.wall().to_csv(args.out / "wall.csv")
    summarise(args.out, {**fine, "law": "neo_hookean", "rise_mm": RISE, "pressure_MPa": PRESSURE, **summary,
                         "laws": {name: places for name, places in rows.items() if name != "neo_hookean"},
                         "versions": files.versions()})


if __name__ == "__main__":
    main()
