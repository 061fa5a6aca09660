"""Press a stuck block with a strip ten times as stiff in its middle (Song 1993, section 7.4, figs. 7.12, 7.13).

The I1 and I2 constants are 1.0 and 0.1 MPa outside, 10.0 and 1.0 MPa inside. The thesis does not print the height of
the strip: here it is 0.3125 cm of the half height. The block of one material is run for comparison, with and without
plates that its side may touch.
"""

from common import parser, save, say, summarise
from plates import HALF_HEIGHT, NEWTON, block, draw_grids, forces, positions, press

import formingx as fx
from formingx import figures
from formingx.results import files

STRIP = 0.3125                                               # half of its height, cm
RATIOS = (1.1, 1.2, 1.3, 1.47)


def main():
    options = parser("compression_sandwich", __doc__, elements=12)
    args = options.parse_args()
    elements = (6, 4) if args.quick else (args.elements, 8)
    soft, stiff = fx.MooneyRivlin(c10=1.0, c01=0.1), fx.MooneyRivlin(c10=10.0, c01=1.0)
    layers = {"strip": STRIP, "block": HALF_HEIGHT - STRIP}
    travels = [HALF_HEIGHT * (1 - 1 / r) for r in RATIOS]
    summary, drawn = {}, {}
    for name, strip, roll_over in (("sandwich", stiff, True), ("homogeneous", soft, False),
                                   ("homogeneous_roll_over", soft, True)):
        scene = block({"strip": strip, "block": soft}, "stick", elements, roll_over=roll_over, layers=layers)
        path, end = press(scene, travels, max_steps=300)
        drawn[name] = path
        at = path.last
        radii = positions(path, at, [(1.32, 0.0), (1.32, (STRIP + HALF_HEIGHT) / 2)])[:, 0]
        summary[name] = {"force_N_at_ratio": forces(path, travels, [f"{r:g}" for r in RATIOS]), "ended": end,
                         "radius_cm_middle": float(radii[0]), "radius_cm_soft_part": float(radii[1]),
                         "steps": path.counts.steps, "newton_iterations": path.counts.iterations}
        say(f"{name}: " + "  ".join(f"{r}: {v:.1f} N" for r, v in summary[name]["force_N_at_ratio"].items())
            + f"; radius at the middle {radii[0]:.3f} cm, in the soft part {radii[1]:.3f} cm"
            + ("" if end == "done" else f"; {end[:200]}"))
    last = drawn["sandwich"].last
    ratio = HALF_HEIGHT / (HALF_HEIGHT - last.measures["travel"])
    draw_grids(drawn["sandwich"], [last], [f"H/h = {ratio:.4g}"], elements, args.out / "grid.png")
    figure, axes = figures.figure(width=6.2)
    for name, path in drawn.items():
        axes.plot(HALF_HEIGHT / (HALF_HEIGHT - path["travel"]), NEWTON * path["tool_force"], ".-",
                  label=name.replace("_", " "))
    axes.set(xlabel="compression ratio H / h", ylabel="force, N", ylim=(0, None))
    axes.legend(frameon=False)
    save(figure, args.out / "force.png")
    waist = summary["sandwich"]["radius_cm_middle"] < summary["sandwich"]["radius_cm_soft_part"]
    summarise(args.out, {**summary, "waist": bool(waist), "versions": files.versions()})


if __name__ == "__main__":
    main()
