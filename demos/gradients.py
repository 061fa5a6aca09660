"""Derivatives of runs: exact ones of an inflated sheet, and of a cup beside differences of whole runs.

A round sheet of radius 1 and thickness 1/100, hinged at its rim, neo-Hookean, blown to a given height of its pole, as a
membrane and as a solid: derivatives by b of its constant C = c10 = 0.5 (1 + b R^2) or (1 + b R^4) and of its thickness
(1 + b R^2)/100, at b = 0, of the pressure p R0/(C(0) h0(0)) and of the wall over that at rest at R = 0 and 0.5.

The cup: a sheet of thickness 0.03 is blown into a cup, 0.7 deep, on which it sticks; C = 0.5 (1 + b (R^2 - 0.5)). When
a node touches moves with b: so the derivative of a run is not that of its steps as they were.
"""

import numpy as np
from common import parser, say, summarise

import formingx as fx
from formingx.results import files

THICKNESS, C = 0.01, 0.5
MODELS = {"membrane": fx.Membrane, "solid": fx.MixedPressure}
CONSTANTS = {"C_R2": lambda R: R**2, "C_R4": lambda R: R**4}
HEIGHTS = (0.8, 1.0)
RADII = np.arange(1, 10) / 10                                 # of the cup's sheet


def inflated(kind, model, height, elements):
    """A `build` of one case, a function of b."""
    def build(b):
        thickness = (lambda R: THICKNESS * (1 + b * R**2)) if kind == "h0_R2" else THICKNESS
        c10 = (lambda R, Z: C * (1 + b * CONSTANTS[kind](R))) if kind in CONSTANTS else C
        mesh = fx.mesh.disc(radius=1.0, thickness=thickness, elements=elements)
        scene = fx.Scene(mesh=mesh, materials=fx.NeoHookean(c10=c10), model=MODELS[model](),
                         supports=[fx.Symmetry("axis"), fx.SimplySupported("rim")], loads=[fx.Pressure("bottom")])
        return scene, fx.pole_height(height)
    return build


def ratios(path):
    """Wall over that at rest at R = 0 and 0.5."""
    profile = path.profile()
    return np.interp([0.0, 0.5], profile.reference_radius, profile.thickness_ratio)


def main():
    options = parser("gradients", __doc__.splitlines()[0])
    options.add_argument("--elements", type=int, default=80, help="along the radius of the inflated sheet")
    args = options.parse_args()
    elements = (20 if args.quick else args.elements, 1)
    summary = {}
    for kind in (*CONSTANTS, "h0_R2"):
        for model in MODELS:
            for height in HEIGHTS[: 1 if args.quick else 2]:
                run = fx.Design(inflated(kind, model, height, elements), {"b": (0.0, -1.0, 1.0)}).run()
                dp = run.derivative("pressure")[1].item() / (C * THICKNESS)
                pole, half = run.derivative(ratios)[1][:, 0].tolist()
                summary.setdefault(kind, {}).setdefault(model, {})[f"w_{height:g}"] = {
                    "dp": dp, "dpole": pole, "dhalf": half}
                say(f"{kind}, {model}, height {height:g}: dp {dp:.7f}, dpole {pole:.6f}, dhalf {half:.6f}")
    summarise(args.out, {**summary, "elements_along": elements[0], "versions": files.versions()})


if __name__ == "__main__":
    main()
