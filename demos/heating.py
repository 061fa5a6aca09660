"""Heat a sheet by hot air, between radiant heaters, and by radiation that is absorbed in its depth.

The sheet is 3 mm thick and at 25 C at first. Each temperature is compared with a solution without finite elements
(formingx/exact/heat.py): a series, or finite volumes if the faces radiate. SI units, temperatures in C; x counts from
the bottom face.
"""

import numpy as np
from common import parser, summarise
from slab import SHEET, at_times, draw, print_errors, same_slab, slab

import formingx as fx
from formingx.exact import heat as reference
from formingx.extensions.heat.boundaries import STEFAN_BOLTZMANN
from formingx.results import files

THICKNESS, START = 3e-3, 25.0
AIR_TIMES, HEATER_TIMES = (5, 10, 20, 40, 80, 160), (10, 20, 40, 60, 80, 100)
EMISSIVITY, H, AIR = 0.85, 8.0, 60.0                                # between the heaters
FLUX, KAPPA = 8000.0, 1500.0                                        # W/m2 into each side, 1/m


def run(mesh, boundaries, times, tolerance):
    """Return the run of the heated sheet."""
    return fx.heat(mesh, SHEET, boundaries, start=START, times=times, unit="C", tolerance=tolerance)


def along(heated, places):
    """Return the temperatures at shares of the thickness from the bottom, shape (times, places)."""
    return heated.at_points([(0.0, THICKNESS * x) for x in places])


def by_air(mesh, sides, tolerance):
    """Return the run with convection, and its exact solution at places; sides: (h, air) of bottom and top."""
    heated = run(mesh, [fx.Convection(face, h=h, air=air) for face, (h, air) in zip(("bottom", "top"), sides)],
                 AIR_TIMES, tolerance)
    h, air = zip(*sides)
    return heated, lambda x: reference.series(same_slab(THICKNESS), START, h, air, THICKNESS * np.asarray(x), AIR_TIMES)


def by_heaters(mesh, top, bottom, tolerance):
    """Return the run between heaters at temperatures `top` and `bottom`, and its exact solution."""
    faces = (("bottom", bottom), ("top", top))
    heated = run(mesh, [law for face, heater in faces for law in (
        fx.Radiation(face, emissivity=EMISSIVITY, heater=heater), fx.Convection(face, h=H, air=AIR))],
        HEATER_TIMES, tolerance)
    fluxes = [lambda T, heater=heater: EMISSIVITY * STEFAN_BOLTZMANN * ((heater + 273.15) ** 4 - (T + 273.15) ** 4)
              + H * (AIR - T) for _, heater in faces]

    def exact(places):
        x, T = reference.method_of_lines(same_slab(THICKNESS), START, fluxes, HEATER_TIMES)
        return T[:, [int(np.argmin(np.abs(x - THICKNESS * place))) for place in places]]
    return heated, exact


def by_absorption(mesh, tolerance):
    """Return the run of a semi-transparent sheet in a beam from each side, and its exact solution."""
    heated = run(mesh, [law for face in ("bottom", "top") for law in (
        fx.Absorption(face, flux=FLUX, coefficient=KAPPA), fx.Convection(face, h=H, air=AIR))],
        HEATER_TIMES, tolerance)
    return heated, lambda x: reference.series(
        same_slab(THICKNESS), START, (H, H), (AIR, AIR), THICKNESS * np.asarray(x), HEATER_TIMES,
        lambda x: FLUX * KAPPA * (np.exp(-KAPPA * x) + np.exp(-KAPPA * (THICKNESS - x))))


def main():
    args = parser("heating", __doc__).parse_args()
    mesh, tolerance = slab(THICKNESS, 8 if args.quick else 20), 1e-3 if args.quick else 5e-5
    faces = {"top": 1.0, "mid": 0.5, "bottom": 0.0}
    cases = {
        "convection": (by_air(mesh, ((40.0, 200.0),) * 2, tolerance), {"mid": 0.5, "quarter": 0.25, "face": 0.0}),
        "two_sides": (by_air(mesh, ((60.0, 220.0), (10.0, 80.0)), tolerance),
                      {f"{x:g}": x for x in (0, 0.25, 0.5, 0.75, 1)}),
        "radiation_400_400": (by_heaters(mesh, 400.0, 400.0, tolerance), faces),
        "radiation_450_350": (by_heaters(mesh, 450.0, 350.0, tolerance), faces),
        "absorbed": (by_absorption(mesh, tolerance), {"face": 0.0, "mid": 0.5}),
    }
    summary, errors, dots = {}, {}, {}
    for name, ((heated, exact), places) in cases.items():
        names, found, right = list(places), along(heated, places.values()), exact(list(places.values()))
        dots[name] = (1e3 * THICKNESS * np.array(list(places.values())), right)
        if name == "convection":
            s, weights = np.polynomial.legendre.leggauss(20)
            names, found = [*names, "mean"], np.column_stack([found, heated.line_mean()])
            right = np.column_stack([right, exact((s + 1) / 2) @ weights / 2])
        # from the initial to the steady temperature, or to the highest one
        span = {"convection": 175.0, "two_sides": 195.0}.get(name, right.max() - START)
        errors[name] = print_errors(name, names, heated.outputs, found, right, span, heated)
        summary[name] = at_times(names, heated.outputs, found)
        heated.to_csv(args.out / f"{name}.csv")
    draw({name: heated for name, ((heated, _), _) in cases.items()}, args.out / "through_the_thickness.png", 3,
         lambda axes, name, _: axes.plot(dots[name][0], dots[name][1].T, "k.", markersize=4))
    window = cases["radiation_400_400"][0][0].time_to_reach(110.0, 150.0)
    summarise(args.out, {**summary, "largest_error_over_span": errors,
                         "radiation_400_400_whole_sheet_between_110_and_150_C_s": list(window),
                         "versions": files.versions()})


if __name__ == "__main__":
    main()
