"""Wrinkles in the flange of a disc that a ball draws down: hoops in compression are not yet a buckle.

The rim slides in freely and is held in z; the ball is frictionless (Mooney-Rivlin, c10 = 50, c01 = 15, radius 10).
At every thickness the flange is compressed round the axis; only the thin ones wrinkle.
"""

import numpy as np
from common import parser, save, say, summarise

import formingx as fx
from formingx.figures import figure

RADIUS, TRAVEL = 10.0, 4.0


def draw(thickness, elements):
    """The path of a disc drawn down by the ball; elements are smaller at the rim, where a thin disc bends sharply."""
    mesh = fx.mesh.disc(radius=RADIUS, thickness=thickness, elements=elements, concentrate={RADIUS: 0.1})
    ball = fx.tools.sphere(radius=4.0, z=thickness)
    scene = fx.Scene(mesh=mesh, materials=fx.MooneyRivlin(c10=50.0, c01=15.0),
                     supports=[fx.Symmetry("axis"), fx.Symmetry("rim", normal="z")],
                     contacts=[fx.Contact("top", ball, "none", moves=(0, -1), points=4)])
    through = [fx.travel(t) for t in np.arange(0.2, TRAVEL, 0.2)]          # short enough steps to solve between them
    return fx.trace(scene, until=fx.travel(TRAVEL), through=through, progress=False)


def hoop(path, thickness, state, R):
    """Hoop force per radial length, both at rest, over shear modulus times thickness."""
    z, weights = np.polynomial.legendre.leggauss(4)
    points = np.array([(r, thickness * (1 + s) / 2) for r in R for s in z])
    P = path.stress(state).at(points).first_piola[:, 2, 2].reshape(len(R), -1)
    return P @ weights / 2 / 130.0


def main():
    """Draw, count, and look where the hoop is compressed."""
    options = parser("flange", __doc__).parse_args()
    elements, modes = ((80, 1), range(7, 10)) if options.quick else ((200, 2), range(2, 25))
    summary, at = {}, np.linspace(0.05, RADIUS - 0.05, 200)
    drawing, (left, right) = figure(2, 4.8, 3.8)
    for k, thickness in enumerate((0.3, 0.1) if options.quick else (0.3, 0.1, 0.05)):
        path = draw(thickness, elements)
        found = path.stability(modes, states="all")
        first, style = found.first, {"color": f"C{k}", "label": f"h = {thickness:g}"}
        compressed = [state for state in path.states[1:] if hoop(path, thickness, state, at).min() < -1e-3]
        ends = at[hoop(path, thickness, path.last, at) < 0]
        numbers = summary[f"h_{thickness:g}"] = {"alarms": len(found.alarms)}
        if first is not None:
            numbers |= {"first_n": int(first.number), "first_travel": first.control}
            last, picture = first, thickness
        numbers["hoop_compressed"] = {
            "first_state_at_travel": float(compressed[0].measures["travel"]),
            "at_end_from_radius": float(ends.min()), "at_end_to_radius": float(ends.max()),
            "least_at_end_over_mu_h": float(hoop(path, thickness, path.last, at).min())}
        say(f"h = {thickness:g}: {numbers}")
        left.plot(at, hoop(path, thickness, path.last, at), **style)
        where = {n: found.first_of(n).control for n in modes if found.first_of(n) is not None}
        if where:
            right.plot(list(where), list(where.values()), "o-", **style)
    left.axhline(0, color="0.6", lw=0.8)
    left.set(xlabel="radius at rest", ylabel="hoop resultant / (mu h)", title=f"ball drawn down {TRAVEL:g}")
    right.set(xlabel="waves round the axis", ylabel="travel at which they begin", title="wrinkles",
              xticks=range(4, 25, 4), ylim=(0, TRAVEL))
    for axes in (left, right):
        axes.legend(frameon=False)
    save(drawing, options.out / "flange.png")
    if not options.quick:
        last.view3d(options.out / f"mode_h_{picture:g}.png", scale=0.05)
    summarise(options.out, summary)


if __name__ == "__main__":
    main()
