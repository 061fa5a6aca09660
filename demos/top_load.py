"""The top load of a blown bottle: crushed, it buckles in waves round it before its axisymmetric path has its peak.

A parison is blown into a mould, taken as a new body free of stress (cm, MPa: forces times 100 are N) and crushed,
elastic. From 1.1 cm on the ring on which it stands hops from element to element: the force there is good to 3 %, and
the run ends at 1.15 cm, before the path turns back.
"""

from common import parser, save, say, summarise

import formingx as fx
from formingx.figures import figure

STIFF = fx.NeoHookean(c10=1000 / 6)
WAVES = range(2, 7)
STEP = fx.StepControl(largest=0.004)                            # short ones: for the curve, and for counts
SHAPE = {"radius": 3, "height": 10, "neck": 1.5, "shoulder": 2, "neck_height": 1.5, "base": -2.9, "fillet": 0.8,
         "shoulder_fillet": 0.8}


def blow(elements):
    """The blown bottle as a mesh."""
    mesh = fx.mesh.parison(inner_radius=1.1, thickness=0.3, length=10.6, elements=(elements, 1))
    scene = fx.Scene(mesh=mesh, materials=fx.MooneyRivlin(c10=50.0, c01=15.0), loads=[fx.Pressure("inner")],
                     supports=[fx.Symmetry("axis"), fx.Clamped("neck")],
                     contacts=[fx.Contact("outer", fx.tools.bottle(**SHAPE), "stick")])
    return fx.trace(scene, until=fx.pressure(100.0), progress=False).formed()


def crush(bottle, travel):
    """(path, why it ended) of the bottle pushed down on a frictionless plate by its neck.

    The plate gives way by a fiftieth of the wall: the ring on which the bottle stands, a line on a rigid plate, is then
    as wide as the points at which contact acts are far apart, and rolls over them instead of hopping.
    """
    floor = fx.tools.plane(float(bottle.nodes_of("outer")[:, 1].min())).reversed()
    scene = fx.Scene(mesh=bottle, materials=STIFF, contacts=[fx.Contact("outer", floor, "none", points=4, penalty=2.0,
                                                                            ramp=1e-4)],
                     supports=[fx.Symmetry("axis"), fx.Symmetry("neck", "r"), fx.Displaced("neck", "z")])
    try:
        return fx.trace(scene, until=fx.travel(-travel), progress=False, step=STEP), ""
    except fx.ConvergenceError as error:
        return error.path, str(error)


def main():
    """Blow, crush, count, draw."""
    options = parser("top_load", __doc__).parse_args()
    path, ended = crush(blow(60 if options.quick else 180), 0.75 if options.quick else 1.15)
    down, force = -path["travel"], 100 * path["support_force"]
    found = path.stability([4] if options.quick else WAVES, states="all")
    summary = {"axisymmetric": {"largest_force_N": float(force.max()), "travel_reached_cm": float(down[-1]),
                                "ended": ended.split(".")[0]}}
    for n in [4] if options.quick else WAVES:
        loss = found.first_of(n)
        if loss is not None:
            summary[f"n_{n}"] = {"travel_cm": -loss.control, "force_N": 100 * loss.state.measures["support_force"]}
            say(f"n = {n}: {summary[f'n_{n}']}")
    summary["first_n"] = None if found.first is None else found.first.number
    say(str(found), f"axisymmetric: {summary['axisymmetric']}")
    drawing, axes = figure()
    axes.plot(down, force, color="C0", label="axisymmetric path")
    for n in WAVES:
        if f"n_{n}" in summary:
            one = summary[f"n_{n}"]
            axes.plot(one["travel_cm"], one["force_N"], "o", color=f"C{n}", label=f"buckles, n = {n}")
    axes.set(xlabel="travel (cm)", ylabel="force (N)")
    axes.legend(frameon=False)
    save(drawing, options.out / "top_load.png")
    if found.first is not None and not options.quick:
        found.first.view3d(options.out / "mode.png", scale=0.05)
    summarise(options.out, summary)


if __name__ == "__main__":
    main()
