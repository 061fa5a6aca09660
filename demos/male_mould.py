"""Vacuum forming over a male mould: a clamped sheet above the mould is drawn down over it (Song 1993, section 5.1).

Mooney, I1 constant 50 psi, I2 constant 15 psi; r0 = 10 cm, h0 = 0.3 cm, clamped 0.2 cm above the mould; mould
5 cm radius at the top, 3 cm high, 10 degrees draft, fillets 0.8 cm. The pressure difference acts on the upper face.
Lengths in cm, stresses in psi.
"""

from common import COMM, parser, say, summarise
from moulding import at_pressures, cost, draw_forming, name_of

import formingx as fx
from formingx.results import files

RADIUS, THICKNESS = 10.0, 0.3
PRESSURES = (2.0, 4.0, 8.0, 15.0)


def form(friction, elements):
    """The path to the last pressure, and the mould."""
    mesh = fx.mesh.disc(radius=RADIUS, thickness=THICKNESS, elements=elements)
    mould = fx.tools.male(radius=5.0, height=3.0, base=-3.2, draft=10.0, fillet=0.8, foot=0.8)
    scene = fx.Scene(mesh=mesh, materials=fx.MooneyRivlin(c10=50.0, c01=15.0),
                     supports=[fx.Symmetry("axis"), fx.Clamped("rim")], loads=[fx.Pressure("top")],
                     contacts=[fx.Contact("bottom", mould, friction)])
    targets = [fx.pressure(p) for p in PRESSURES]
    path = fx.trace(scene, until=targets[-1], through=targets[:-1], step=fx.StepControl(target=8), max_steps=1500)
    return path, mould


def main():
    options = parser("male_mould", __doc__.splitlines()[0])
    options.add_argument("--elements", type=int, default=60, help="elements along the radius")
    options.add_argument("--layers", type=int, default=2, help="elements through the thickness")
    args = options.parse_args()
    elements = (20, 1) if args.quick else (args.elements, args.layers)
    summary = {}
    for friction in ("stick", "none", 0.3):
        name = name_of(friction)
        path, mould = form(friction, elements)
        summary[name] = n = {**at_pressures(path, PRESSURES, "psi"),
                             "max_penetration_over_h0": path["penetration"].max() / THICKNESS, **cost(path)}
        last = f"{PRESSURES[-1]:g}"
        say(f"{name}: pole {n['pole_thickness_ratio_at_psi'][last]:.4f}, least {n['min_thickness_ratio_at_psi'][last]:.4f} at"
            f" R = {n['min_thickness_at_R_cm_at_psi'][last]:.3g} cm; {n['steps']} states, {n['newton_iterations']} Newton"
            f" iterations, {n['cutbacks']} cut back, {n['solve_seconds']:.1f} s")
        path.to_csv(args.out / f"{name}.csv")
        files.write_profile(path.profile(), args.out / f"{name}_profile.csv", COMM)
        draw_forming(path, [path.met(fx.pressure(p)) for p in PRESSURES], mould, args.out, name, side="bottom")
        if not args.quick and friction == "stick":
            path.view3d(args.out / "male_mould_3d.png")
    summarise(args.out, {**summary, "mesh": {"radius_elements": elements[0], "thickness_elements": elements[1]},
                         "versions": files.versions()})


if __name__ == "__main__":
    main()
