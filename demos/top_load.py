"""Crush a blown bottle: it buckles in waves round its body before its axisymmetric path reaches a peak.

A parison is blown into a mould, taken as a new body free of stress (cm, MPa: forces times 100 are N) and crushed,
elastic. Contact acts at 16 points of each edge, so that the ring on which the bottle stands rolls. With four points it
hops from point to point: the force oscillates, and its highest value is 5 % above (on 360 elements the peak is 1.4 %
lower). A second mould has a groove round the body. Under top load the groove is no gain: the buckling force falls
by a fifth, because the groove yields axially and a mode of two waves tilts it. With shallower grooves, at mid-height,
it falls by 1 to 3 %.
"""

from common import parser, save, say, summarise

import formingx as fx
from formingx.figures import figure

STIFF = fx.NeoHookean(c10=1000 / 6)
WAVES = range(2, 7)
RADIUS, BASE, FILLET = 3.0, -2.9, 0.8
PLAIN = fx.tools.bottle(radius=RADIUS, height=10, neck=1.5, shoulder=2, neck_height=1.5, base=BASE, fillet=FILLET,
                        shoulder_fillet=FILLET)
GROOVE, DEPTH, HALF = 2.1, 0.2, 0.5                             # height of its middle, depth, half its width
GROOVED = fx.tools.Tool([(1.5, 10.6), (1.5, 9.1), (RADIUS, 7.1), (RADIUS, GROOVE + HALF), (RADIUS - DEPTH, GROOVE),
                         (RADIUS, GROOVE - HALF), (RADIUS, BASE), (0.0, BASE)],
                        [0.0, FILLET, FILLET, 0.3, 0.3, 0.3, FILLET, 0.0])


def blow(elements, mould):
    """Return the blown bottle as a mesh."""
    mesh = fx.mesh.parison(inner_radius=1.1, thickness=0.3, length=10.6, elements=(elements, 1))
    scene = fx.Scene(mesh=mesh, materials=fx.MooneyRivlin(c10=50.0, c01=15.0), loads=[fx.Pressure("inner")],
                     supports=[fx.Symmetry("axis"), fx.Clamped("neck")],
                     contacts=[fx.Contact("outer", mould, "stick")])
    return fx.trace(scene, until=fx.pressure(100.0), progress=False).deformed_mesh()


def numbers(found):
    """Return the numbers of the summary, N and cm."""
    summary = {"axisymmetric": {"largest_force_N": 100 * found.largest_force,
                                "travel_cm": found.travel_at_largest_force,
                                "travel_reached_cm": float(found.travel.max()), "ended": found.ended}}
    for n in found.stability.numbers:
        if (buckling := found.buckling(n)) is not None:
            summary[f"n_{n:g}"] = {"force_N": 100 * buckling[0], "travel_cm": buckling[1]}
    summary["first_n"] = None if found.first is None else int(found.first.number)
    return summary | {"energy_to_first_J": found.energy}                # N cm / 100 = J


def main():
    """Blow, crush, count the modes and draw."""
    options = parser("top_load", __doc__).parse_args()
    elements, travel, modes = (60, 0.75, [4]) if options.quick else (180, 1.6, WAVES)
    drawing, axes = figure()
    summary, found = {}, {}
    for name, mould, style in (("plain", PLAIN, "-"), ("grooved", GROOVED, "--"))[: 1 if options.quick else 2]:
        found[name] = one = fx.top_load(blow(elements, mould), material=STIFF, travel=travel, modes=modes)
        summary[name] = numbers(one)
        say(f"{name}: {one}")
        axes.plot(one.travel, 100 * one.force, style, color="C0", label=f"{name}, axisymmetric")
        for n in modes:
            if f"n_{n}" in summary[name]:
                there = summary[name][f"n_{n}"]
                axes.plot(there["travel_cm"], there["force_N"], "o" if name == "plain" else "s", color=f"C{n}",
                          label=f"buckles in {n} waves" if name == "plain" else None)
    summary = summary.pop("plain") | summary
    if "grooved" in summary:
        loads = [one[f"n_{one['first_n']}"]["force_N"] for one in (summary, summary["grooved"])]
        summary["groove_gains"] = loads[1] / loads[0] - 1
        say(f"the groove changes the first buckling load by {100 * summary['groove_gains']:.1f} %")
    axes.set(xlabel="travel, cm", ylabel="force, N", ylim=(0, None))
    if "grooved" in found:
        axes.set_title("circles: plain bottle, squares: grooved", fontsize="medium")
    axes.legend(frameon=False, fontsize=8)
    save(drawing, options.out / "top_load.png")
    if not options.quick:
        for name, one in found.items():
            one.first.view3d(options.out / f"mode_{name}.png", scale=0.05)
    summarise(options.out, summary)


if __name__ == "__main__":
    main()
