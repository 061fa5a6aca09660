"""Stretch a preform by a rod and blow it into a square bottle of 60 mm by 60 mm by 180 mm.

The preform has a middle surface of radius 10.5 mm, a wall of 3.2 mm and a length of 92 mm. A little air supports it
while the rod carries its end to the base in 0.1 s and the pressure grows to the pre-blow. Then air flows in at a
constant rate for 0.2 s. The pressure grows to 4 MPa while the rod withdraws. The card of the material is invented: it
relaxes and stiffens like a polyester (PET) above its glass transition. Melt sticks to rod and mould. A quarter is
solved, and all numbers are those of the whole bottle. The same preform is blown without the rod. With the same rod it
is blown into a round mould, too, and compared with a solid of axisymmetric elements. Lengths in mm, stresses in MPa,
times in s.
"""

import numpy as np
from bottles import UNITS, draw_states, symmetries
from common import parser, say, summarise

import formingx as fx
from formingx.results import files

RADIUS, WALL, LENGTH, DENSITY = 10.5, 3.2, 92.0, 1.33                     # of the preform; g/cm3
HEIGHT, HALF, EDGE, NECK, TIP = 180.0, 30.0, 12.0, 12.5, 6.0              # of the bottle; radius of the rod
CARD = fx.Viscoelastic(fx.Yeoh(c10=0.5, c20=0.012, c30=0.0006), [(2.0, 0.1)])               # invented
SUPPORT_AIR, PRE_BLOW, HIGH, FILL = 0.3, 0.4, 4.0, 390e3                  # pressures; air at the end of the flow, mm3
ROUND_FILL = 300e3
STRETCH_TIME, FLOW_TIME, HOLD_TIME = 0.1, 0.2, 0.2
GAP = 0.5                                                             # between rod and middle surface, at both ends
TRAVEL = HEIGHT - LENGTH - GAP


FILLETS = [0.0, 3.0, 14.0, 8.0, 0.0]
NECK_LINE = [(NECK, 10.0), (NECK, -14.0)]
BODY = [(HALF, -44.0), (HALF, -HEIGHT), (0.0, -HEIGHT)]                   # shoulder, wall and base


def square_mould():
    """Return the square mould, whose body has a shoulder from the round neck."""
    body = fx.tools.swept(fx.Tool([(0.0, -4.0), (7.0, -4.0), *BODY], [0.0, 0.0, *FILLETS[2:]]), half=(HALF, HALF),
                          corner=EDGE)
    neck = fx.tools.revolved(fx.Tool([(NECK, 10.0), (NECK, -60.0), (0.0, -60.0)]))
    return fx.tools.intersection(body, neck, fillet=FILLETS[1])


def round_profile():
    """Return the profile of the round mould, as wide as the square one."""
    return fx.Tool([*NECK_LINE, *BODY], FILLETS)


def rod(face=0.0):
    """Return the profile of the rod, whose round tip is above the end of the preform.

    `face` is the distance of the inner face of the preform from its middle surface.
    """
    low = -LENGTH + GAP + face
    return fx.Tool([(0.0, low), (TIP, low), (TIP, 300.0)], [0.0, 0.999 * TIP, 0.0])


def run(scene, with_rod, fill):
    """Return the path of a scene with the load "air" and, with the rod, the tool "rod"."""
    process, path, before = fx.Process(scene), None, []
    start, first = 0.0, 0.0
    if with_rod:
        before = [
            fx.Stage("support", control="air", until=fx.pressure(SUPPORT_AIR)),
            fx.Stage("stretch", amplitudes={"rod": [(0.0, 0.0), (STRETCH_TIME, TRAVEL)],
                                            "air": [(STRETCH_TIME / 2, SUPPORT_AIR), (STRETCH_TIME, PRE_BLOW)]})]
        path = process.run(before, progress=False)
        start, first = path.last.time, path.last.measures["enclosed_volume"]
    flow = {fx.enclosed_volume: [(start, first), (start + FLOW_TIME, fill)]}
    return process.run([
        *before, fx.Stage("blow", control="air", amplitudes=flow),
        fx.Stage("high pressure", control="air", until=fx.pressure(HIGH), duration=HOLD_TIME,
                 inactive=["rod"] if with_rod else [])], progress=False, start=path)


def bottle(mould, elements, with_rod=True, fill=FILL):
    """Return the path of the preform in three dimensions, a quarter of it, in a mould."""
    mesh = fx.mesh.tube(radius=RADIUS, length=LENGTH, elements=elements, part="quarter", end="closed")
    tools = [fx.Contact("outer", mould, "stick", name="mould"),
             fx.Contact("inner", fx.tools.revolved(rod()), "stick", direction=(0, 0, -1), name="rod")]
    scene = fx.Scene(mesh=mesh, thickness=WALL, materials=CARD, model=fx.Membrane(wrinkles=0.01),
                     supports=[fx.Clamped("neck"), *symmetries(mesh)], loads=[fx.Pressure("inner", name="air")],
                     contacts=tools[:1 + with_rod])
    return run(scene, with_rod, fill)


def meridian(rows, offset):
    """Return points (r, z) of a face of the preform from its end up; `offset` is its distance from the middle surface.
    """
    straight, r = LENGTH - RADIUS, RADIUS + offset
    s = np.linspace(0.0, straight + np.pi / 2 * RADIUS, rows + 1)
    angle, z = np.maximum(s - straight, 0.0) / RADIUS, -np.minimum(s, straight)
    line = np.column_stack([r * np.cos(angle), z - r * np.sin(angle)])[::-1]
    line[0, 0] = 0.0
    return line


def round_solid(rows, layers):
    """Return the path of the preform as a solid of axisymmetric elements, with the rod, in the round mould."""
    mesh = fx.mesh.from_lines(meridian(rows, -WALL / 2), meridian(rows, WALL / 2), elements=(1, layers))
    scene = fx.Scene(
        mesh=mesh, materials=CARD, supports=[fx.Symmetry("axis"), fx.Clamped("end")],
        loads=[fx.Pressure("inner", name="air")],
        contacts=[fx.Contact("outer", round_profile(), "stick", separates=False, name="mould"),
                  fx.Contact("inner", rod(WALL / 2), "stick", separates=False, direction=(0, -1), name="rod")])
    return run(scene, True, ROUND_FILL)


def draw_history(path, axes):
    """Draw the force of the rod, and the pressure of the air, over the time."""
    time = path["process_time"]
    axes.plot(time, path["rod_force"], "C0")
    axes.set(xlabel="time (s)", title="force of the rod, pressure of the air")
    axes.set_ylabel("force of the rod (N)", color="C0")
    right = axes.twinx()
    right.plot(time, path["air_pressure"], "C3")
    right.set(ylim=(0, None))
    right.set_ylabel("pressure (MPa)", color="C3")


def main():
    args = parser("stretch_blow", __doc__).parse_args()
    elements, ring_elements, solid_elements = ((18, 4), (18, 4), (24, 1)) if args.quick else (
        (64, 16), (128, 8), (240, 2))
    square = square_mould()
    path, plain = bottle(square, elements), bottle(square, elements, with_rod=False)
    ring = bottle(fx.tools.revolved(round_profile()), ring_elements, fill=ROUND_FILL)
    wall, part = path.wall(), path.part(density=DENSITY, units=UNITS)
    summary = {"least_wall_mm": part.min_wall, "weight_g": part.weight,
               "rod_force_largest_N": float(np.abs(path["rod_force"]).max()),
               "without_rod": {"least_wall_mm": plain.part().min_wall},
               "round": {"least_wall_over_solid": ring.part().min_wall / round_solid(*solid_elements).part().min_wall}}
    say(f"{len(wall.wall)} triangles, {len(path)} states, {path.counts.seconds:.0f} s; minimum wall"
        f" {part.min_wall:.3f} mm at z = {part.min_wall_at[2] + HEIGHT:.0f} mm above the base, weight"
        f" {part.weight:.1f} g, holds {part.capacity / 1000:.0f} ml",
        f"largest force of the rod {summary['rod_force_largest_N']:.0f} N; without the rod the minimum wall is"
        f" {summary['without_rod']['least_wall_mm']:.3f} mm")
    wall.to_csv(args.out / "wall.csv", UNITS)
    path.to_csv(args.out / "stretch_blow.csv")
    if not args.quick:
        draw_states(path, {"stretched by the rod": path.state(stage="stretch"), "blown": path.last},
                    args.out / "stretch_blow.png", grid=8.25, curves=lambda axes: draw_history(path, axes))
    summarise(args.out, {**summary, "versions": files.versions()})


if __name__ == "__main__":
    main()
