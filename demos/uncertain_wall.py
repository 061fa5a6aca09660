"""Compute the uncertainty of wall, pressure, force and volume of a cup from uncertain constants, beside 40 samples.

Gent's constants are fitted to Treloar's tests (`fx.fit`), with their covariance; the thickness of the sheet has a
standard deviation of 2 %, too. The sheet is blown into a cup, to which it sticks, to a volume of air. The band of one
run, by its derivatives, is compared with samples of the constants, each with a run of its own. Lengths over the radius
of the cup, stresses in MPa. With --quick, a coarser mesh.
"""

import numpy as np
from common import parser, save, say, summarise

import formingx as fx
from formingx import figures
from formingx.results import files

THICKNESS, SCATTER, VOLUME = 0.03, 0.02, 1.6
SAMPLES, SEED = 40, 1


def cup(mu, limit, thickness, elements):
    """Return the scene of a sheet that sticks to a cup, and the target of the run."""
    mould = fx.tools.cup(radius=1.0, depth=0.7, mouth=thickness, draft=10.0, fillet=0.3, lip=0.1)
    scene = fx.Scene(mesh=fx.mesh.disc(radius=1.1, thickness=thickness, elements=elements),
                     materials=fx.Gent(mu=mu, Jm=limit), loads=[fx.Pressure("bottom")],
                     supports=[fx.Symmetry("axis"), fx.SimplySupported("rim")],
                     contacts=[fx.Contact("top", mould, "stick", name="cup")])
    return scene, fx.enclosed_volume(VOLUME)


def main():
    options = parser("uncertain_wall", __doc__, elements=40)
    args = options.parse_args()
    elements = (20 if args.quick else args.elements, 1)
    found = fx.fit(fx.Gent, fx.treloar1944())
    given = [found, {"thickness": SCATTER * THICKNESS}]
    start = {**found.constants, "thickness": THICKNESS}
    design = fx.Design(lambda thickness, **gent: cup(*gent.values(), thickness, elements), start)
    run = design.run()
    columns = run.path.columns
    force = next(name for name in columns if name.endswith("force"))
    bands = {name: run.band(given, name) for name in ("wall", "pressure", force, "volume")}
    rng = np.random.default_rng(SEED)
    samples = np.column_stack([
        rng.multivariate_normal(list(found.constants.values()), found.covariance, SAMPLES),
        THICKNESS * (1 + SCATTER * rng.standard_normal(SAMPLES))])
    runs = [design.run(dict(zip(start, sample))) for sample in samples]
    summary = {"fitted": {"constants_MPa": found.constants, "errors_MPa": found.errors, "deviations": found.deviations},
               "samples": SAMPLES, "band": {}, "deviation_over_sampled": {}, "linear_misfit": {}}
    for name, band in bands.items():
        values = np.array([one.wall if name == "wall" else [one.volume] if name == "volume" else one.path[name][-1:]
                           for one in runs])
        linear = (samples - run.vector) @ run.derivative(name)[1].T
        remainder = values - band.value - linear
        sampled = values.std(axis=0, ddof=1)
        key = "force" if name == force else name
        summary["band"][key] = {"value": float(band.value.mean()), "deviation_percent": 100 * float(
            np.sqrt(np.mean(band.deviation**2)) / abs(band.value.mean()))}
        summary["deviation_over_sampled"][key] = float(np.sqrt(np.mean(band.deviation**2) / np.mean(sampled**2)))
        summary["linear_misfit"][key] = float(np.sqrt(np.mean(remainder**2) / np.mean((values - band.value) ** 2)))
        say(f"{key:10} {summary['band'][key]['value']:.5g} ± {summary['band'][key]['deviation_percent']:.2f} %,"
            f" over the deviation of the samples {summary['deviation_over_sampled'][key]:.3f}; the derivatives leave"
            f" {100 * summary['linear_misfit'][key]:.1f} % of the samples' changes")
        if name == "wall":
            inside = np.mean((values > band.low) & (values < band.high))
            summary["walls_inside_the_95_percent_band"] = float(inside)
            figure, axes = figures.figure(1, width=7)
            for k, one in enumerate(runs):
                axes.plot(run.profile.reference_length, one.wall, color="0.6", lw=0.4,
                          label=None if k else f"{SAMPLES} samples")
            band.plot(axes, color="C0", label="wall of the run")
            for edge in (band.low, band.high):
                axes.plot(band.coordinates, edge, "C0--", lw=1)
            axes.set(xlabel="reference length / radius of the cup", ylabel="wall / radius of the cup")
            axes.legend()
            save(figure, args.out / "uncertain_wall.png")
    run.report(args.out / "report.html", "A cup of uncertain constants", deviations=given)
    summarise(args.out, summary | {"versions": files.versions()})


if __name__ == "__main__":
    main()
