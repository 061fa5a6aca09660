"""Predict the pressure of Treloar's inflated sheet from his tests of rubber, by every law, fitted in two ways.

Each law is fitted to the uniaxial, pure-shear and equibiaxial tests of 1944 together (`fx.treloar1944`), by misfits
relative to the stress (the default) and by absolute ones. The limit pressure of his sheet, simply supported, is
compared with the pressure that follows from the equibiaxial test: p = 2 h0 P/(R lambda), its first maximum over the
measured points, with R the radius of the hole. This is the pressure in a hemispherical cap; the other value in the
summary belongs to a cap of one stretch. With --quick, Mooney-Rivlin and Ogden alone.
"""

import numpy as np
from common import parser, save, say, summarise

import formingx as fx
from formingx import figures
from formingx.materials.inflation import FreeInflation
from formingx.results import files

RADIUS, THICKNESS = 1.25, 0.082                                             # cm
MPA = 1 / 0.0980665                                                         # kg/cm2 in an MPa
LAWS = {"neo-Hookean": fx.NeoHookean, "Mooney-Rivlin": fx.MooneyRivlin, "Yeoh": fx.Yeoh, "Gent": fx.Gent,
        "Arruda-Boyce": fx.ArrudaBoyce, "Ogden": fx.Ogden}
QUICK = ("Mooney-Rivlin", "Ogden")
WAYS = {"relative": True, "absolute": False}


def limit(material, elements):
    """Return the largest pressure of the sheet up to a pole stretch of 4, kg/cm2: at a limit point, or None."""
    scene = fx.Scene(mesh=fx.mesh.disc(radius=RADIUS, thickness=THICKNESS, elements=(elements, 1)), materials=material,
                     supports=[fx.Symmetry("axis"), fx.SimplySupported("rim")], loads=[fx.Pressure("bottom")])
    path = fx.trace(scene, until=fx.pole_stretch(min(4.0, 0.9 * material.largest_stretch("equibiaxial"))),
                    progress=False)
    return float(path.limit_points[0].measures["pressure"] * MPA) if path.limit_points else None


def first_maximum(values):
    """Return the first value that is larger than the one before and not smaller than the next."""
    k = np.flatnonzero((values[1:-1] > values[:-2]) & (values[1:-1] >= values[2:]))[0] + 1
    return float(values[k])


def measured():
    """Return {estimate: limit pressure from the equibiaxial test, kg/cm2}."""
    l, P = fx.treloar1944()["equibiaxial"]
    rows = l > 1.15                                                         # at small stretches the points scatter
    l, P = l[rows], P[rows] * MPA
    return {"hemisphere": first_maximum(2 * THICKNESS * P / (RADIUS * l)),
            "cap_of_one_stretch": first_maximum(4 * np.sqrt(l**2 - 1) * P * THICKNESS / (RADIUS * l**3))}


def main():
    options = parser("measured_treloar", __doc__, elements=20)
    args = options.parse_args()
    data, found = fx.treloar1944(), measured()
    names = QUICK if args.quick else list(LAWS)
    fits = {way: {name: fx.fit(LAWS[name], data, relative=relative) for name in names}
            for way, relative in WAYS.items()}
    limits = {way: {name: limit(f.material, 10 if args.quick else args.elements) for name, f in each.items()}
              for way, each in fits.items()}
    off = {way: {name: None if p is None else 100 * (p / found["hemisphere"] - 1) for name, p in each.items()}
           for way, each in limits.items()}
    say(f"limit pressure, kg/cm2; from the equibiaxial test {found['hemisphere']:.3f} (hemisphere),"
        f" {found['cap_of_one_stretch']:.3f} (cap of one stretch)",
        f"{'':16}{'relative':>10}{'':>9}{'absolute':>10}")
    for name in names:
        say(f"{name:16}" + "".join(f"{'none':>19}" if limits[way][name] is None else
                                   f"{limits[way][name]:10.3f}{off[way][name]:+7.1f} %" for way in WAYS))
    alone = fx.fit(fx.Ogden, {"uniaxial": data["uniaxial"]})
    l, P = data["equibiaxial"]
    one_test = {"equibiaxial_MPa_at_stretch_2": float(alone.material.stress("equibiaxial", 2.0)),
                "measured_MPa_at_stretch_2": float(np.interp(2.0, l, P)), "undetermined": alone.undetermined}
    say(f"Ogden by the uniaxial test alone: {one_test['equibiaxial_MPa_at_stretch_2']:.3g} MPa at an equibiaxial"
        f" stretch of 2, measured {one_test['measured_MPa_at_stretch_2']:.3g}; open: {', '.join(alone.undetermined)}")
    picture(args.out, fits, data)
    summarise(args.out, {
        "source": "L. R. G. Treloar, Trans. Faraday Soc. 40 (1944) 59-70, digitised",
        "fitted": {way: {name: {"constants_MPa": f.constants, "rms_relative": f.deviations,
                                "undetermined": f.undetermined} for name, f in each.items()}
                   for way, each in fits.items()},
        "measured": {"limit_pressure_kg_per_cm2": found},
        "predicted": {"limit_pressure_kg_per_cm2": limits, "ogden_by_the_uniaxial_test_alone": one_test},
        "deviation_percent": off,
        "limits": "The sheet is another piece of rubber than that of the three tests may have been: the measured"
                  " pressure is that of the equibiaxial test in membrane theory. A hinged sheet is no hemisphere: the"
                  " two estimates differ by what the shape leaves open.",
        "versions": files.versions()})


def picture(out, fits, data):
    """Draw the pressure of a cap of one stretch over the stretch, from the test and from the laws."""
    figure, axes = figures.figure(2, width=5)
    l, P = data["equibiaxial"]
    for ax, (way, each) in zip(axes, fits.items()):
        ax.plot(l, 4 * np.sqrt(l**2 - 1) * P * MPA * THICKNESS / (RADIUS * l**3), "ko", ms=4, label="equibiaxial test")
        for name, f in each.items():
            fine = np.linspace(1.001, min(4.4, 0.98 * f.material.largest_stretch("equibiaxial")), 300)
            ax.plot(fine, MPA * FreeInflation([(f.material, THICKNESS)], RADIUS).disc(fine), label=name)
        ax.set(xlabel="stretch", ylabel="pressure of a cap, kg/cm$^2$", title=f"{way} misfits", ylim=(0, 0.8))
    axes[0].legend(frameon=False, fontsize="small")
    save(figure, out / "measured_treloar.png")


if __name__ == "__main__":
    main()
