"""Form a sheet over a male mould, by draping and by vacuum (Song 1993, section 4.1, names the process).

The thesis computes none: all sizes are ours. Drape: the mould rises into a sheet clamped at its rim and stretches it
over its top. Vacuum: the mould stands just below the sheet in a box as wide as the clamp, and pressure from above lays
the sheet over top, wall and base. (Vacuum after the drape needs a process in stages.) Sheet and material as in
demos/cup.py (Mooney, I1 constant 50 psi, I2 constant 15 psi; r0 = 10 cm, h0 = 0.3 cm). Mould: top radius 4 cm, height 3
cm, draft 10 degrees, fillets of 1.5 cm around the top, 1 cm at the foot and in the corner of the box. Lengths in cm,
stresses in psi.
"""

import numpy as np
from common import parser, say, summarise
from moulding import cost, first_touch, name_of, write

import formingx as fx
from formingx.results import files

RADIUS, THICKNESS, GAP = 10.0, 0.3, 0.05
TOP, HEIGHT, DRAFT, FILLET, FOOT = 4.0, 3.0, 10.0, 1.5, 1.0
TRAVELS = (0.5, 1.0, 2.0, 3.0)
PRESSURES = (2.0, 5.0, 10.0, 20.0, 40.0, 60.0)
RUNS = (("drape", "none"), ("vacuum", "stick"), ("vacuum", 0.3))


def form(process, friction, elements):
    """Return the path of "drape" or "vacuum", its targets, and the mould in its last position."""
    mesh = fx.mesh.disc(radius=RADIUS, thickness=THICKNESS, elements=elements)
    drape = process == "drape"
    if drape:
        mould = fx.tools.male(radius=TOP, height=HEIGHT, base=-HEIGHT - GAP, draft=DRAFT, fillet=FILLET, foot=FOOT)
    else:
        wide, base = TOP + HEIGHT * np.tan(np.radians(DRAFT)), -HEIGHT - GAP
        mould = fx.tools.Tool([(RADIUS, 0), (RADIUS, base), (wide, base), (TOP, -GAP), (0, -GAP)],
                              [0, FOOT, FOOT, FILLET, 0])
    targets = [fx.travel(d) for d in TRAVELS] if drape else [fx.pressure(p) for p in PRESSURES]
    scene = fx.Scene(mesh=mesh, materials=fx.MooneyRivlin(c10=50.0, c01=15.0),
                     supports=[fx.Symmetry("axis"), fx.Clamped("rim")], loads=[] if drape else [fx.Pressure("top")],
                     contacts=[fx.Contact("bottom", mould, friction, direction=(0, 1) if drape else None)])
    step = fx.StepControl(target=8, length=0.02 if drape else 0.1)       # short enough to end at the first touch
    path = fx.trace(scene, until=targets[-1], intermediate=targets[:-1], step=step, max_steps=1500)
    return path, targets, mould.moved(z=TRAVELS[-1]) if drape else mould


def key_numbers(path, targets):
    """Return the numbers of the summary of one path."""
    drape = targets[0].name == "travel"
    unit, states = "cm" if drape else "psi", {f"{t.value:g}": path.target_state(t) for t in targets}
    profiles = {at: path.profile(state) for at, state in states.items()}
    control = "travel" if drape else "pressure"
    last, thinnest = path.profile(), int(np.argmin(path.profile().thickness_ratio))
    return {
        f"first_contact_at_{unit}": first_touch(path).measures[control],
        f"pole_thickness_ratio_at_{unit}": {at: p.thickness_ratio[0] for at, p in profiles.items()},
        f"min_thickness_ratio_at_{unit}": {at: p.thickness_ratio.min() for at, p in profiles.items()},
        f"contact_length_cm_at_{unit}": {at: state.measures["contact_length"] for at, state in states.items()},
        f"tool_force_lb_at_{unit}": {at: abs(state.measures["tool_force"]) / 2.54**2 for at, state in states.items()},
        "min_thickness_at_R_cm": last.reference_radius[thinnest],
        "max_penetration_over_h0": path["penetration"].max() / THICKNESS,
        **cost(path),
    }


def main():
    options = parser("male_mould", __doc__, elements=60, layers=2)
    args = options.parse_args()
    elements = (20, 1) if args.quick else (args.elements, args.layers)
    summary = {}
    for process, friction in RUNS:
        name = f"{process}_{name_of(friction)}"
        path, targets, mould = form(process, friction, elements)
        summary[name] = n = key_numbers(path, targets)
        unit = "cm" if process == "drape" else "psi"
        say(f"{name}: first contact at {n[f'first_contact_at_{unit}']:.4g} {unit}; penetration"
            f" {n['max_penetration_over_h0']:.1e} h0; {n['steps']} states, {n['newton_iterations']} Newton iterations,"
            f" {n['cutbacks']} cut back, {n['solve_seconds']:.1f} s",
            f"  {unit:>6}{'pole t/t0':>12}{'least t/t0':>12}{'touching, cm':>14}{'force, lb':>12}")
        for at in n[f"pole_thickness_ratio_at_{unit}"]:
            say(f"  {at:>6}" + "".join(f"{n[f'{key}_at_{unit}'][at]:{width}}" for key, width in (
                ("pole_thickness_ratio", "12.5f"), ("min_thickness_ratio", "12.5f"), ("contact_length_cm", "14.3f"),
                ("tool_force_lb", "12.2f"))))
        write(path, mould, [path.target_state(t) for t in targets], args.out, name, unit=unit, side="bottom")
        if not args.quick:
            path.view3d(args.out / f"{name}_3d.png")
    summarise(args.out, {**summary, "mesh": {"radius_elements": elements[0], "thickness_elements": elements[1]},
                         "versions": files.versions()})


if __name__ == "__main__":
    main()
