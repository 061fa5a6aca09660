"""Let sheets of three thicknesses sag in an oven, then form them.

Sheets of 1, 2 and 4 mm, 0.3 m across, hinged at the rim, are heated from both sides between heaters of 400 C, while
they creep under their weight; heat is conducted through the thickness. The polymer is illustrative: a glass of 300 MPa,
a melt of 0.15 MPa and a rubber of 2 kPa (shear moduli). At 160 C the melt relaxes with 1 s, the glass with 1e-6 s, by
Arrhenius' law with 180 kJ/mol. A sheet leaves the oven when it has sagged by 30 mm, and is blown upward to a dome 60 mm
high in 0.5 s. A sheet without weight, for the same time in the oven, is run for comparison. Units kg, m, s, Pa, C; keys
`sag_mm/{thickness in mm}/{time in s}`; walls are over that of the sheet.
"""

from common import parser, save, say, summarise
from relaxing import cost

import formingx as fx
from formingx import figures
from formingx.results import files

RADIUS, HEATER, COLD, LIMIT, DOME, FORMING = 0.15, 400.0, 25.0, 0.03, 0.06, 0.5
TIMES = {1: (5, 10, 15), 2: (10, 20, 30), 4: (20, 40, 60)}             # of each thickness, mm: s
HEAT = fx.ThermalProperties(conductivity=0.17, density=1050.0, heat_capacity=1800.0)
POLYMER = fx.TransientNetwork(fx.NeoHookean(c10=1e3), [(0.15e6, 1.0), (3e8, 1e-6)],
                              shift=fx.Arrhenius(180e3, 160.0, unit="C"))


def scene(thickness, elements, weight):
    heaters = [fx.Radiation(face, emissivity=0.9, heater=HEATER, view_factor=0.8) for face in ("top", "bottom")]
    return fx.Scene(mesh=fx.mesh.disc(radius=RADIUS, thickness=1e-3 * thickness, elements=elements), materials=POLYMER,
                    temperature=COLD, heat=fx.Cooling(HEAT, heaters, unit="C", tolerance=0.5),
                    supports=[fx.Symmetry("axis"), fx.SimplySupported("rim")],
                    loads=[fx.Pressure("bottom", name="air"), *([fx.Gravity(1050.0, 9.81)] if weight else [])])


def form(thickness, elements, accuracy, time=None):
    """Return the path through oven and forming; time: time in the oven of a sheet without weight (s)."""
    process = fx.Process(scene(thickness, elements, weight=time is None))
    heat = fx.Stage("heat", duration=time) if time else fx.Stage(
        "heat", until=fx.sag(LIMIT), duration=300.0, intermediate=[fx.process_time(t) for t in TIMES[thickness]])
    path = process.run([heat], accuracy=accuracy, progress=False)
    now = path.last
    dome = [(now.time, now.measures["pole_height"]), (now.time + FORMING, DOME)]
    blow = fx.Stage("blow", control="air", amplitudes={fx.pole_height: dome})
    return process.run([heat, blow], start=path, accuracy=accuracy, progress=False)


def draw(axes, path, thickness, colour):
    """Draw sag and temperatures of faces and middle over time, and the formed wall."""
    sags, walls = axes
    oven = [s for s in path.states if s.stage == "heat"]
    sags.plot([s.time for s in oven], [1e3 * s.measures["sag"] for s in oven], color=colour, label=f"{thickness} mm")
    wall = path.wall()
    walls.plot(1e3 * wall.reference_radius, wall.ratio, color=colour, label=f"{thickness} mm, sagged")


def main():
    options = parser("oven", __doc__, elements=16, accuracy=1e-2)
    args = options.parse_args()
    elements, accuracy = ((8, [2, 1, 2]), 6e-2) if args.quick else ((args.elements, [1, 2, 2, 1]), args.accuracy)
    summary = {"sag_mm": {}, "time_to_limit_s": {}, "temperature_C": {}, "wall": {}, "cost": {}}
    figure, axes = figures.figure(2, width=5.2)
    for k, thickness in enumerate((2,) if args.quick else TIMES):
        path = form(thickness, elements, accuracy)
        met = path.state("heat")
        flat = form(thickness, elements, accuracy, met.time)
        h, through = f"{thickness:g}", [0.0, 0.5e-3 * thickness, 1e-3 * thickness]
        summary["sag_mm"][h] = {f"{t:g}": 1e3 * path.state("heat", time=t).measures["sag"]
                                for t in TIMES[thickness] if t <= met.time}
        summary["time_to_limit_s"][h] = met.time
        summary["temperature_C"][h] = dict(zip(("bottom", "middle", "top"), path.temperature(
            [(0.0, z) for z in through], met).tolist(), strict=True))
        summary["wall"][h] = {name: {"pole": float(p.wall().ratio[0]), "least": float(p.wall().ratio.min())}
                              for name, p in (("sagged", path), ("without_sag", flat))}
        summary["cost"][h] = cost(path)
        say(f"{thickness} mm: 30 mm after {met.time:.4g} s, at {summary['temperature_C'][h]['middle']:.1f} C within"
            f" and {summary['temperature_C'][h]['top']:.1f} C outside; wall at the pole of the dome"
            f" {summary['wall'][h]['sagged']['pole']:.4f}, without sag {summary['wall'][h]['without_sag']['pole']:.4f};"
            f" {len(path)} states")
        draw(axes, path, thickness, f"C{k}")
        wall = flat.wall()
        axes[1].plot(1e3 * wall.reference_radius, wall.ratio, "--", color=f"C{k}", label=f"{thickness} mm, without sag")
    axes[0].axhline(1e3 * LIMIT, color="0.6", lw=0.8)
    axes[0].set(xlabel="time in the oven, s", ylabel="sag, mm", ylim=(0, None))
    axes[1].set(xlabel="reference radius R, mm", ylabel="wall of the dome / original")
    for one in axes:
        one.legend(frameon=False, fontsize="small")
    save(figure, args.out / "oven.png")
    summarise(args.out, summary | {"mesh": {"radius_elements": elements[0], "thickness_elements": len(elements[1])},
                                   "accuracy": accuracy, "versions": files.versions()})


if __name__ == "__main__":
    main()
