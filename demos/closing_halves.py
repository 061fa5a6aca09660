"""Close two half moulds on an open tube, pinch it off at the base, and blow it into a square bottle.

The mould of `bottles.py` is cut at the plane x = 0, and each half closes along its own direction. A quarter is solved:
one half closes along -x, and the plane of symmetry stands for the other layer of the tube and for the other half. The
tube is longer than the mould. Air supports it while the halves close; they press it flat below the base. Then the air
blows the part above the base. The pressure acts on this part alone, named by `Pressure(above=)` before the run: air
cannot pass the pinch. The melt sticks where it touches. The tail below the pinch is the flash, which is weighed apart
from the bottle. Lengths in mm, stresses in MPa.
"""

from bottles import DENSITY, HEIGHT, HOLD, RADIUS, UNITS, WALL, draw_states, mould, symmetries
from common import parser, say, summarise

import formingx as fx
from formingx.results import files

LENGTH, OPENING, SUPPORT_AIR = 210.0, 40.0, 0.002                      # length of the tube, way of a half, pre-blow
MELT = fx.MooneyRivlin(c10=0.05, c01=0.015)


def form(elements):
    """Return the path: pre-blow, closing of the halves, blow."""
    mesh = fx.mesh.tube(radius=RADIUS, length=LENGTH, elements=elements, part="quarter")
    right = fx.tools.half(mould(), normal="x").moved(x=OPENING)
    scene = fx.Scene(
        mesh=mesh, thickness=WALL, materials=MELT, model=fx.Membrane(wrinkles=0.01),
        supports=[fx.Clamped("neck"), fx.Symmetry("end", "z", guide=True), *symmetries(mesh)],
        loads=[fx.Pressure("inner", name="air", above=-HEIGHT)],
        contacts=[fx.Contact("outer", right, "stick", direction=(-1, 0, 0), name="mould")])
    return fx.Process(scene).run([
        fx.Stage("pre-blow", control="air", until=fx.pressure(SUPPORT_AIR)),
        fx.Stage("close", control="mould", until=fx.travel(OPENING)),
        fx.Stage("blow", control="air", until=fx.pressure(HOLD))], progress=False)


def main():
    args = parser("closing_halves", __doc__).parse_args()
    path = form((30, 5) if args.quick else (105, 16))
    wall = path.wall()
    bottle = wall.reference_points[wall.triangles].mean(1)[:, 2] > -HEIGHT
    weight = wall.reference_thickness * wall.reference_area
    summary = {
        "pinch_half_width_over_R": float(wall.deformed_points[wall.triangles[~bottle], 1].max() / RADIUS),
        "least_wall_ratio": float(wall.ratio[bottle].min()),
        "bottle_share_of_weight": float(weight[bottle].sum() / weight.sum()),
    }
    part = path.part(density=DENSITY, units=UNITS)
    say(f"{len(wall.wall)} triangles, {len(path)} states, {path.counts.iterations} iterations,"
        f" {path.counts.seconds:.0f} s",
        f"the tube is pressed flat to a half width of {summary['pinch_half_width_over_R']:.3f} R (pi/2 R without"
        f" stretch)",
        f"minimum wall of the bottle {WALL * summary['least_wall_ratio']:.3f} mm; of {part.weight:.1f} g the bottle"
        f" weighs {100 * summary['bottle_share_of_weight']:.1f} %")
    wall.to_csv(args.out / "wall.csv", UNITS)
    path.to_csv(args.out / "closing_halves.csv")
    if not args.quick:
        draw_states(path, {"the halves pinch the tube": path.state(stage="close"), "blown": path.last},
                    args.out / "closing_halves.png")
    summarise(args.out, {**summary, "versions": files.versions()})


if __name__ == "__main__":
    main()
