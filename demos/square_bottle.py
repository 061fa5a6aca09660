"""Blow a square bottle of 70 mm by 70 mm by 180 mm from a parison in three dimensions.

The closed parison (`bottles.py`) hangs in the closed mould. Air flows in at a constant rate for one second; then its
pressure grows to 0.6 MPa in 0.2 s. The melt sticks where it touches. A quarter is solved, and all numbers are those of
the whole bottle. Three checks follow:

* The section at half the height is blown in plane strain: a ring of the same melt by the same air flow. Its wall is
  scaled to the area that the wall has in that section of the bottle.
* A round bottle of a thin elastic tube is compared with a solid of axisymmetric elements in the same mould.
* A tube whose ends are held is inflated past its limit point (neo-Hookean, length 4 R, H/R = 0.025).

Lengths in mm, stresses in MPa, times in s.
"""

import numpy as np
from bottles import (
    CARD,
    DENSITY,
    HEIGHT,
    HOLD,
    MID_HEIGHT,
    RADIUS,
    SECTION,
    UNITS,
    WALL,
    graded,
    mould,
    symmetries,
    wall_area,
    walls_at,
)
from common import parser, say, summarise

import formingx as fx
from formingx.results import files

LENGTH, FILL, FLOW_TIME, HOLD_TIME = 172.0, 480e3, 1.0, 0.2             # of the parison; air in the first second, mm3
CORNER = 144.0                                                        # of the meridian, to the melt in the corner
STRIP, SHARE = 4.0, 0.9                                               # length of the ring, part of the section filled
THIN, ROUND_LENGTH = 0.4, 120.0                                       # wall and length of the tube in the round mould
ELASTIC = fx.MooneyRivlin(c10=1.0, c01=0.3)
ROUND_MOULD = {"radius": 40.0, "height": 96.0, "neck": 18.0, "shoulder": 20.0, "neck_height": 20.0, "base": -136.0,
               "fillet": 10.0, "shoulder_fillet": 10.0}


def blow(mesh, tool, volume, supports):
    """Return the path of a parison of the melt that air at a constant flow, then its pressure, blows into a mould."""
    scene = fx.Scene(mesh=mesh, thickness=WALL, materials=CARD, model=fx.Membrane(wrinkles=0.01),
                     supports=[*supports, *symmetries(mesh)], loads=[fx.Pressure("inner", name="air")],
                     contacts=[fx.Contact("outer", tool, "stick", name="mould")])
    return fx.Process(scene).run([
        fx.Stage("air flow", control="air", amplitudes={fx.enclosed_volume: [(0.0, 0.0), (FLOW_TIME, volume)]}),
        fx.Stage("hold", control="air", until=fx.pressure(HOLD), duration=HOLD_TIME)], progress=False)


def square_bottle(elements):
    """Return the path of the square bottle; triangles are small where the melt reaches the corner of the base."""
    meridian = LENGTH - RADIUS + np.pi / 2 * RADIUS
    rows, columns = graded(elements[0], CORNER / meridian, RADIUS / meridian, 0, 1), graded(elements[1], 45, 12, 0, 90)
    mesh = fx.mesh.tube(radius=RADIUS, length=LENGTH, elements=(rows, columns), part="quarter", end="closed")
    return blow(mesh, mould(), FILL, [fx.Clamped("neck")])


def plane_strain(columns):
    """Return the path of a ring of the parison that is blown in plane strain into the section of the mould."""
    mesh = fx.mesh.tube(radius=RADIUS, length=STRIP, elements=(2, columns), part="quarter", z=MID_HEIGHT + STRIP / 2)
    return blow(mesh, mould(), SHARE * STRIP * (SECTION - np.pi * RADIUS**2),
                [fx.Symmetry(name, "z", guide=True) for name in ("neck", "end")])


def meridian(rows, offset=0.0):
    """Return points (r, z) of the closed tube for the round mould, from the neck; `offset` from its middle surface."""
    straight = ROUND_LENGTH - RADIUS
    s = np.linspace(0.0, straight + np.pi / 2 * RADIUS, rows + 1)
    angle, z = np.maximum(s - straight, 0.0) / RADIUS, -np.minimum(s, straight)
    r = RADIUS + offset
    line = np.column_stack([r * np.cos(angle), z - r * np.sin(angle)])
    line[-1, 0] = 0.0
    return line


def round_bottle(elements, solid_rows):
    """Return least wall and largest difference of bands of the tube over the solid, in a round mould."""
    profile = fx.tools.bottle(**ROUND_MOULD)
    target = fx.pressure(50 * THIN / RADIUS)
    body = fx.mesh.from_lines(meridian(solid_rows, -THIN / 2)[::-1], meridian(solid_rows, THIN / 2)[::-1],
                              elements=(1, 1))
    solid = fx.trace(fx.Scene(
        mesh=body, materials=ELASTIC, supports=[fx.Symmetry("axis"), fx.Clamped("end")], loads=[fx.Pressure("inner")],
        contacts=[fx.Contact("outer", profile, "stick", separates=False, name="mould")]),
        until=target, progress=False, step=fx.StepControl(target=8)).profile()
    mesh = fx.mesh.revolved(meridian(elements[0]), elements=(None, elements[1]), part="quarter")
    wall = fx.trace(fx.Scene(
        mesh=mesh, thickness=THIN, materials=ELASTIC, supports=[fx.Clamped("neck"), *symmetries(mesh)],
        loads=[fx.Pressure("inner")],
        contacts=[fx.Contact("outer", fx.tools.revolved(profile), "stick", name="mould")]),
        until=target, progress=False).wall()
    length = ROUND_LENGTH - RADIUS + np.pi / 2 * RADIUS
    first = length / elements[0]                                      # the element at the clamped neck is left out
    s = mesh.arc_length(*wall.reference_points[wall.triangles].mean(1).T)
    exact, thickness = length - solid.reference_length, solid.thickness       # the solid begins at the pole
    bands, ends = [], np.linspace(first, length, 13)
    for low, high in zip(ends[:-1], ends[1:]):
        mine = (s > low) & (s < high)
        of_solid = np.interp(s[mine], exact[::-1], thickness[::-1])
        bands.append(np.average(wall.wall[mine], weights=wall.reference_area[mine])
                     / np.average(of_solid, weights=wall.reference_area[mine]) - 1)
    inside = (exact > first) & (exact < length)
    return {"least_wall_over_solid": wall.wall[s > first].min() / thickness[inside].min(),
            "bands_largest_percent": 100 * np.abs(bands).max()}


def inflation(elements):
    """Return pressure and volume at the limit point of a tube of length 4 R whose ends are held, for R = mu = 1."""
    H = 0.025
    mesh = fx.mesh.tube(radius=1.0, length=4.0, elements=elements, part="quarter")
    scene = fx.Scene(mesh=mesh, thickness=H, materials=fx.NeoHookean(c10=0.5), loads=[fx.Pressure("inner")],
                     supports=[fx.Clamped("neck"), fx.Clamped("end"), *symmetries(mesh)])
    (limit,) = fx.trace(scene, until=fx.enclosed_volume(30.0), progress=False).limit_points
    first = scene.symmetry_factor * mesh.enclosed_volume()
    return {"limit_pressure_R_over_mu_H": limit.measures["pressure"] / H,
            "limit_volume_over_first": 1 + limit.measures["enclosed_volume"] / first}


def main():
    options = parser("square_bottle", __doc__)
    args = options.parse_args()
    elements, columns, tube, solid_rows, free = (
        ((20, 5), 8, (27, 4), 40, (14, 4)) if args.quick else ((84, 24), 32, (53, 16), 160, (54, 32)))
    path = square_bottle(elements)
    wall, part = path.wall(), path.part(density=DENSITY, units=UNITS)
    section, ring = walls_at(wall, MID_HEIGHT), plane_strain(columns).wall()
    scale = wall_area(wall, MID_HEIGHT) / wall_area(ring, MID_HEIGHT)
    summary = {
        "square_bottle": {
            "least_wall_mm": part.min_wall, **{key: {"mid_height": value} for key, value in section.items()},
            "weight_g": part.weight, "capacity_ml": part.capacity / 1000,
            "plane_strain": {key: scale * value for key, value in walls_at(ring, MID_HEIGHT).items()}},
        "round": round_bottle(tube, solid_rows), "inflation": inflation(free)}
    bottle, strain = summary["square_bottle"], summary["square_bottle"]["plane_strain"]
    say(f"square bottle: {len(wall.wall)} triangles, {len(path)} states, {path.counts.seconds:.0f} s; minimum wall"
        f" {part.min_wall:.3f} mm (too large by about {part.min_wall_error:.3f}) at z ="
        f" {part.min_wall_at[2] + HEIGHT:.0f} mm above the base, weight {part.weight:.1f} g, capacity"
        f" {bottle['capacity_ml']:.0f} ml",
        f"at half the height: face {section['middle_of_face_mm']:.3f} mm, edge {section['edge_mm']:.3f} mm; in plane"
        f" strain {strain['middle_of_face_mm']:.3f} mm, {strain['edge_mm']:.3f} mm",
        f"round bottle over the solid: minimum wall {summary['round']['least_wall_over_solid']:.4f}, bands within"
        f" {summary['round']['bands_largest_percent']:.2f} %",
        f"limit point of a tube: p R / (mu H) = {summary['inflation']['limit_pressure_R_over_mu_H']:.4f} at"
        f" {summary['inflation']['limit_volume_over_first']:.4f} times its volume")
    wall.to_csv(args.out / "wall.csv", UNITS)
    path.to_csv(args.out / "square_bottle.csv")
    if not args.quick:
        path.view3d(args.out / "square_bottle_3d.png", grid=10.0)
    summarise(args.out, {**summary, "versions": files.versions()})


if __name__ == "__main__":
    main()
