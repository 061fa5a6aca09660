"""Inflate hinged discs whose stiffness varies with the radius, c10 = C(R), against membrane theory.

Cool rim: C/C0 = 1 + 3 R^2; step: 1 + 2 (1 + tanh((R - 0.7)/0.1)); hot rim: 1 - 0.5 R^2, R over r0; r0/h0 = 100, as a
membrane and as a solid. At given pole stretches the pressure p r0/(C0 h0), the pole height w/r0 and thickness ratios
are compared with membrane theory (formingx.exact.inflation.membrane_inflation: an ordinary differential equation).
"""

import numpy as np
from common import parser, save, say, summarise
from scipy.interpolate import CubicSpline

import formingx as fx
from formingx import figures
from formingx.exact.inflation import membrane_inflation
from formingx.results import files

THICKNESS = 0.01                                  # over the radius; C0 = 1
CASES = {"cool_rim": lambda R: 1 + 3 * R**2,
         "step": lambda R: 1 + 2 * (1 + np.tanh((R - 0.7) / 0.1)),
         "hot_rim": lambda R: 1 - 0.5 * R**2}
STRETCHES, PLACES = ("1.25", "1.5", "2", "3"), ("0", "0.25", "0.5", "0.75", "0.9", "1")
MODELS = {"membrane": fx.Membrane(), "solid": fx.MixedPressure()}
# a solid has a boundary layer of about one thickness at the hinge; nodes lie at the evaluated radii
ELEMENTS = {"membrane": (200, 1), "solid": (120, 2)}
FINE = {"membrane": {float(x): 1.0 for x in PLACES}, "solid": {float(x): 1.0 for x in PLACES[:-1]} | {1.0: 0.05}}


def inflate(model, modulus, elements=None):
    """Return the path to the largest pole stretch."""
    mesh = fx.mesh.disc(radius=1.0, thickness=THICKNESS, elements=elements or ELEMENTS[model],
                        concentrate=FINE[model])
    scene = fx.Scene(mesh=mesh, materials=fx.NeoHookean(c10=lambda R, Z: modulus(R)), loads=[fx.Pressure("bottom")],
                     supports=[fx.Symmetry("axis"), fx.SimplySupported("rim")], model=MODELS[model])
    *through, last = (fx.pole_stretch(float(s)) for s in STRETCHES)
    return fx.trace(scene, until=last, intermediate=through, progress=False)


def key_numbers(path, modulus):
    """Return {pole stretch: {name: number}} of a path."""
    found = {}
    for stretch in STRETCHES:
        state = path.target_state(fx.pole_stretch(float(stretch)))
        profile = path.profile(state)
        found[stretch] = {
            "p_R0_over_C0_h0": state.measures["pressure"] / (modulus(0.0) * THICKNESS),
            "w_over_R0": state.measures["pole_height"],
            "thickness_ratio_at_R": {R: profile.thickness_ratio_at(float(R)) for R in PLACES}}
    return found


def theory(modulus):
    """Return the numbers of `key_numbers` by membrane theory."""
    found = {}
    for stretch in STRETCHES:
        exact = membrane_inflation(float(stretch), radius=1.0, thickness=THICKNESS, c10=modulus)
        ratios = CubicSpline(exact.R, exact.thickness_ratio)([float(R) for R in PLACES])
        found[stretch] = {"p_R0_over_C0_h0": exact.pressure / (modulus(0.0) * THICKNESS), "w_over_R0": exact.height,
                          "thickness_ratio_at_R": dict(zip(PLACES, map(float, ratios)))}
    return found


def largest_errors(found, exact):
    """Return {name: largest relative difference over the stretches}; the thickness at R = 1 has a key of its own."""
    errors = dict.fromkeys(("p_R0_over_C0_h0", "w_over_R0", "thickness", "thickness_at_1"), 0.0)
    for stretch in STRETCHES:
        a, b = found[stretch], exact[stretch]
        for name in ("p_R0_over_C0_h0", "w_over_R0"):
            errors[name] = max(errors[name], abs(a[name] / b[name] - 1))
        for R in PLACES:
            name = "thickness_at_1" if R == "1" else "thickness"
            off = abs(a["thickness_ratio_at_R"][R] / b["thickness_ratio_at_R"][R] - 1)
            errors[name] = max(errors[name], off)
    return errors


def draw(paths, file):
    """Draw modulus, loading curves, and the wall at the largest stretch: solids as lines, membranes dashed."""
    figure, (left, middle, right) = figures.figure(3, width=4.2)
    R = np.linspace(0, 1, 200)
    for k, (case, modulus) in enumerate(CASES.items()):
        left.plot(R, modulus(R), color=f"C{k}", label=case.replace("_", " "))
        for model, style in (("solid", "-"), ("membrane", "k:")):
            path = paths[model, case]
            stretch, pressure = path.curve("pole_stretch", "pressure")
            middle.plot(stretch, pressure / THICKNESS, style, **({"color": f"C{k}"} if model == "solid" else {}))
            profile = path.profile()
            right.plot(profile.reference_radius, profile.thickness_ratio, style,
                       **({"color": f"C{k}"} if model == "solid" else {}))
    left.set(xlabel="R/r$_0$", ylabel="C/C$_0$", ylim=(0, None), title="modulus")
    middle.set(xlabel="stretch at the pole", ylabel="p r$_0$/(C$_0$ h$_0$)", ylim=(0, None), title="loading curve")
    right.set(xlabel="R/r$_0$", ylabel="thickness/original", ylim=(0, 1.02), title=f"pole stretch {STRETCHES[-1]}")
    left.legend(frameon=False)
    right.plot([], [], "k-", label="solid")
    right.plot([], [], "k:", label="membrane")
    right.legend(frameon=False)
    save(figure, file)


def main():
    args = parser("heated_disc", __doc__).parse_args()
    quick = {"membrane": (40, 1), "solid": (40, 1)} if args.quick else ELEMENTS
    exact = {case: theory(modulus) for case, modulus in CASES.items()}
    summary, errors, paths = {}, {}, {}
    for model in MODELS:
        summary[model], errors[model] = {}, {}
        for case, modulus in CASES.items():
            path = paths[model, case] = inflate(model, modulus, quick[model])
            found = summary[model][case] = key_numbers(path, modulus)
            off = errors[model][case] = largest_errors(found, exact[case])
            say(f"{model}, {case.replace('_', ' ')}: {len(path)} states, {path.counts.seconds:.1f} s; p r0/(C0 h0) "
                + ", ".join(f"{found[s]['p_R0_over_C0_h0']:.5f} at {s}" for s in STRETCHES),
                "  off membrane theory at most: " + ", ".join(f"{name} {e:.1e}" for name, e in off.items()))
    draw(paths, args.out / "heated_disc.png")
    summarise(args.out, {**summary, "membrane_theory": exact, "largest_difference_from_theory": errors,
                         "elements": quick, "versions": files.versions()})


if __name__ == "__main__":
    main()
