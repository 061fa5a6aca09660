"""Fill a rounded tray with a sheet that sticks, from an exact tool and from an STL file; beside it a trough.

A quarter of the tray is solved: half widths 1 and 1.5, depth 1, corners 0.3 in plan, fillet 0.2 at the floor. The sheet
is neo-Hookean, of the same outline and of thickness 0.02, fixed at its rim, to p a/(c10 h) = 60. The trough is a strip
of a long one, as deep as its half width. Its law is h/h0 = (2/pi) r^(4/pi - 1), r from the sharp corner along floor or
wall (`rectangular_part` solves it as a solid). Last, the same tray without friction.
"""

import numpy as np
from common import COMM, parser, say, summarise

import formingx as fx
from formingx.results import files

THICKNESS, C10, PRESSURE = 0.02, 1.0, 60.0
BOX = {"half": (1.0, 1.5), "depth": 1.0, "corner": 0.3, "fillet": 0.2}
PLACES = {"floor": (0, 0, -1), "long_wall": (1, 0, -0.5), "bottom_edge": (0.9414, 0, -0.9414),
          "corner": (0.8862, 1.3862, -0.9155)}


def fill(sheet, tool, supports, **contact):
    """Return the path to the last pressure; `contact` are further arguments of the contact."""
    contact = {"friction": "stick", "separates": False} | contact
    scene = fx.Scene(mesh=sheet, thickness=THICKNESS, materials=fx.NeoHookean(c10=C10), loads=[fx.Pressure("top")],
                     supports=[fx.SimplySupported("rim"), fx.Symmetry("x0", "x"), *supports],
                     contacts=[fx.Contact("bottom", tool, name="mould", **contact)])
    return fx.trace(scene, until=fx.pressure(PRESSURE * C10 * THICKNESS))


def tray(size, tool, **contact):
    """Return the path of a quarter of the tray."""
    sheet = fx.mesh.sheet(fx.mesh.rectangle(2.0, 3.0, corner=0.3, part="quarter"), size=size)
    return fill(sheet, tool, [fx.Symmetry("y0", "y")], **contact)


def key_numbers(path):
    """Return the numbers of the summary of a tray."""
    wall = path.wall()
    return {**{name: wall.mean_ratio(place, 0.06) for name, place in PLACES.items()}, "least": wall.ratio.min(),
            "iterations": path.counts.iterations, "failures": path.counts.failures, "states": len(path),
            "unknowns": path.problem.n_unknowns, "seconds": path.counts.seconds}


def trough(size):
    """Return the errors of wall and fillet of a trough against its law."""
    sheet = fx.mesh.sheet([(0, 0), (1, 0), (1, 0.3), (0, 0.3)], size, names=["y0", "rim", "y1", "x0"])
    profile = fx.Tool([(3.0, 0.0), (1.0, 0.0), (1.0, -1.0), (0.0, -1.0)], [0.0, 0.0, 0.2, 0.0])
    path = fill(sheet, fx.tools.extruded(profile), [fx.Symmetry("y0", "y"), fx.Symmetry("y1", "y")])
    wall = path.wall()
    x, _, z = wall.middle.T

    def law(r):
        return 2 / np.pi * r ** (4 / np.pi - 1)
    found = {}
    for name, there, r in (("wall_error", (np.abs(z + 0.5) < 0.05) & (x > 0.9), 1 + z),
                           ("fillet_error", (x > 0.8) & (z < -0.8), np.full(len(x), 0.2))):
        if there.any():
            mean, exact = (np.average(v[there], weights=wall.area[there]) for v in (wall.ratio, law(np.abs(r))))
            found[name] = mean / exact - 1
    return found | {"iterations": path.counts.iterations, "failures": path.counts.failures}


def main():
    options = parser("tray", __doc__)
    options.add_argument("--sizes", type=float, nargs="+", default=[0.1, 0.05, 0.025], help="sizes of the triangles")
    args = options.parse_args()
    sizes = [0.1] if args.quick else args.sizes
    mould = fx.tools.box(**BOX)
    if COMM.rank == 0:
        args.out.mkdir(parents=True, exist_ok=True)
        mould.to_stl(args.out / "tray.stl", wall=0.3)
    COMM.Barrier()
    summary: dict = {"trough": {}, "stl": {}}
    for size in sizes:
        name = f"size_{size:g}"
        summary["trough"][name] = trough(size)
        path = tray(size, mould)
        summary[name] = numbers = key_numbers(path)
        say(f"{name}: " + ", ".join(f"{k} {v:.5g}" for k, v in numbers.items()), "  trough: " + ", ".join(
            f"{k} {v:.2g}" for k, v in summary["trough"][name].items()))
        summary["stl"][name] = key_numbers(tray(size, fx.tools.solid(args.out / "tray.stl")))
        off = {k: summary["stl"][name][k] / numbers[k] - 1 for k in (*PLACES, "least")}
        say("  from STL, over the exact tool: " + ", ".join(f"{k} {v:+.2%}" for k, v in off.items())
            + f"; {summary['stl'][name]['seconds']:.1f} s")
    summary["frictionless"] = {}
    for size in sizes[:2]:
        slid = summary["frictionless"][f"size_{size:g}"] = key_numbers(tray(
            size, mould, friction="none", separates=True, nodes_per_step=0.03))
        say(f"without friction, size {size:g}: " + ", ".join(f"{k} {v:.5g}" for k, v in slid.items()))
    path.wall().to_csv(args.out / "wall.csv")
    if not args.quick:
        path.view3d(args.out / "tray_3d.png", grid=0.1)
    path.to_csv(args.out / "tray.csv")
    summarise(args.out, {**summary, "versions": files.versions()})


if __name__ == "__main__":
    main()
