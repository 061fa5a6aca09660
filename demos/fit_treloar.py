"""Fit the constants of every material to Treloar's (1944) tests of vulcanised rubber.

Uniaxial, pure-shear and equibiaxial tension are fitted together, by least squares of the nominal stress (MPa), every
point with the same weight (`measured_treloar.py` compares this with relative misfits). The points were digitised from
Treloar's published curves. With --quick, Ogden's law has one term instead of three.
"""

import numpy as np
import ufl
from common import parser, save, say, summarise

import formingx as fx

TITLES = {"uniaxial": "uniaxial tension", "pure_shear": "pure shear (planar tension)",
          "equibiaxial": "equibiaxial tension"}


def gent_gent(I1, I2, mu, Jm, c2):
    """Return Gent's energy with a term in I2 (Pucci, Saccomandi 2002); the root ends it at its limit."""
    return -mu * Jm * ufl.ln(ufl.sqrt(1 - (I1 - 3) / Jm)) + c2 * ufl.ln(I2 / 3)


def fits(quick):
    """Return {name: Fit} of every material."""
    data, terms = fx.treloar1944(), 1 if quick else 3
    models = {"neo-Hookean": fx.NeoHookean, "Mooney-Rivlin": fx.MooneyRivlin, "Yeoh": fx.Yeoh, "Gent": fx.Gent,
              "Arruda-Boyce": fx.ArrudaBoyce, "own: Gent-Gent": fx.Hyperelastic(gent_gent, mu=0.3, Jm=100.0, c2=0.05)}
    found = {name: fx.fit(model, data, relative=False) for name, model in models.items()}
    ogden = fx.fit(fx.Ogden, data, terms=terms, relative=False)
    return found | {f"Ogden, {terms} term{'s' * (terms > 1)}": ogden}


def constants(material):
    """Return the constants in a line, with four digits; a constant that is zero to round-off is 0."""
    values = material.parameters
    largest = max(map(abs, values.values()))
    return ", ".join(f"{k} {v if abs(v) > 1e-12 * largest else 0:.4g}" for k, v in values.items())


def table(found):
    """Return lines of constants and residuals, and of the range of stability within the data."""
    lines = [f"{'':16}{'rms of nominal stress, MPa':>41}", f"{'':16}{'all':>8}{'uniaxial':>10}{'pure shear':>12}"
             f"{'equibiaxial':>13}  constants (stresses in MPa)"]
    for name, result in found.items():
        rms = result.rms
        lines.append(f"{name:16}{result.rms_total:8.3f}{rms['uniaxial']:10.3f}{rms['pure_shear']:12.3f}"
                     f"{rms['equibiaxial']:13.3f}  {constants(result.material)}")
    lines.append("")
    for name, result in found.items():
        lines.append(f"{name:16}{result.material.check_stability((0.5, 7.6))}")
    return lines


def picture(found):
    """Return a figure of data and curves, a panel for each test."""
    import matplotlib.pyplot as plt
    data = fx.treloar1944()
    figure, panels = plt.subplots(1, 3, figsize=(13, 6), layout="constrained")
    colours = plt.get_cmap("tab10").colors[: len(found)]
    styles = ["-", (0, (6, 4)), "-", "-", (0, (5, 2)), (0, (1, 1)), "-"]
    for axes, (mode, (stretch, stress)) in zip(panels, data.items(), strict=True):
        for (name, result), colour, style in zip(found.items(), colours, styles, strict=True):
            material = result.material
            reach = min(1.04 * stretch.max(), 0.9999 * material.largest_stretch(mode))
            l = np.linspace(1, reach, 400)
            axes.plot(l, material.stress(mode, l), color=colour, linestyle=style, linewidth=1.8,
                      label=f"{name} ({result.rms_total:.3f})")
        axes.plot(stretch, stress, "o", color="black", markerfacecolor="white", markersize=6, zorder=5,
                  label="Treloar 1944 (digitised)")
        axes.set(title=TITLES[mode], xlabel="stretch", xlim=(1, None), ylim=(0, 1.12 * stress.max()))
        axes.grid(alpha=0.3)
    panels[0].set_ylabel("nominal stress, MPa")
    figure.suptitle("One set of constants for three tests: Treloar's vulcanised rubber")
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=4, frameon=False,
                  title="model (rms residual over all points, MPa)")
    return figure


def main():
    options = parser("fit_treloar", __doc__).parse_args()
    found = fits(options.quick)
    say(*table(found))
    save(picture(found), options.out / "fit_treloar.png")
    summarise(options.out, {
        "data": "Treloar 1944, vulcanised rubber, digitised; nominal stress in MPa; unweighted joint least squares",
        "points": {mode: len(stretch) for mode, (stretch, _) in fx.treloar1944().items()},
        "fits": {name: {
            "constants_MPa": dict(result.material.parameters),
            "rms_MPa": result.rms_total,
            "rms_by_test_MPa": result.rms,
            "shear_modulus_MPa": result.material.shear_modulus,
            "stable_0.5_to_7.6": result.material.check_stability((0.5, 7.6)).stable,
        } for name, result in found.items()},
    })


if __name__ == "__main__":
    main()
