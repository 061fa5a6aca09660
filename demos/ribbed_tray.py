"""Form a tray with ribs, draft and a boss from an STL file, by plug and vacuum, of a sheet that relaxes.

The script itself writes the mould as a closed solid, from its height over the plane: 150 mm by 90 mm at its mouth and
35 mm deep, walls at 10 degrees to the axis, ribs and a boss (an F) on its floor. The minimum wall, in a corner, needs
small triangles there. After sheets of one size the mesh is adapted twice, so that the wall changes by at most a fifth
from one triangle to the next. The minimum wall is a mean over a circle of 8 mm: it changes by 2.8 % from the first
adapted mesh to the second. The thinnest single triangle is given, too; it does not converge. At the sharp end of a rib
it becomes thinner on triangles that are much smaller than the thickness, which a membrane does not resolve. Lengths in
mm, stresses in MPa, times in s.
"""

import numpy as np
from common import COMM, parser, say, summarise
from scipy.spatial import cKDTree

import formingx as fx
from formingx.io.stl import write_stl
from formingx.results import files

HALF, CORNER, DEPTH, DRAFT = np.array([75.0, 45.0]), 20.0, 35.0, np.radians(10.0)
SHEET, THICKNESS, DENSITY = (170.0, 110.0), 1.5, 1.05
MATERIAL = fx.Viscoelastic(fx.NeoHookean(c10=0.03), [(0.15, 0.5)])
BARS = [((-50, 0), (2.0, 26.0), 5.0), ((-30, 0), (2.0, 26.0), 5.0),                 # ribs: middle, half widths, height
        ((20, 0), (3.0, 14.0), 3.0), ((30, 11), (12.0, 3.0), 3.0), ((27, -1), (9.0, 3.0), 3.0)]    # an F
UNITS = fx.Units(length="mm", stress="MPa", time="s")
PLUG_TRAVEL, SEAL, VACUUM, CHANGE = 24.0, 0.02, 0.08, 0.2
AROUND = 8.0                                                          # radius of the mean for the minimum wall


def rounded(a, b, radius):
    """Return the smaller of two heights, with a fillet between them."""
    h = np.clip(0.5 + 0.5 * (b - a) / radius, 0, 1)
    return b + (a - b) * h - radius * h * (1 - h)


def away(x, y, middle, half, corner):
    """Return the distance to a rounded rectangle in the plane, negative inside."""
    u, v = np.abs(x - middle[0]) - half[0] + corner, np.abs(y - middle[1]) - half[1] + corner
    return np.hypot(np.maximum(u, 0), np.maximum(v, 0)) + np.minimum(np.maximum(u, v), 0) - corner


def height(x, y):
    """Return z of the surface of the mould."""
    wall = -away(x, y, (0, 0), HALF, CORNER) / np.tan(DRAFT)
    deep = rounded(wall, np.full_like(x, DEPTH), 9.0)
    for middle, half, high in BARS:                                   # their flanks have a draft of 20 degrees
        bar = np.clip(-away(x, y, middle, half, 1.0) / np.tan(np.radians(20.0)), -30.0, high)
        deep = rounded(deep, DEPTH - bar, 2.5)
    return -np.maximum(rounded(deep, np.full_like(x, 1e3), 1.0), 0.0)


def write_mould(file, step):
    """Write the surface of the mould on a grid, closed by sides and a bottom."""
    x, y = (np.linspace(-w / 2 - 10, w / 2 + 10, int(w / step) + 2) for w in SHEET)
    X, Y = np.meshgrid(x, y, indexing="ij")
    n, m = X.shape
    top = np.stack([X, Y, height(X, Y)], -1).reshape(-1, 3)
    low = top * (1, 1, 0) - (0, 0, DEPTH + 15)
    row = np.arange(n * m).reshape(n, m)
    a, b, c, d = row[:-1, :-1], row[1:, :-1], row[1:, 1:], row[:-1, 1:]
    up = np.concatenate([np.stack(t, -1).reshape(-1, 3) for t in ((a, b, c), (a, c, d))])
    rim = np.concatenate([row[:-1, 0], row[-1, :-1], row[:0:-1, -1], row[0, :0:-1]])
    i, j, k = rim, np.roll(rim, -1), n * m
    sides = np.concatenate([np.column_stack([j, i, i + k]), np.column_stack([j, i + k, j + k])])
    triangles = np.concatenate([up, up[:, ::-1] + k, sides])
    write_stl(np.vstack([top, low]), triangles, file)


def flat(size):
    """Return the sheet, in triangles of one size."""
    return fx.mesh.sheet(fx.mesh.rectangle(*SHEET, corner=25), size=size)


def form(sheet, mould):
    """Return the path of plug and vacuum."""
    plug = fx.tools.box(half=(52, 27), depth=30, corner=15, fillet=8, draft=5, mouth=30.5, plug=True)
    contacts = [fx.Contact("bottom", mould, "stick", name="mould", nodes_per_step=0.02),
                fx.Contact("top", plug, "stick", direction=(0, 0, -1), name="plug", nodes_per_step=0.02)]
    scene = fx.Scene(mesh=sheet, thickness=THICKNESS, materials=MATERIAL, supports=[fx.SimplySupported("rim")],
                     loads=[fx.Pressure("top", name="vacuum")], contacts=contacts, model=fx.Membrane(wrinkles=0.01))
    stages = [fx.Stage("plug", control="plug", until=fx.travel(PLUG_TRAVEL), speed=60.0),
              fx.Stage("hold", duration=0.3),
              fx.Stage("seal", control="vacuum", until=fx.pressure(SEAL)), fx.Stage("plug off", inactive=["plug"]),
              fx.Stage("vacuum", control="vacuum", until=fx.pressure(VACUUM), inactive=["plug"])]
    return fx.Process(scene).run(stages)


def minimum(wall):
    """Return the minimum over the part of the mean wall within a radius, and where."""
    near = cKDTree(wall.middle).query_ball_point(wall.middle, AROUND)
    means = [np.average(wall.wall[rows], weights=wall.reference_area[rows]) for rows in near]
    k = int(np.argmin(means))
    return {"least_wall_around_mm": means[k], "least_around_at_mm": wall.middle[k].tolist()}


def numbers(path):
    """Return the numbers of the summary of one path."""
    part, wall = path.part(density=DENSITY, trim=-0.5, units=UNITS), path.wall()
    return {"least_wall_mm": part.min_wall, "least_at_mm": list(part.min_wall_at), **minimum(wall),
            "weight_g": part.weight, "draw_ratio": part.draw_ratio, "touching": path.filling("mould").touching[-1],
            "plug_force_N": float(np.abs(path["plug_force"]).max()), "states": len(path),
            "iterations": path.counts.iterations, "failures": path.counts.failures, "triangles": len(wall.wall),
            "smallest_triangle_mm2": float(wall.reference_area.min()), "unknowns": path.problem.n_unknowns,
            "seconds": path.counts.seconds}


def main():
    options = parser("ribbed_tray", __doc__)
    options.add_argument("--sizes", type=float, nargs="+", default=[8.0, 5.0, 3.0], help="sizes of the triangles, mm")
    options.add_argument("--adapted", type=int, default=2,
                         help="number of meshes that are then adapted to the run before")
    args = options.parse_args()
    sizes, more, step = ([16.0], 0, 3.0) if args.quick else (args.sizes, args.adapted, 1.25)
    if COMM.rank == 0:
        args.out.mkdir(parents=True, exist_ok=True)
        write_mould(args.out / "mould.stl", step)
    COMM.Barrier()
    mould = fx.tools.solid(args.out / "mould.stl", crease=0)     # its grid of heights does not follow its edges
    undercuts = mould.undercuts()
    summary = {"mould": {"triangles": mould.triangles, "undercut_area": undercuts["undercut_area"],
                         "least_draft": undercuts["min_draft"]}, "around_radius_mm": AROUND,
               "adapted_wall_change": CHANGE}
    path, names = None, [*(f"size_{size:g}" for size in sizes), *(f"adapted_{k + 1}" for k in range(more))]
    for name in names:
        size = name.removeprefix("size_")
        sheet = fx.mesh.adapted(path, max_rotation=None, error=CHANGE) if size == name else flat(float(size))
        path = form(sheet, mould)
        summary[name], part = numbers(path), path.part(density=DENSITY, trim=-0.5, units=UNITS)
        say(f"{name}: {summary[name]['triangles']} triangles, {path.counts.iterations} iterations,"
            f" {path.counts.failures} failures, {path.counts.seconds:.0f} s", str(part), "")
    if len(names) > 1:
        before, last = (summary[name] for name in names[-2:])
        summary["last_over_mesh_before"] = {name: last[name] / before[name] for name in (
            "least_wall_around_mm", "least_wall_mm", "weight_g", "triangles")}
    path.wall().to_csv(args.out / "wall.csv", UNITS)
    path.to_csv(args.out / "ribbed_tray.csv")
    path.to_stl(args.out / "part.stl")
    if not args.quick:
        path.view3d(args.out / "ribbed_tray.png")
        path.view3d(args.out / "printed_grid.png", grid=10.0)
        path.report(args.out / "report.html", "Ribbed tray", units=UNITS, density=DENSITY, trim=-0.5)
    summarise(args.out, {**summary, "versions": files.versions()})


if __name__ == "__main__":
    main()
