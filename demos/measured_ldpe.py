"""Predict the extension of a low-density polyethylene melt at two rates from a test at a third.

The relaxation spectrum comes from the moduli of small oscillations, the damping from the start-up of uniaxial extension
at 0.1/s (LDPE Dow 150R at 160 C; sources in demos/data). Predicted are extension at 0.03 and 0.3/s, homogeneous and in
a scene of one element, and the start-up of shear. All stresses are true stresses; in extension the tensile stress minus
the lateral one, over the Hencky strain.
"""

from pathlib import Path

import numpy as np
from common import parser, save, say, summarise
from relaxing import at_time, times

import formingx as fx
from formingx import figures
from formingx.io.csv_files import records
from formingx.results import files

DATA = Path(__file__).parent / "data"
FITTED, PREDICTED = 0.1, (0.03, 0.3)                                        # Hencky rates, 1/s
STRAINS = (0.25, 0.5, 1, 1.5, 2, 2.5)                                       # Hencky
RANGE = (0.15, 2.8)                                                         # Hencky strains that count in the fit
SHEAR_RATES = (0.03, 0.1, 0.3, 1.0)                                         # 1/s
DAMPINGS = {"PSM": fx.PSM(alpha=10.0, beta=0.1), "Wagner": fx.Wagner(alpha=0.1, beta=0.3),
            "Soskey-Winter": fx.SoskeyWinter(alpha=0.1, a=0.3, b=1.5)}
SOURCE = "github.com/jorge-ramirez-upm/RepTate, folder data/DOW, commit 4aeb671f"


def table(name):
    """Return the columns of a table of measured numbers."""
    return np.array([row for _, row in records(DATA / name)[1:]], float).T


def extension(card, rate, strains):
    """Return the true tensile stress at Hencky strains, Pa."""
    stretches = np.exp(strains)
    return card.constant_rate("uniaxial", rate, stretches) * stretches


def scene_extension(card, rate, accuracy):
    """Return the true tensile stress at `STRAINS` in a block of one element whose top is pulled, Pa."""
    scene = fx.Scene(mesh=fx.mesh.disc(radius=1.0, thickness=1.0, elements=(1, 1)), materials=card,
                     supports=[fx.Symmetry("axis"), fx.Symmetry("bottom", normal="z"),
                               fx.PrescribedDisplacement("top", "z", name="pull")])
    at = [strain / rate for strain in STRAINS]
    stage = fx.Stage("pull", control="pull", amplitudes={fx.travel: lambda t: np.expm1(rate * t)},
                     until=fx.process_time(at[-1]), intermediate=times(0.0, at[:-1]))
    path = fx.Process(scene).run([stage], accuracy=accuracy, progress=False)
    sigma = [path.stress(at_time(path, "pull", t)).at_quadrature_points().cauchy.mean(axis=0) for t in at]
    return np.array([s[1, 1] - s[0, 0] for s in sigma])


def separable(spectrum, strains, stress, rate):
    """Return the stress at another rate by time-strain separability alone, without a form of the damping, Pa.

    With a stress G(t) H(strain) after a step of strain, the stress of start-up at a rate r is the integral of G(e/r)
    H'(e) over the strain e. So ds_r/de = G(e/r)/G(e/r0) ds_0/de, with s_0 measured at r0.
    """
    def modulus(t):
        return sum(G * np.exp(-t / tau) for G, tau in spectrum)

    def linear(e):
        return sum(3 * FITTED * G * tau * -np.expm1(-e / FITTED / tau) for G, tau in spectrum)
    inside = (strains > RANGE[0]) & (strains < RANGE[1])
    fine = np.linspace(0, strains[inside][-1], 4001)
    over = np.interp(fine, np.append(0, strains[inside]), np.append(1, (stress / linear(strains))[inside]))
    middle = (fine[1:] + fine[:-1]) / 2
    share = modulus(middle / rate) / modulus(middle / FITTED)
    return np.interp(STRAINS, fine, np.append(0, np.cumsum(share * np.diff(linear(fine) * over))))


def keyed(values):
    return {f"{x:g}": float(v) for x, v in zip(STRAINS, values)}


def main():
    args = parser("measured_ldpe", __doc__).parse_args()
    omega, storage, loss = table("ldpe_dow150r_160C_oscillation.csv")
    t, measured = table("ldpe_dow150r_160C_extension_0.1.csv")
    strains = FITTED * t
    spectrum = fx.fit_spectrum(omega, storage, loss)
    test = fx.TimedTest.constant_rate("uniaxial", FITTED, np.exp(strains), measured / np.exp(strains))
    fits = {name: fx.fit(fx.KBKZ(spectrum.pairs, damping), [test], within=tuple(np.exp(RANGE)))
            for name, damping in DAMPINGS.items() if not args.quick or name == "Soskey-Winter"}
    deviation = {name: 100 * found.deviations["1 uniaxial"] for name, found in fits.items()}
    best = min(deviation, key=deviation.get)
    card = fits[best].material
    summary = {
        "source": SOURCE,
        "quantity": "true tensile stress minus lateral stress, Pa, over Hencky strain",
        "fitted": {"spectrum_Pa_s": spectrum.pairs, "spectrum_deviation_percent": 100 * spectrum.deviation,
                   "damping": best, "constants": fits[best].constants, "undetermined": fits[best].undetermined,
                   "range_of_Hencky_strain": RANGE,
                   "other_dampings": {name: found.constants for name, found in fits.items() if name != best}},
        "deviation_percent": {"at_the_fitted_rate_rms": deviation},
        "predicted": {}, "stress_Pa": {}, "scene_stress_Pa": {}}
    inside = (strains > RANGE[0]) & (strains < RANGE[1])
    off = extension(card, FITTED, strains[inside]) / measured[inside] - 1
    summary["deviation_percent"]["at_the_fitted_rate_largest"] = 100 * float(np.abs(off).max())
    spread, between = {}, []
    for rate in PREDICTED:
        key = f"rate_{rate:g}"
        found = {name: extension(f.material, rate, STRAINS) for name, f in fits.items()}
        found["separability alone"] = separable(spectrum.pairs, strains, measured, rate)
        spread[key] = {name: keyed(values) for name, values in found.items() if name != best}
        summary["stress_Pa"][key] = keyed(found[best])
        scene = scene_extension(card, rate, 5e-3 if args.quick else 1e-3)
        summary["scene_stress_Pa"][key] = keyed(scene)
        between.append(np.abs(scene / found[best] - 1).max())
        say(f"{rate:g}/s, Hencky strains {', '.join(f'{x:g}' for x in STRAINS)}",
            *(f"  {name:20}" + "".join(f"{v:9.0f}" for v in values) for name, values in found.items()),
            f"  {'scene':20}" + "".join(f"{v:9.0f}" for v in scene))
    summary["predicted"]["other_dampings_Pa"] = spread
    summary["deviation_percent"]["scene_from_homogeneous"] = 100 * float(max(between))
    shear_times = np.geomspace(0.1, 300, 40)
    shear = {f"rate_{rate:g}": card.shear(rate, shear_times) for rate in SHEAR_RATES}
    oscillation = np.interp(SHEAR_RATES, omega, np.hypot(storage, loss) / omega)
    summary["predicted"]["shear"] = {
        "times_s": shear_times.tolist(),
        "viscosity_Pa_s": {k: (s / float(k[5:])).tolist() for k, s in shear.items()},
        "overshoot": {k: float(s.max() / s[-1]) for k, s in shear.items()}}
    # Cox and Merz's rule: steady shear viscosity at a rate is about the complex one at this frequency
    summary["deviation_percent"]["steady_shear_from_complex_viscosity"] = {
        k: 100 * float(s[-1] / float(k[5:]) / eta - 1) for (k, s), eta in zip(shear.items(), oscillation)}
    summary["limits"] = (
        "Stresses below a Hencky strain of 0.15 (start of the machine) and the last point (a strain of 3.07, where the"
        " stress falls: necking or rupture) do not count. One rate of uniaxial extension fixes the damping of this"
        " mode alone: of the share alpha of I1 little, of equibiaxial extension nothing. The prediction rests on"
        " time-strain separability.")
    say(f"spectrum: {len(spectrum.pairs)} times, {100 * spectrum.deviation:.2f} % of the moduli",
        *(f"{name}: {value:.1f} % at 0.1/s: {fits[name].constants}" for name, value in deviation.items()))
    picture(args.out, omega, storage, loss, spectrum, strains, measured, card, shear_times, shear)
    summarise(args.out, summary | {"versions": files.versions()})


def picture(out, omega, storage, loss, spectrum, strains, measured, card, shear_times, shear):
    """Draw moduli, extension and shear."""
    figure, (left, middle, right) = figures.figure(3, width=4.2)
    x = omega[:, None] * np.array([tau for _, tau in spectrum.pairs])
    G = np.array([G for G, _ in spectrum.pairs])
    for values, computed, label in ((storage, (G * x**2 / (1 + x**2)).sum(1), "G'"), (
            loss, (G * x / (1 + x**2)).sum(1), "G''")):
        points, = left.loglog(omega, values, ".", ms=3, label=label)
        left.loglog(omega, computed, color=points.get_color(), lw=1)
    left.set(xlabel="frequency, 1/s", ylabel="modulus, Pa", title="spectrum")
    fine = np.linspace(0.02, 2.7, 80)
    middle.semilogy(strains, measured, "ko", ms=3, label="measured, 0.1/s")
    for rate, style in ((PREDICTED[0], "--"), (FITTED, "-"), (PREDICTED[1], ":")):
        word = "fitted" if rate == FITTED else "predicted"
        middle.semilogy(fine, extension(card, rate, fine), style, label=f"{rate:g}/s, {word}")
    middle.set(xlabel="Hencky strain", ylabel="true stress, Pa", title="uniaxial extension")
    for key, s in shear.items():
        right.loglog(shear_times, s / float(key[5:]), label=f"{key[5:]}/s")
    right.set(xlabel="time, s", ylabel="viscosity, Pa s", title="shear, predicted")
    for axes in (left, middle, right):
        axes.legend(frameon=False)
    save(figure, out / "measured_ldpe.png")


if __name__ == "__main__":
    main()
