"""Draw discs down by a ball, and find which of their compressed flanges wrinkle.

The rim may slide inward and is constrained in z; the ball is frictionless. Mooney-Rivlin, c10 = 50, c01 = 15, radius
10. At every thickness the hoops of the flange are compressed; only the thin flanges wrinkle.
"""

import numpy as np
from common import parser, save, say, summarise

import formingx as fx
from formingx.figures import figure

RADIUS, TRAVEL = 10.0, 4.0


def draw(thickness, elements):
    """Return the path of a disc drawn down by the ball.

    Elements are smaller at the rim, where a thin disc bends sharply.
    """
    mesh = fx.mesh.disc(radius=RADIUS, thickness=thickness, elements=elements, concentrate={RADIUS: 0.1})
    ball = fx.tools.sphere(radius=4.0, z=thickness)
    scene = fx.Scene(mesh=mesh, materials=fx.MooneyRivlin(c10=50.0, c01=15.0),
                     supports=[fx.Symmetry("axis"), fx.Symmetry("rim", normal="z")],
                     contacts=[fx.Contact("top", ball, "none", direction=(0, -1), points=4)])
    through = [fx.travel(t) for t in np.arange(0.2, TRAVEL, 0.2)]          # short enough steps to solve between them
    return fx.trace(scene, until=fx.travel(TRAVEL), intermediate=through, progress=False)


def resultants(path, thickness):
    """Return the reference radii of the columns and their hoop resultants.

    The resultants are over shear modulus times thickness, shape (states, n).
    """
    found = [path.hoop_resultants(state) for state in path.states]
    return found[0].points[:, 0], np.array([one.resultant for one in found]) / (130.0 * thickness)


def main():
    """Draw the discs down, count their unstable modes, and find where hoops are compressed."""
    options = parser("flange", __doc__).parse_args()
    elements, modes = ((80, 1), range(7, 10)) if options.quick else ((200, 2), range(2, 25))
    summary = {}
    drawing, (left, middle, right) = figure(3, 4.4, 3.8)
    for k, thickness in enumerate((0.3, 0.1) if options.quick else (0.3, 0.1, 0.05)):
        path = draw(thickness, elements)
        found = path.stability(modes, states="all")
        first, style = found.first, {"color": f"C{k}", "label": f"h = {thickness:g}"}
        at, hoop = resultants(path, thickness)
        compressed = path["travel"][1:][hoop[1:].min(1) < -1e-3]
        ends = at[hoop[-1] < 0]
        numbers = summary[f"h_{thickness:g}"] = {"alarms": len(found.bifurcations)}
        if first is not None:
            numbers |= {"first_n": int(first.number), "first_travel": first.control}
            last, picture = first, thickness
        numbers["hoop_compressed"] = {
            "first_state_at_travel": float(compressed[0]),
            "at_end_from_radius": float(ends.min()), "at_end_to_radius": float(ends.max()),
            "least_at_end_over_mu_h": float(hoop[-1].min())}
        say(f"h = {thickness:g}: {numbers}")
        left.plot(at, hoop[-1], **style)
        where = {n: found.first_of(n).control for n in modes if found.first_of(n) is not None}
        if where:
            right.plot(list(where), list(where.values()), "o-", **style)
    shades = middle.pcolormesh(at, path["travel"], hoop, cmap="RdBu", vmin=-abs(hoop.min()), vmax=abs(hoop.min()),
                               shading="gouraud", rasterized=True)
    middle.contour(at, path["travel"], hoop, [0.0], colors="black", linewidths=1)
    drawing.colorbar(shades, ax=middle, label="hoop resultant / (mu h)", extend="max")
    left.axhline(0, color="0.6", lw=0.8)
    left.set(xlabel="radius at rest", ylabel="hoop resultant / (mu h)", title=f"ball drawn down {TRAVEL:g}")
    middle.set(xlabel="radius at rest", ylabel="travel", title=f"h = {thickness:g}: compressed where red")
    right.set(xlabel="waves round the axis", ylabel="travel at which they begin", title="wrinkles",
              xticks=range(4, 25, 4), ylim=(0, TRAVEL))
    for axes in [left, right] if where else [left]:
        axes.legend(frameon=False)
    save(drawing, options.out / "flange.png")
    if not options.quick:
        last.view3d(options.out / f"mode_h_{picture:g}.png", scale=0.05)
    summarise(options.out, summary)


if __name__ == "__main__":
    main()
