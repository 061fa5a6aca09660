"""Form a sheet into a shallow cup by pressure, with three laws of friction (Song 1993, section 5.3, figs. 5.2 to 5.4).

Mooney, I1 constant 50 psi, I2 constant 15 psi (chapter 5 prints C01 = 50, C10 = 15: its C01 is the I1 constant);
r0 = 10 cm, h0 = 0.3 cm, clamped; cup radius 10 cm, depth 5 cm, bottom fillet 1 cm. Lengths in cm, stresses in psi.
"""

import numpy as np
from common import parser, say, summarise
from moulding import at_pressures, cost, filled_at, name_of, report

import formingx as fx
from formingx.results import files

RADIUS, THICKNESS, DEPTH, FILLET = 10.0, 0.3, 5.0, 1.0
I1_CONSTANT, I2_CONSTANT = 50.0, 15.0
PRESSURES = (2.0, 4.0, 8.0, 15.0, 30.0, 60.0, 160.0)
LAWS = ("stick", "none", 0.3)


def form(friction, elements, pressures=PRESSURES, kinematics=None, step=None, **options):
    """Return the path to the last pressure, and the mould; in plane strain, the cup is a long trough."""
    mesh = fx.mesh.disc(radius=RADIUS, thickness=THICKNESS, elements=elements)
    mould = fx.tools.cup(radius=RADIUS, depth=DEPTH, mouth=THICKNESS, fillet=FILLET)
    scene = fx.Scene(mesh=mesh, materials=fx.MooneyRivlin(c10=I1_CONSTANT, c01=I2_CONSTANT),
                     supports=[fx.Symmetry("axis"), fx.Clamped("rim")], loads=[fx.Pressure("bottom")],
                     contacts=[fx.Contact("top", mould, friction, **options)], kinematics=kinematics)
    targets = [fx.pressure(p) for p in pressures]
    path = fx.trace(scene, until=targets[-1], intermediate=targets[:-1], step=step or fx.StepControl(target=8),
                    max_steps=1000)
    return path, mould


def key_numbers(path, mould):
    """Return the numbers of the summary of one path."""
    corner = mould.pieces[1]
    angles = corner.start + corner.sweep * np.linspace(0, 1, 41)
    fillet = corner.centre + corner.radius * np.column_stack([np.cos(angles), np.sin(angles)])
    ramp = path.problem.contacts[0].law.theta
    touch = path.state_at(fx.displacement(DEPTH - ramp, at=(0.0, THICKNESS)))
    return {
        **at_pressures(path, PRESSURES, "psi"),
        "first_contact_pressure_psi": touch.measures["pressure"],
        "filled_pressure_psi": filled_at(path, fillet, THICKNESS / 2),
        "max_penetration_over_h0": path["penetration"].max() / THICKNESS,
        "mass_error": abs(path.last.measures["mass_error"]),
        **cost(path),
    }


def main():
    options = parser("cup", __doc__, elements=60, layers=2)
    args = options.parse_args()
    elements = (20, 1) if args.quick else (args.elements, args.layers)
    summary = {}
    say(f"Forming into a shallow cup, {elements[0]} x {elements[1]} x 2 triangles")
    for friction in LAWS:
        name = name_of(friction)
        path, mould = form(friction, elements)
        summary[name] = key_numbers(path, mould)
        report(path, mould, summary[name], PRESSURES, args.out, name)
        if not args.quick and friction == LAWS[0]:
            path.view3d(args.out / "cup_3d.png")
    summarise(args.out, {**summary, "mesh": {"radius_elements": elements[0], "thickness_elements": elements[1]},
                         "versions": files.versions()})


if __name__ == "__main__":
    main()
