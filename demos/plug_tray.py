"""Form a tray by a plug with friction and a vacuum, from a heated sheet that relaxes.

The sheet is hotter in its middle; its stiffness is a table of the temperature. The plug, a box with rounded edges,
slides on the sheet (Coulomb's law) and waits. It is inactive while the vacuum draws the sheet into the mould, to which
the sheet sticks as on a cold mould (no heat is conducted). A quarter is solved. A half is solved for comparison, on the
mesh of the quarter and its mirror image, because on a mesh of its own its walls would differ by the error of the mesh.
All numbers are those of the whole part. Lengths in mm, stresses in MPa, times in s, temperatures in C.
"""

import numpy as np
from common import parser, say, summarise

import formingx as fx
from formingx.results import files

SHEET, CORNER, THICKNESS, DENSITY = (160.0, 100.0), 20.0, 1.5, 1.05
STIFFNESS = {120.0: 0.08, 140.0: 0.05, 165.0: 0.03}                   # c10 by temperature
FRICTION, PLUG_TRAVEL, SPEED, WAIT, SEAL, VACUUM = 0.3, 26.0, 60.0, 0.2, 0.02, 0.09
PLACES = {"floor": (0, 0, -30), "long_wall": (0, 40, -15), "short_wall": (70, 0, -15), "flange_corner": (66, 36, -2)}
AROUND = 8.0                                                          # radius of the mean at a place
UNITS = fx.Units(length="mm", stress="MPa", time="s")


def temperature(x, y):
    """Return the temperature at (x, y), C: hottest in the middle, 25 degrees less in the corners."""
    return 165.0 - 12.5 * ((2 * x / SHEET[0]) ** 2 + (2 * y / SHEET[1]) ** 2)


def form(part, size):
    """Return the path of a part of the tray: "whole", "half" or "quarter"."""
    outline = fx.mesh.rectangle(*SHEET, corner=CORNER, part="quarter")
    cut = ["x0", "y0"][:{"whole": 0, "half": 1, "quarter": 2}[part]]                   # planes of symmetry
    sheet = fx.mesh.sheet(outline, size=size, reflected=[name for name in ("y0", "x0") if name not in cut])
    material = fx.Viscoelastic(fx.NeoHookean(c10=fx.table(STIFFNESS)), [(0.15, 0.5)])
    mould = fx.tools.box(half=(72, 42), depth=30, corner=18, fillet=8, lip=3, draft=8)
    plug = fx.tools.box(half=(50, 24), depth=30, corner=14, fillet=8, draft=5, mouth=30, plug=True)
    symmetry = [fx.Symmetry(name, name[0]) for name in cut]
    scene = fx.Scene(
        mesh=sheet, thickness=THICKNESS, materials=material, temperature=temperature, model=fx.Membrane(wrinkles=0.01),
        supports=[fx.SimplySupported("rim"), *symmetry], loads=[fx.Pressure("top", name="vacuum")],
        contacts=[fx.Contact("bottom", mould, "stick", name="mould"),
                  fx.Contact("top", plug, FRICTION, direction=(0, 0, -1), name="plug")])
    return fx.Process(scene).run([
        fx.Stage("plug", control="plug", until=fx.travel(PLUG_TRAVEL), speed=SPEED), fx.Stage("wait", duration=WAIT),
        fx.Stage("seal", control="vacuum", until=fx.pressure(SEAL)), fx.Stage("plug off", inactive=["plug"]),
        fx.Stage("vacuum", control="vacuum", until=fx.pressure(VACUUM), inactive=["plug"])], progress=False)


def numbers(path):
    """Return the summary's numbers of one path, for the whole part."""
    wall, part = path.wall(), path.part(density=DENSITY, units=UNITS)
    return {"weight_g": part.weight, "least_wall_mm": part.min_wall, "least_at_mm": list(part.min_wall_at),
            "plug_force_N": float(np.abs(path["plug_force"]).max()),
            "walls_mm": {name: THICKNESS * wall.mean_ratio(place, AROUND) for name, place in PLACES.items()},
            "touching": path.filling("mould").touching[-1], "triangles": len(wall.wall), "states": len(path),
            "iterations": path.counts.iterations, "failures": path.counts.failures, "seconds": path.counts.seconds}


def main():
    options = parser("plug_tray", __doc__)
    options.add_argument("--sizes", type=float, nargs="+", default=[6.0, 3.0], help="sizes of the triangles, mm")
    args = options.parse_args()
    sizes, summary = [16.0] if args.quick else args.sizes, {}
    runs = [(part, size) for size in sizes for part in ("quarter", "half") if part == "quarter" or size == sizes[-1]]
    for part, size in runs:
        path = form(part, size)
        found = summary[f"{part}_{size:g}"] = numbers(path)
        say(f"{part}, size {size:g}: {found['triangles']} triangles, {found['iterations']} iterations,"
            f" {found['failures']} failures, {found['seconds']:.0f} s; weight {found['weight_g']:.4g} g, minimum wall"
            f" {found['least_wall_mm']:.4g} mm, plug {found['plug_force_N']:.4g} N")
        if part == "quarter":
            path.wall().to_csv(args.out / "wall.csv", UNITS)
            path.to_csv(args.out / "plug_tray.csv")
            if not args.quick:
                path.view3d(args.out / "plug_tray.png")
    quarter, half = (summary[f"{part}_{sizes[-1]:g}"] for part in ("quarter", "half"))
    summary["half_over_quarter"] = {
        **{name: half[name] / quarter[name] for name in ("weight_g", "least_wall_mm", "plug_force_N")},
        **{name: half["walls_mm"][name] / quarter["walls_mm"][name] for name in PLACES}}
    summarise(args.out, {**summary, "versions": files.versions()})


if __name__ == "__main__":
    main()
