"""Compute derivatives of whole runs by perturbed runs, beside differences of separate runs.

Inflated sheet: radius 1, thickness 1/100, hinged at its rim, neo-Hookean, blown to a given pole height, as a membrane
and as a solid. The derivatives are by b at b = 0, of its constant C = c10 = 0.5 (1 + b R^2) or (1 + b R^4), or of its
thickness (1 + b R^2)/100. They are those of the pressure p R0/(C(0) h0(0)), and of the wall over its reference value at
R = 0 and 0.5.

Cup: a sheet of thickness 0.03 is blown into a cup, 0.7 deep, to which it sticks; C = 0.5 (1 + b (R^2 - 0.5)). The
time at which a node touches depends on b. So the derivative of a run is not its derivative with constant steps.
Differences of whole runs scatter by some 0.001, because the steps change with b.

Pot: a plug pushes a clamped sheet, with Coulomb friction, into a mould to which it sticks; air at a low pressure
follows. One sheet is elastic, one relaxes. The derivatives of the wall are by friction, travel and nose radius of the
plug, and by the constant of the sheet; those of the cup also by its fillet.
"""

import numpy as np
from common import parser, save, say, summarise

import formingx as fx
from formingx.figures import figure
from formingx.results import files

THICKNESS, C = 0.01, 0.5
MODELS = {"membrane": fx.Membrane, "solid": fx.MixedPressure}
CONSTANTS = {"C_R2": lambda R: R**2, "C_R4": lambda R: R**4}
HEIGHTS = (0.8, 1.0)
CUP_SHEET, POT_SHEET = 0.03, 0.1
RADII = np.arange(1, 10) / 10                                 # of the cup's sheet
POT = {"mu": 0.3, "travel": 2.3, "nose": 0.8, "c10": 1.0}
POT_RADII = (0.25, 0.75, 1.25, 1.75, 2.25, 2.75)


def inflated(kind, model, height, elements):
    """Return the function `build` of one case of the inflated sheet, a function of b."""
    def build(b):
        thickness = (lambda R: THICKNESS * (1 + b * R**2)) if kind == "h0_R2" else THICKNESS
        c10 = (lambda R, Z: C * (1 + b * CONSTANTS[kind](R))) if kind in CONSTANTS else C
        mesh = fx.mesh.disc(radius=1.0, thickness=thickness, elements=elements)
        scene = fx.Scene(mesh=mesh, materials=fx.NeoHookean(c10=c10), model=MODELS[model](),
                         supports=[fx.Symmetry("axis"), fx.SimplySupported("rim")], loads=[fx.Pressure("bottom")])
        return scene, fx.pole_height(height)
    return build


def cup(b, fillet, elements=(30, 1)):
    """Return the scene of a sheet that sticks to a cup, and its target.

    The sharp edge of the cup is a little above the edge of the hinged sheet: at no distance round-off would decide
    whether both stick together.
    """
    mesh = fx.mesh.disc(radius=1.0, thickness=CUP_SHEET, elements=elements)
    mould = fx.tools.cup(radius=1.0, depth=0.7, mouth=(1 + 1e-6) * CUP_SHEET, draft=10.0, fillet=fillet)
    scene = fx.Scene(mesh=mesh, materials=fx.NeoHookean(c10=lambda R, Z: C * (1 + b * (R**2 - 0.5))),
                     supports=[fx.Symmetry("axis"), fx.SimplySupported("rim")], loads=[fx.Pressure("bottom")],
                     contacts=[fx.Contact("top", mould, "stick")])
    return scene, fx.pressure(0.25)


def pot(mu, travel, nose, c10, relaxing=False, elements=(24, 1)):
    """Return the scene of a plug and a little air, and its stages."""
    mesh = fx.mesh.disc(radius=3.0, thickness=POT_SHEET, elements=elements)
    mould = fx.tools.cup(radius=3.0, depth=2.6, mouth=POT_SHEET, draft=8.0, fillet=0.6, lip=0.15)
    plug = fx.tools.male(radius=1.5, height=8.0, base=-8.0, draft=3.0, fillet=nose)
    sheet = fx.NeoHookean(c10=c10)
    if relaxing:
        sheet = fx.Viscoelastic(fx.NeoHookean(c10=0.5 * c10), branches=[(c10, 2.0)])
    scene = fx.Scene(mesh=mesh, materials=sheet, supports=[fx.Symmetry("axis"), fx.Clamped("rim")],
                     loads=[fx.Pressure("bottom", name="air")],
                     contacts=[fx.Contact("top", mould, "stick", separates=False, name="mould"),
                               fx.Contact("bottom", plug, mu, direction=(0, 1), name="plug")])
    return scene, [fx.Stage("plug", control="plug", until=fx.travel(travel), speed=4.0 if relaxing else None),
                   fx.Stage("air", control="air", until=fx.pressure(0.05), duration=0.5 if relaxing else None)]


def beside(design, values, name, step, radii, thickness):
    """Return d(wall/thickness)/d(parameter) at some reference radii: of one run, and by differences of whole runs."""
    run = design.run(values)
    R = run.profile.reference_radius
    exact = run.derivative("wall")[1][:, list(values).index(name)]
    above, below = (design.run({**values, name: values[name] + sign * step}).wall for sign in (1, -1))
    found = [np.interp(radii, R, d / thickness).tolist() for d in (exact, (above - below) / (2 * step))]
    return [{f"{R:g}": d for R, d in zip(radii, one)} for one in found]


def draw(exact, whole, step):
    """Return a figure of the derivative of the cup's wall by b."""
    drawing, axes = figure()
    axes.plot(RADII, list(exact.values()), "C0.-", label="derivative of one run")
    axes.plot(RADII, list(whole.values()), "ko", mfc="none", label=f"differences of runs, b = {step:g} and -{step:g}")
    axes.axhline(0, color="0.6", linewidth=0.8)
    axes.set(xlabel="reference radius R / R0", ylabel="d(wall / reference thickness) / db",
             title="wall of a stuck cup, C = 0.5 (1 + b (R² - 0.5))")
    axes.legend()
    return drawing


def ratios(path):
    """Return the wall over its reference value at R = 0 and 0.5."""
    profile = path.profile()
    return np.interp([0.0, 0.5], profile.reference_radius, profile.thickness_ratio)


def main():
    options = parser("gradients", __doc__)
    options.add_argument("--elements", type=int, default=80, help="elements along the radius of the inflated sheet")
    args = options.parse_args()
    elements = (10 if args.quick else args.elements, 1)
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
    step, along = 0.02, 15 if args.quick else 30
    design = fx.Design(lambda **values: cup(**values, elements=(along, 1)),
                       {"b": (0.0, -1.0, 1.0), "fillet": (0.2, 0.1, 0.4)})
    summary["fillet"] = dict(zip(("exact", "by_differences"), beside(
        design, {"b": 0.0, "fillet": 0.2}, "fillet", 0.01, RADII, CUP_SHEET)))
    exact, whole = beside(design, {"b": 0.0, "fillet": 0.2}, "b", step, RADII, CUP_SHEET)
    summary["cup"], summary["cup_by_differences"] = exact, whole
    for name, (a, b) in {"b": (exact, whole), "fillet": summary["fillet"].values()}.items():
        say(f"cup, by {name:7}" + ", ".join(f"{d:8.4f}" for d in a.values()),
            " differences  " + ", ".join(f"{d:8.4f}" for d in b.values()))
    save(draw(exact, whole, step), args.out / "cup.png")
    summary["pot"] = {}
    for sheet in () if args.quick else ("elastic", "relaxing"):
        design = fx.Design(lambda relaxing=sheet == "relaxing", **values: pot(**values, relaxing=relaxing), {
            name: (value, 0.5 * value, 2 * value) for name, value in POT.items()}, step=fx.StepControl(target=8))
        for name in POT:
            exact, whole = beside(design, POT, name, 0.01, POT_RADII, POT_SHEET)
            summary["pot"].setdefault(sheet, {})[name] = {"exact": exact, "by_differences": whole}
            say(f"pot, {sheet}, by {name:8}" + ", ".join(f"{d:8.4f}" for d in exact.values()),
                "   by differences      " + ", ".join(f"{d:8.4f}" for d in whole.values()))
    summarise(args.out, {**summary, "elements_along": elements[0], "versions": files.versions()})


if __name__ == "__main__":
    main()
