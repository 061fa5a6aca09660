"""Blow a closed parison into a bottle (Song 1993, section 5.3.2, names it as an application).

The thesis computes none: all sizes are ours. A tube of inner radius 1.1 cm and wall 0.3 cm, 10.6 cm long, has a round
bottom and is fixed at the neck. The body of the mould has a radius of 3 cm and a height of 10 cm. The material is that
of demos/cup.py (Mooney, I1 constant 50 psi, I2 constant 15 psi); the pressure inside grows to 200 psi. Lengths in cm,
stresses in psi.
"""

import numpy as np
from common import parser, say, summarise
from moulding import cost, filled_at, first_touch, first_touch_at, name_of, write

import formingx as fx
from formingx.contact import resultants
from formingx.results import files

RADIUS, WALL, LENGTH, PRESSURE = 1.1, 0.3, 10.6, 200.0
BODY, SHOULDER, NECK, BASE = 3.0, 2.0, 1.5, -2.9               # radius, height; radius; Z of the mould's bottom
FILLET = 0.8
FILLED = (0.1, 0.3, 0.5, 0.7, 0.85, 0.95)                       # parts of the mould, on the way


def blow(friction, elements):
    """Return the path to the last pressure, the mould, and the volume between mould and parison."""
    mesh = fx.mesh.parison(inner_radius=RADIUS, thickness=WALL, length=LENGTH, elements=elements)
    mould = fx.tools.bottle(radius=BODY, height=10.0, neck=NECK, shoulder=SHOULDER, neck_height=LENGTH - BASE - 12.0,
                            base=BASE, fillet=FILLET, shoulder_fillet=FILLET)
    scene = fx.Scene(mesh=mesh, materials=fx.MooneyRivlin(c10=50.0, c01=15.0),
                     supports=[fx.Symmetry("axis"), fx.Clamped("neck")], loads=[fx.Pressure("inner")],
                     contacts=[fx.Contact("outer", mould, friction)])
    room = content(mould.outline(200)) - content(mesh.line_of("outer"))
    path = fx.trace(scene, until=fx.pressure(PRESSURE),
                    intermediate=[fx.enclosed_volume(part * room) for part in FILLED],
                    step=fx.StepControl(target=8), max_steps=1000)
    return path, mould, room


def content(line):
    """Return the volume between a line (r, z), shape (n, 2), and the axis."""
    (r, s), dz = (line[:-1, 0], line[1:, 0]), np.diff(line[:, 1])
    return abs(np.sum(np.pi / 3 * (r * r + r * s + s * s) * dz))


def key_numbers(path, mould, room):
    """Return the numbers of the summary of one path."""
    profile, touch = path.profile(), first_touch(path)
    angles = mould.pieces[-2].start + mould.pieces[-2].sweep * np.linspace(0, 1, 41)
    fillet = mould.pieces[-2].centre + FILLET * np.column_stack([np.cos(angles), np.sin(angles)])
    z, t, thinnest = profile.top[:, 1], profile.thickness, int(np.argmin(profile.thickness))
    return {
        "limit_pressure_psi": [s.measures["pressure"] for s in path.limit_points],
        "first_contact_pressure_psi": first_touch_at(path),
        "first_contact_at_Z_cm": touching(path, touch)[0],
        "filled_pressure_psi": filled_at(path, fillet, WALL / 2),
        "pressure_psi_at_part_filled": {
            f"{part:g}": path.target_state(fx.enclosed_volume(part * room)).measures["pressure"] for part in FILLED},
        "base_thickness_cm": t[0],
        "thickness_cm_at_height_cm": {f"{h:g}": np.interp(h, z[z > BASE + FILLET] - BASE, t[z > BASE + FILLET])
                                      for h in (1.0, 2.0, 4.0, 6.0, 8.0, 10.0, 11.0, 12.0, 13.0)},
        "least_thickness_cm": t[thinnest],
        "least_thickness_at_reference_length_cm": profile.reference_length[thinnest],
        "cavity_volume_cm3": content(profile.bottom),
        "max_penetration_over_h0": path["penetration"].max() / WALL,
        "mass_error": abs(path.last.measures["mass_error"]),
        **cost(path),
    }


def touching(path, state):
    """Return the reference Z of the nodes that touch."""
    with path.problem.state_context(state) as problem:
        points, traction = resultants.traction(problem.contacts[0], state.x, state.control)
    found = points[traction[:, 0] > 0, 1]
    return found if len(found) else [None]


def main():
    options = parser("parison", __doc__, elements=90, layers=2)
    args = options.parse_args()
    elements = (40, 1) if args.quick else (args.elements, args.layers)
    summary = {}
    for friction in ("stick", "none"):
        name = name_of(friction)
        path, mould, room = blow(friction, elements)
        summary[name] = n = key_numbers(path, mould, room)
        limits = ", ".join(f"{p:.4g}" for p in n["limit_pressure_psi"]) or "none"
        say(f"{name}: limit pressure {limits} psi; first contact {n['first_contact_pressure_psi']:.4g} psi, filled at"
            f" {n['filled_pressure_psi']:.4g} psi; thickness of base {n['base_thickness_cm']:.4f}, least"
            f" {n['least_thickness_cm']:.4f} cm; {n['steps']} states, {n['newton_iterations']} Newton iterations,"
            f" {n['cutbacks']} cut back, {n['solve_seconds']:.1f} s",
            "  height, cm  " + "".join(f"{h:>8}" for h in n["thickness_cm_at_height_cm"]),
            "  thickness   " + "".join(f"{t:8.4f}" for t in n["thickness_cm_at_height_cm"].values()))
        states = [path.target_state(fx.enclosed_volume(part * room)) for part in FILLED] + [path.last]
        write(path, mould, states, args.out, name, along="reference arc length from the bottom")
        if not args.quick and friction == "stick":
            path.view3d(args.out / "parison_3d.png")
    summarise(args.out, {**summary, "mesh": {"meridian_elements": elements[0], "thickness_elements": elements[1]},
                         "versions": files.versions()})


if __name__ == "__main__":
    main()
