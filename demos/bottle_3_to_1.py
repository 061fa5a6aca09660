"""Blow a bottle of three times the parison's radius, of a material that stiffens and of two that hardly do.

A closed parison (inner radius 10 mm, wall 3 mm, 60 mm long) is blown into a bottle of radius 33 mm, to 0.3 MPa. The
parison sticks to the mould. All materials have a shear modulus of 0.2 MPa: "gent" (Jm = 25: I1 stays below 28),
"neo_hooke" and "mooney" (c10 = 0.09, c01 = 0.01 MPa). The pressure of the neo-Hookean tube has a maximum; beyond it the
tube would bulge at one place if there were no mould. Lengths in mm, stresses in MPa.
"""

import numpy as np
from common import parser, save, say, summarise
from relaxing import cost

import formingx as fx
from formingx import figures
from formingx.results import files
from formingx.results.evaluate.profile import refined

RADIUS, BODY, PRESSURE = 10.0, 33.0, 0.3
MATERIALS = {"gent": fx.Gent(mu=0.2, Jm=25.0), "neo_hooke": fx.NeoHookean(c10=0.1),
             "mooney": fx.MooneyRivlin(c10=0.09, c01=0.01)}
MOULD = fx.tools.bottle(radius=BODY, height=45.0, neck=14.0, shoulder=24.0, neck_height=44.0, base=-28.0, fillet=12.0,
                        shoulder_fillet=12.0)
TITLES = {"gent": "Gent", "neo_hooke": "neo-Hookean", "mooney": "Mooney-Rivlin"}
FILLED = (0.2, 0.5, 0.8)                                     # of the volume in the end, to draw


def blow(material, elements):
    mesh = fx.mesh.parison(inner_radius=RADIUS, thickness=3.0, length=60.0, elements=elements)
    scene = fx.Scene(mesh=mesh, materials=MATERIALS[material], loads=[fx.Pressure("inner")],
                     supports=[fx.Symmetry("axis"), fx.Clamped("neck")],
                     contacts=[fx.Contact("outer", MOULD, "stick")])
    return fx.trace(scene, until=fx.pressure(PRESSURE), progress=False)


def section(axes, profile, side, colour):
    """Fill one side of a section: side = 1 or -1."""
    r, z = np.vstack([refined(profile.bottom), refined(profile.top)[::-1]]).T
    axes.fill(side * r, z, color=colour)


def main():
    options = parser("bottle_3_to_1", __doc__, elements=60, layers=2)
    args = options.parse_args()
    elements = (36, 1) if args.quick else (args.elements, args.layers)
    summary = {}
    figure, (sections, walls, pressures) = figures.figure(3, width=4.0)
    for k, name in enumerate(MATERIALS):
        path = blow(name, elements)
        part, profile = path.part(), path.profile()
        summary[name] = {"blow_ratio": float(profile.bottom[:, 0].max() / RADIUS),
                         "limit_pressure_MPa": [s.measures["pressure"] for s in path.limit_points],
                         "least_wall_mm": part.min_wall, "least_wall_at_height_mm": part.min_wall_height,
                         "evenness": part.uniformity, "content_ml": part.capacity / 1000, **cost(path)}
        say(f"{name}: blown {summary[name]['blow_ratio']:.2f} to 1, minimum wall {part.min_wall:.3f} mm, evenness"
            f" {part.uniformity:.3f}, limit pressures {summary[name]['limit_pressure_MPa']}, {len(path)} states")
        label = TITLES[name]
        if name == "gent":
            full = path["enclosed_volume"][-1]
            for part_full in FILLED:
                section(sections, path.profile(path.state_at(fx.enclosed_volume(part_full * full))), -1, "0.75")
            section(sections, path.profile(path.states[0]), -1, "0.5")
            for side in (1, -1):
                section(sections, profile, side, "C0")
            r, z = MOULD.outline().T
            for side in (1, -1):
                sections.plot(side * r, z, "k", lw=0.8)
        wall = path.wall()
        walls.plot(wall.height, wall.wall, color=f"C{k}", label=label)
        pressures.plot(path["enclosed_volume"] / 1000, path["pressure"], color=f"C{k}", label=label)
    sections.set(xlabel="r, mm", ylabel="z, mm", aspect="equal", title="Gent", ylim=(-32, 62))
    walls.set(xlabel="height, mm", ylabel="wall, mm", ylim=(0, None))
    pressures.set(xlabel="volume blown, ml", ylabel="pressure, MPa", ylim=(0, 0.12))
    walls.legend(frameon=False)
    save(figure, args.out / "bottle_3_to_1.png")
    summarise(args.out, summary | {"mesh": {"meridian_elements": elements[0], "thickness_elements": elements[1]},
                                   "versions": files.versions()})


if __name__ == "__main__":
    main()
