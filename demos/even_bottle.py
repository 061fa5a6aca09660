"""Find the wall of a parison from which an even bottle is blown.

Parison, mould, material and pressure are those of demos/parison.py; the parison sticks to the mould. Its wall is a
programme of 14 knots, equidistant on the inner meridian, linear between them, added to the outside. The goal is the
smallest standard deviation over mean (cv) of the bottle's wall, without the last 7 % at the neck, with no more material
than at first. Lengths in cm, stresses in psi.
"""

import numpy as np
from common import parser, save, say, summarise
from parison import BASE, BODY, FILLET, LENGTH, NECK, PRESSURE, RADIUS, SHOULDER, WALL

import formingx as fx
from formingx.figures import figure
from formingx.results import files

KNOTS, PART = 14, 0.93
ROUND = np.pi / 2 * RADIUS                                    # length of the inner meridian of the bottom


def along_meridian(Z):
    """Return the share of the inner meridian, 0 at the axis, 1 at the neck, at heights Z of the inner face."""
    angle = np.arccos(np.clip(-np.minimum(Z, 0.0) / RADIUS, -1, 1))
    return (np.where(Z < 0, RADIUS * angle, ROUND + Z)) / (ROUND + LENGTH)


def bottle(wall, elements=(60, 1)):
    """Return the scene of a parison with a programmed wall, and the target of its run."""
    mesh = fx.mesh.parison(inner_radius=RADIUS, thickness=lambda Z: wall(along_meridian(Z)), length=LENGTH,
                           elements=elements)
    mould = fx.tools.bottle(radius=BODY, height=10.0, neck=NECK, shoulder=SHOULDER, neck_height=LENGTH - BASE - 12.0,
                            base=BASE, fillet=FILLET, shoulder_fillet=FILLET)
    scene = fx.Scene(mesh=mesh, materials=fx.MooneyRivlin(c10=50.0, c01=15.0),
                     supports=[fx.Symmetry("axis"), fx.Clamped("neck")], loads=[fx.Pressure("inner")],
                     contacts=[fx.Contact("outer", mould, "stick")])
    return scene, fx.pressure(PRESSURE)


def main():
    options = parser("even_bottle", __doc__, elements=60)
    options.add_argument("--runs", type=int, default=6, help="largest number of runs")
    args = options.parse_args()
    elements = (24 if args.quick else args.elements, 1)
    design = fx.Design(lambda wall: bottle(wall, elements),
                       {"wall": fx.spline(KNOTS, start=WALL, low=0.1, high=0.39)}, step=fx.StepControl(target=8))
    first = design.run()
    end = PART * first.profile.reference_length[-1]
    result = design.fit(even=True, within=(0.0, end), max_runs=2 if args.quick else args.runs, min_change=2e-3,
                        start=first)
    before, after = (run.wall[run.profile.reference_length < PART * run.profile.reference_length[-1]]
                     for run in (result.before, result.best))
    say(str(result))
    drawing, axes = figure(2)
    result.plot_wall(axes[0])
    axes[0].set(xlabel="length along the parison, cm", ylabel="wall of the bottle, cm")
    knots = result.values["wall"]
    axes[1].plot(np.full(KNOTS, WALL), knots.coordinates * (ROUND + LENGTH), "0.6", label="before")
    axes[1].plot(knots.values, knots.coordinates * (ROUND + LENGTH), "C0o-", label="after")
    axes[1].set(xlabel="wall of the parison, cm", ylabel="length along its inside, cm", xlim=(0, None))
    axes[1].legend()
    save(drawing, args.out / "even_bottle.png")
    summarise(args.out, {
        "cv_before": before.std() / before.mean(), "cv_after": after.std() / after.mean(),
        "least_wall_before": before.min(), "least_wall_after": after.min(), "paths": result.paths,
        "volume_before": result.before.volume, "volume_after": result.best.volume,
        "wall_of_the_parison": {f"{s:g}": w for s, w in zip(knots.coordinates * (ROUND + LENGTH), knots.values)},
        "elements_along": elements[0], "versions": files.versions()})


if __name__ == "__main__":
    main()
