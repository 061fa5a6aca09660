"""Find the thickness, or the stiffness, over the radius of a sheet whose wall is even after inflation.

A round sheet of radius 1 and thickness 1/100, hinged at its rim, neo-Hookean, as a membrane and as a solid. (a) The
thickness h0(R) for an even wall h at a pole stretch l. (b) The constant C(R) (`c10`) for an even wall t h0, with a
uniform h0. The logarithms of the profiles are cubic splines, found by the Gauss-Newton method with derivatives of runs.
Thickness and C are over their values at the pole, which do not change the shape.
"""

import numpy as np
from common import parser, save, say, summarise

import formingx as fx
from formingx.figures import figure
from formingx.results import files

THICKNESS, C = 0.01, 0.5
RADII = (0.0, 0.25, 0.5, 0.75, 0.9, 1.0)
STRETCHES, WALLS = (1.25, 1.5, 2.0), (0.7, 0.5, 0.3)
MODELS = {"membrane": fx.Membrane, "solid": fx.MixedPressure}


def relative(profile, R):
    """Return a profile at R over its value at the pole; `profile` gives its logarithm."""
    return np.exp(profile(R) - profile(0.0))


def sheet(model, elements, stretch, h0=None, c=None):
    """Return the scene of a sheet with a profile of thickness or constant, and the target of its run."""
    mesh = fx.mesh.disc(radius=1.0, elements=elements, concentrate={0.0: 0.5, 1.0: 0.15},   # the rim turns, a solid's
                        thickness=THICKNESS if h0 is None else lambda R: THICKNESS * relative(h0, R))
    c10 = C if c is None else lambda R, Z: C * relative(c, R)
    scene = fx.Scene(mesh=mesh, materials=fx.NeoHookean(c10=c10), model=MODELS[model](),
                     supports=[fx.Symmetry("axis"), fx.SimplySupported("rim")], loads=[fx.Pressure("bottom")])
    return scene, fx.pole_stretch(stretch)


def search(model, elements, knots, stretch, of):
    """Return the `DesignResult` of one case; `of` is "h0" or "c"."""
    design = fx.Design(lambda profile: sheet(model, elements, stretch, **{of: profile}),
                       {"profile": fx.spline(knots, start=0.0, low=-4.0, high=4.0, smooth=True)})
    return design.fit(even=True, volume=None, max_runs=6, min_change=2e-4)


def numbers(result, name):
    """Return the numbers of the summary of one result."""
    profile, wall = result.values["profile"], result.best.wall
    over = {"h0_over_h": THICKNESS / wall.mean(), "C_over_C0": 1.0}[name]
    pressure = result.best.path.last.measures["pressure"]
    scale = {"p_R0_over_C_h": C * wall.mean(), "p_R0_over_C0_h0": C * THICKNESS}
    key = "p_R0_over_C_h" if name == "h0_over_h" else "p_R0_over_C0_h0"
    return {name: {f"{R:g}": float(over * relative(profile, R)) for R in RADII}, key: pressure / scale[key],
            "spread": float(np.ptp(wall) / wall.mean()), "paths": result.paths}


def main():
    options = parser("even_disc", __doc__, elements=80)
    options.add_argument("--knots", type=int, default=21, help="number of knots of the splines")
    args = options.parse_args()
    elements, knots = ((14, 1), 8) if args.quick else ((args.elements, 1), args.knots)
    stretches, walls = (STRETCHES[:1], WALLS[:1]) if args.quick else (STRETCHES, WALLS)
    summary = {"thickness": {}, "constant": {}, "knots": knots, "elements_along": elements[0],
               "versions": files.versions()}
    drawing, axes = figure(2)
    for model, style in (("membrane", "--"), ("solid", "-")):
        for part, cases, of, name in (("thickness", stretches, "h0", "h0_over_h"),
                                      ("constant", walls, "c", "C_over_C0")):
            for k, case in enumerate(cases):
                result = search(model, elements, knots, case if of == "h0" else case**-0.5, of)
                found = numbers(result, name)
                summary[part].setdefault(model, {})[f"{case:g}"] = found
                say(f"{part}, {model}, {case:g}: {result.paths} runs, spread {found['spread']:.2e}, "
                    + ", ".join(f"{v:.5f}" for v in found[name].values()))
                R = np.linspace(0, 1, 101)
                label = f"stretch of the pole {case:g}" if of == "h0" else f"wall {case:g} h0"
                axes[int(part == "constant")].plot(R, found[name]["0"] * relative(result.values["profile"], R), style,
                                              color=f"C{k}", label=label if model == "solid" else None)
    axes[0].set_ylabel("thickness of the sheet / even wall")
    axes[1].set_ylabel("constant C / C at the pole")
    for one in axes:
        one.set_xlabel("reference radius R / R$_0$")
        one.legend(title="solid (membrane: dashed)")
    save(drawing, args.out / "even_disc.png")
    summarise(args.out, summary)


if __name__ == "__main__":
    main()
