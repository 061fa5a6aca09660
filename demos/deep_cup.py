"""Form a deep cup by vacuum; contact starts at the rim (Song 1993, section 5.3, figs. 5.5 and 5.6).

Material and sheet as in demos/cup.py (Mooney, I1 constant 50 psi, I2 constant 15 psi; r0 = 10 cm, h0 = 0.3 cm,
clamped). The thesis does not print the size of the mould: depth 10 cm, draft 5 degrees, fillet 2 cm here. Lengths in
cm, stresses in psi.
"""

import numpy as np
from common import parser, say, summarise
from moulding import at_pressures, cost, filled_at, first_touch, first_touch_at, name_of, write

import formingx as fx
from formingx.contact import resultants
from formingx.results import files

RADIUS, THICKNESS = 10.0, 0.3
PRESSURES = (2.0, 4.0, 8.0, 15.0, 30.0, 60.0)


def form(friction, elements, depth, draft, fillet):
    """Return the path to the last pressure, and the mould."""
    mesh = fx.mesh.disc(radius=RADIUS, thickness=THICKNESS, elements=elements)
    mould = fx.tools.cup(radius=RADIUS, depth=depth, mouth=THICKNESS, draft=draft, fillet=fillet)
    scene = fx.Scene(mesh=mesh, materials=fx.MooneyRivlin(c10=50.0, c01=15.0),
                     supports=[fx.Symmetry("axis"), fx.Clamped("rim")], loads=[fx.Pressure("bottom")],
                     contacts=[fx.Contact("top", mould, friction)])
    targets = [fx.pressure(p) for p in PRESSURES]
    path = fx.trace(scene, until=targets[-1], intermediate=targets[:-1], max_steps=1500)
    return path, mould


def key_numbers(path, mould):
    """Return the numbers of the summary of one path."""
    corner = next(p for p in mould.pieces if hasattr(p, "radius"))
    angles = corner.start + corner.sweep * np.linspace(0, 1, 41)
    fillet = corner.centre + corner.radius * np.column_stack([np.cos(angles), np.sin(angles)])
    touch = first_touch(path)
    with path.problem.state_context(touch) as problem:
        points, traction = resultants.traction(problem.contacts[0], touch.x, touch.control)
    touching = np.flatnonzero(traction[:-1, 0] > 0)
    return {
        **at_pressures(path, PRESSURES, "psi"),
        "first_contact_pressure_psi": first_touch_at(path),
        "first_contact_at_R_cm": points[touching[-1], 0] if len(touching) else None,
        "filled_pressure_psi": filled_at(path, fillet, THICKNESS / 2),
        "max_penetration_over_h0": path["penetration"].max() / THICKNESS,
        **cost(path),
    }


def main():
    options = parser("deep_cup", __doc__, elements=60, layers=2)
    options.add_argument("--depth", type=float, default=10.0, help="depth of the cup, cm")
    options.add_argument("--draft", type=float, default=5.0, help="angle of the wall, degrees")
    options.add_argument("--fillet", type=float, default=2.0, help="radius of the bottom edge, cm")
    args = options.parse_args()
    elements = (20, 1) if args.quick else (args.elements, args.layers)
    summary = {}
    for friction in ("stick", 0.3):
        name = name_of(friction)
        path, mould = form(friction, elements, args.depth, args.draft, args.fillet)
        summary[name] = n = key_numbers(path, mould)
        say(f"{name}: first contact {n['first_contact_pressure_psi']:.4g} psi at R = {n['first_contact_at_R_cm']} cm,"
            f" filled at {n['filled_pressure_psi']} psi, least thickness ratio"
            f" {n['min_thickness_ratio_at_psi'][f'{PRESSURES[-1]:g}']:.4f};"
            f" {n['steps']} states, {n['newton_iterations']}"
            f" Newton iterations, {n['cutbacks']} cut back, {n['solve_seconds']:.1f} s")
        write(path, mould, [path.target_state(fx.pressure(p)) for p in PRESSURES], args.out, name)
        if not args.quick and friction == "stick":
            path.view3d(args.out / "deep_cup_3d.png")
    summarise(args.out, {**summary, "mesh": {"radius_elements": elements[0], "thickness_elements": elements[1]},
                         "versions": files.versions()})


if __name__ == "__main__":
    main()
