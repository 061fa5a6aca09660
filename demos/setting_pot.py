"""Form a pot with a plug, chill it in its mould, release and trim it: which of three materials keeps its shape?

The sheet, plug and mould are those of demos/relaxing_pot.py, at 150 C: instantaneous modulus 130 psi, of which 90 %
relax with 1 s. The plug waits for 1 s, vacuum fills the mould, which is steel at 20 C, and the part stays in it for 30
s. It is released, trimmed next to its flange, and cooled to 20 C. Three materials: "sets" (between 85 and 75 C a glass
of shear modulus 10000 psi forms, free of stress in the shape of that moment, `Solidification`); "glassy_branch" (a
branch of that modulus whose relaxation time is 1e-4 s at 150 C and infinite when cold, `Arrhenius`); "neither" (the
rubber and its branch alone). All shrink by 7e-5 per degree. Shrinkage is that of the largest diameter. Lengths in cm,
stresses in psi, times in s, heat in J, g, W.
"""

import numpy as np
from common import parser, save, say, summarise
from deep_cup import PRESSURES, RADIUS, THICKNESS
from plug_and_vacuum import MOULD
from relaxing import cost
from relaxing_pot import EDGE, INSTANT, PLUG_RADIUS, TRAVEL

import formingx as fx
from formingx import figures
from formingx.results import files
from formingx.results.evaluate.profile import refined

HOT, COLD, GLASS, SETS = 150.0, 20.0, 10e3, (75, 85)
RUBBER, RELAXING = fx.NeoHookean(c10=0.05 * INSTANT), (0.9 * INSTANT, 1.0)
BASE = fx.Viscoelastic(RUBBER, [RELAXING])
MATERIALS = {"sets": fx.Solidification(BASE, modulus=GLASS, between=SETS),
             "glassy_branch": fx.Viscoelastic(RUBBER, [RELAXING, (GLASS, 1e-4)],
                                              shift=fx.Arrhenius(250e3, HOT, unit="C")),
             "neither": BASE}
COLOURS = {"sets": "C0", "glassy_branch": "C1", "neither": "C2"}
HEAT = fx.ThermalProperties(conductivity=2e-3, density=1.05, heat_capacity=1.8)
HOLD, IN_MOULD, TRIM = 1.0, 30.0, 0.97 * RADIUS


def form(material, elements, accuracy):
    """Return the path up to the chilled part in its mould."""
    plug = fx.tools.male(radius=PLUG_RADIUS, height=40.0, base=-40.0, fillet=EDGE)
    scene = fx.Scene(mesh=fx.mesh.disc(radius=RADIUS, thickness=THICKNESS, elements=elements),
                     materials=MATERIALS[material], temperature=HOT,
                     expansion=fx.ThermalExpansion(linear=7e-5, stress_free=HOT),
                     heat=fx.Cooling(HEAT, unit="C", tools={"mould": (0.05, COLD)}, tolerance=1.0),
                     supports=[fx.Symmetry("axis"), fx.Clamped("rim")], loads=[fx.Pressure("bottom", name="vacuum")],
                     contacts=[fx.Contact("top", MOULD, "stick", name="mould"),
                               fx.Contact("bottom", plug, 0.3, direction=(0, 1), name="plug")])
    step = fx.StepControl(target=8)
    return fx.Process(scene).run([
        fx.Stage("plug", control="plug", until=fx.travel(TRAVEL), speed=6.0), fx.Stage("hold", duration=HOLD),
        fx.Stage("vacuum", control="vacuum", until=fx.pressure(PRESSURES[-1]), step=step),
        fx.Stage("in the mould", duration=IN_MOULD, inactive=["plug"])],
        accuracy=accuracy, max_steps=2000, progress=False)


def draw(axes, wall, colour, label):
    """Draw the section of a part that stands on its base; the run has it upside down."""
    base = max(wall.profile.bottom[:, 1].max(), wall.profile.top[:, 1].max())
    for side in (1, -1):
        outline = np.vstack([refined(wall.profile.bottom), refined(wall.profile.top)[::-1]])
        axes.fill(side * outline[:, 0], base - outline[:, 1], color=colour, label=label if side == 1 else None)


def main():
    options = parser("setting_pot", __doc__, elements=30, accuracy=1e-2)
    args = options.parse_args()
    elements, accuracy = ((8, [1, 1]), 5e-2) if args.quick else ((args.elements, [4, 2, 1]), args.accuracy)
    summary = {}
    figure, (sections, walls) = figures.figure(2, width=5.2)
    for name, colour in COLOURS.items():
        if args.quick and name == "glassy_branch":
            continue
        path = form(name, elements, accuracy)
        part = path.springback(COLD, trim=TRIM, accuracy=accuracy, duration=1.0 if args.quick else None)
        summary[name] = {"height": part.height, "least_wall": part.min_wall,
                         "shrinkage_percent": 100 * part.shrinkage, "springback": part.springback,
                         "flange_angle_degrees": part.flange_angle, "forming": cost(path), "release": cost(part.path)}
        say(f"{name}:", str(part), f"{len(path)} states to the chilled part, {len(part.path)} of its release")
        label = name.replace("_", " ")
        if name == "sets":
            draw(sections, part.before, "0.8", "in the mould")
        draw(sections, part.after, colour, label)
        walls.plot(part.after.reference_radius, part.after.wall, color=colour, label=label)
    sections.set(xlabel="r, cm", ylabel="height, cm", aspect="equal")
    sections.legend(frameon=False, loc="center")
    walls.set(xlabel="reference radius R, cm", ylabel="wall, cm", ylim=(0, None))
    save(figure, args.out / "setting_pot.png")
    summarise(args.out, summary | {"mesh": {"radius_elements": elements[0], "thickness_elements": len(elements[1])},
                                   "accuracy": accuracy, "versions": files.versions()})


if __name__ == "__main__":
    main()
