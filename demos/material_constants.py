"""Vary material constants and aspect ratio of free inflation (Song 1993, section 4.4, figs. 4.9 to 4.13).

Mooney sheets, simply supported; inches and psi. Table 4.2 gives C10 as the I1 constant and C01 as the I2 constant. For
the plates A and B of the same section it is the other way round: their C01 is the I1 constant, otherwise A would not be
the softer one. Below, c10 always belongs to I1. The pole height is that of the mid-thickness point; K = 6 (c10 + c01).

Plate A cannot carry the 26 psi at which the thesis has 9 in. Its maximum is 25.065 psi on any mesh from 10 x 1 to
80 x 4, and 25.05 to 25.07 psi on 10 x 1 with the thesis' penalty (eps 2e-2 to 8e-2). Only a clamped rim on 10 x 1
elements carries 26 psi (26.3 at most; 25.8 on finer meshes).

Case 2 is Lai and Holt's sheet of PMMA at 163 C. Their law is stress = K t^-0.05 strain, K = 240 psi (t in s), and their
forming took 6 s on average; the thesis leaves the relaxation out. Here the sheet is inflated with and without it, and
its effect is a number of the summary. Their measured curve is in figure 4.11 alone, without numbers in the text, so
agreement is undecided.
"""

from math import gamma

import numpy as np
from common import COMM, parser, save, say, summarise

import formingx as fx
from formingx import figures
from formingx.exact.inflation import membrane_limit_point
from formingx.results import files
from formingx.results.show import plots

# radius, thickness (in), c10, c01 (psi)
CASES = {"case1": (3.5, 0.25, 56.0, 20.0), "case2": (3.5, 0.25, 40.0, 0.0), "case3": (3.5, 0.25, 40.0, 36.0),
         "case4": (3.5, 0.25, 80.0, 20.0), "case5": (3.5, 0.125, 80.0, 20.0), "case6": (7.5, 0.5, 80.0, 20.0)}
PLATES = {"A": (7.5, 0.5, 100.0, 0.0), "B": (7.5, 0.5, 80.0, 20.0)}
HEIGHTS = ("0.5", "1.0", "1.5")                               # of r0
PRESSURES = ("15", "20", "26")                                # psi
THESIS = {"A": {"26": 9}, "B": {"26": 6}}                     # in, from the text
RELAXATION, FORMING = 0.05, 6.0                               # index m of K t^-m, s
SAME_LOAD = 10.0                                              # psi, for cases 4 and 5


def inflate(sheet, elements, until, through=()):
    """Return the path of one sheet."""
    radius, thickness, c10, c01 = sheet
    mesh = fx.mesh.disc(radius=radius, thickness=thickness, elements=elements)
    scene = fx.Scene(mesh=mesh, materials=fx.MooneyRivlin(c10=c10, c01=c01), loads=[fx.Pressure("bottom")],
                     supports=[fx.Symmetry("axis"), fx.SimplySupported("rim")])
    return fx.trace(scene, until=until, intermediate=through)


def power_law(modulus, index):
    """Return a material whose shear modulus is modulus t^-index, within 0.3 % from 0.03 to 10 s: a branch each decade.

    t^-m is the integral of exp(-t/tau) tau^(-m - 1)/Gamma(m) over tau; trapezoids in ln tau, to 1000 s.
    """
    tau = 10.0 ** np.arange(-3, 4)
    share = np.log(10) * tau**-index / gamma(index)
    share[[0, -1]] /= 2
    rest = tau[-1] ** -index / (index * gamma(index))
    return fx.Viscoelastic(fx.NeoHookean(c10=modulus * rest / 2),
                           branches=[(modulus * s, t) for s, t in zip(share, tau)])


def relaxing_numbers(sheet, elements, elastic):
    """Return pressure and pole thickness of a relaxing sheet over the elastic ones; its height grows steadily."""
    radius, thickness, c10, _ = sheet
    end = float(HEIGHTS[-1]) * radius
    scene = fx.Scene(mesh=fx.mesh.disc(radius=radius, thickness=thickness, elements=elements),
                     materials=power_law(2 * c10, RELAXATION), loads=[fx.Pressure("bottom")],
                     supports=[fx.Symmetry("axis"), fx.SimplySupported("rim")])
    times = {h: fx.process_time(FORMING * float(h) / float(HEIGHTS[-1])) for h in HEIGHTS}
    blow = fx.Stage("blow", control=scene.loads[0], amplitudes={fx.pole_height: [(0.0, 0.0), (FORMING, end)]},
                    until=times[HEIGHTS[-1]], intermediate=list(times.values())[:-1])
    path = fx.Process(scene).run([blow])
    pairs = {h: (path.target_state(times[h]).measures, elastic.target_state(fx.pole_height(float(h) * radius)).measures)
             for h in HEIGHTS}
    return {"pressure_over_elastic_at_height": {h: a["pressure"] / b["pressure"] for h, (a, b) in pairs.items()},
            "pole_thickness_over_elastic_at_height": {
                h: (a["pole_stretch"] / b["pole_stretch"]) ** -2 for h, (a, b) in pairs.items()},
            "limit_pressure_psi": path.limit_points[0].measures["pressure"], "forming_s": FORMING, "index": RELAXATION}


def sheet_numbers(sheet, path):
    """Return the numbers of a case of table 4.2."""
    radius, _, c10, c01 = sheet
    states = {h: path.target_state(fx.pole_height(float(h) * radius)).measures for h in HEIGHTS}
    numbers = {
        "pole_thickness_ratio_at_height": {h: m["pole_stretch"] ** -2 for h, m in states.items()},
        "pressure_over_K_at_height": {h: m["pressure"] / (6 * (c10 + c01)) for h, m in states.items()},
        "limit_pressure_psi": path.limit_points[0].measures["pressure"] if path.limit_points else None}
    return numbers


def plate_numbers(sheet, path):
    """Return the numbers of plate A or B; None where the path has no such state."""
    limit = path.limit_points[0].measures if path.limit_points else None
    top = path["pressure"].max()
    membrane = membrane_limit_point(radius=sheet[0], thickness=sheet[1], c10=sheet[2], c01=sheet[3])
    return {
        "pole_height_in": {p: path.state_at(fx.pressure(float(p))).measures["pole_height"] if float(p) < top else None
                           for p in PRESSURES},
        "limit_pressure_psi": limit["pressure"] if limit else None,
        "limit_pole_height_in": limit["pole_height"] if limit else None,
        "membrane_limit_pressure_psi": membrane[1].pressure if membrane else None,
        "pole_height_in_at_0.001_psi": path.state_at(fx.pressure(1e-3)).measures["pole_height"]}


def findings(paths, numbers):
    """Return the qualitative findings of the section, each as a number."""
    thickness = {k: n["pole_thickness_ratio_at_height"]["1.5"] for k, n in numbers.items() if k in CASES}
    uneven = {}
    for name in ("case4", "case5"):
        state = paths[name].state_at(fx.pressure(SAME_LOAD))
        ratio = paths[name].profile(state).thickness_ratio
        uneven[name] = {"pole_height_over_r0": state.measures["pole_height"] / 3.5,
                        "pole_thickness_ratio": ratio[0], "rim_over_pole_thickness": ratio[-1] / ratio[0]}
    a, b = numbers["A"], numbers["B"]
    return {
        # pole thickness ratio at a height of 1.5 r0, per psi of each constant: cases 2 to 3 and 1 to 4
        "thickness_ratio_change_per_psi_of_c01": (thickness["case3"] - thickness["case2"]) / 36,
        "thickness_ratio_change_per_psi_of_c10": (thickness["case4"] - thickness["case1"]) / 24,
        f"unevenness_at_{SAME_LOAD:g}_psi": uneven,
        "A_over_B_initial_pole_height": a["pole_height_in_at_0.001_psi"] / b["pole_height_in_at_0.001_psi"],
        "A_over_B_pole_height_at_15_psi": a["pole_height_in"]["15"] / b["pole_height_in"]["15"]}


def table(numbers, found):
    """Return lines of our values, and of those of the thesis where its text has them."""
    cell = "{:.5g}".format
    lines = [f"{'':8}{'pole thickness ratio at height/r0 of':>40}{'pressure/K there':>32}{'limit, psi':>14}",
             f"{'':8}" + "".join(f"{h:>13}" for h in HEIGHTS) + " " + "".join(f"{h:>12}" for h in HEIGHTS)]
    for name in CASES:
        n = numbers[name]
        lines.append(f"{name:8}" + "".join(f"{cell(v):>13}" for v in n["pole_thickness_ratio_at_height"].values()) + " "
                     + "".join(f"{cell(v):>12}" for v in n["pressure_over_K_at_height"].values())
                     + f"{cell(n['limit_pressure_psi']) if n['limit_pressure_psi'] else 'none':>14}")
    lines.append(f"{'plate':8}" + "".join(f"{'at ' + p + ' psi, in':>15}" for p in PRESSURES)
                 + f"{'thesis at 26':>15}{'limit, psi':>13}{'at, in':>9}{'membrane':>11}")
    for name in PLATES:
        n = numbers[name]
        tail = [n["limit_pressure_psi"], n["limit_pole_height_in"], n["membrane_limit_pressure_psi"]]
        lines.append(f"{name:8}" + "".join(f"{cell(v) if v else 'no state':>15}" for v in n["pole_height_in"].values())
                     + f"{THESIS[name]['26']:>15}" + "".join(f"{cell(v) if v else 'none':>{w}}"
                                                              for v, w in zip(tail, (13, 9, 11))))
    a = numbers["A"]
    uneven = found[f"unevenness_at_{SAME_LOAD:g}_psi"]
    return lines + [
        f"Plate A carries {a['limit_pressure_psi']:.3f} psi at most: at 26 psi it has no state of equilibrium. At"
        f" 25 psi it stands",
        f"  at {a['pole_height_in_at_25_psi']['rising']:.2f} in, and beyond the maximum at"
        f" {a['pole_height_in_at_25_psi']['falling']:.2f} in: the thesis' 9 in lies between the two.",
        f"Pole thickness ratio at 1.5 r0 changes by {found['thickness_ratio_change_per_psi_of_c01']:+.2e} per psi of"
        f" c01 (case 2 to 3), {found['thickness_ratio_change_per_psi_of_c10']:+.2e} per psi of c10 (1 to 4).",
        f"At {SAME_LOAD:g} psi the rim is {uneven['case5']['rim_over_pole_thickness']:.2f} times as thick as the pole"
        f" with r0/h0 = 28, {uneven['case4']['rim_over_pole_thickness']:.2f} times with 14.",
        f"A over B: pole height {found['A_over_B_initial_pole_height']:.5f} at first,"
        f" {found['A_over_B_pole_height_at_15_psi']:.3f} at 15 psi."]


def draw(paths, out, quick):
    """Draw figures 4.9 to 4.13."""
    names = {k: f"{k[-1]}: {c10:g}, {c01:g} psi, r$_0$/h$_0$ = {r / h:g}" for k, (r, h, c10, c01) in CASES.items()}
    figure, (left, right) = figures.figure(2)
    for k, (name, label) in enumerate(names.items()):
        radius, _, c10, c01 = CASES[name]
        height, stretch, pressure = paths[name].curve("pole_height", "pole_stretch", "pressure")
        style = {"color": f"C{k}", "linestyle": "--" if name == "case5" else ":" if name == "case6" else "-"}
        left.plot(height / radius, stretch**-2, label=label, **style)
        right.plot(height / radius, 1e3 * pressure / (6 * (c10 + c01)), **style)
    left.set(xlabel="pole height/r$_0$", ylabel="pole thickness/original", xlim=(0, None), ylim=(0, 1.02))
    right.set(xlabel="pole height/r$_0$", ylabel="1000 pressure/K", xlim=(0, None), ylim=(0, None))
    left.legend(frameon=False, title="case: c10, c01", fontsize=9)
    save(figure, out / "cases.png")

    path, radius = paths["case2"], CASES["case2"][0]
    figure, (left, right) = figures.figure(2)
    height, stretch = path.curve("pole_height", "pole_stretch")
    left.plot(height / radius, stretch**-2, color="tab:blue")
    left.set(xlabel="pole height/r$_0$", ylabel="pole thickness/original", xlim=(0, None), ylim=(0, 1.02))
    for h in HEIGHTS:
        profile = path.profile(path.target_state(fx.pole_height(float(h) * radius)))
        right.plot(profile.reference_radius / radius, profile.thickness_ratio, label=f"pole height {h} r$_0$")
    right.set(xlabel="reference radius R/r$_0$", ylabel="thickness/original", ylim=(0, 1.02))
    right.legend(frameon=False)
    figure.suptitle("Lai and Holt's sheet (case 2), computed")
    save(figure, out / "lai_holt.png")

    figure, (left, right) = figures.figure(2)
    for name, color in (("A", "tab:red"), ("B", "tab:blue")):
        path = paths[name]
        c10, c01 = PLATES[name][2:]
        path.plot("pole_height", "pressure", left, color=color, label=f"{name}: c10 = {c10:g}, c01 = {c01:g} psi")
        left.plot(26, THESIS[name]["26"], "^", color=color, markeredgecolor="k", label=f"thesis (text), {name}")
        state = path.state_at(fx.pressure(26.0)) if name == "B" else path.limit_points[0]
        label = f"{name} at {state.measures['pressure']:.4g} psi" + (" (its maximum)" if name == "A" else "")
        plots.outline(path.profile(state), right, color=color, label=label)
    left.set(xlabel="pressure, psi", ylabel="pole height, in", xlim=(0, 32), ylim=(0, None))
    left.legend(frameon=False, fontsize=9)
    right.set(xlabel="r, in", ylabel="z, in", xlim=(0, None))
    right.legend(frameon=False, loc="lower left", fontsize=9)
    save(figure, out / "plates.png")
    if not quick:
        paths["A"].view3d(out / "plate_A_3d.png", paths["A"].limit_points[0])


def main():
    options = parser("material_constants", __doc__, elements=40, layers=2)
    args = options.parse_args()
    elements = (10, 1) if args.quick else (args.elements, args.layers)
    paths, numbers = {}, {}
    for name, sheet in CASES.items():
        targets = [fx.pole_height(float(h) * sheet[0]) for h in HEIGHTS]
        paths[name] = inflate(sheet, elements, targets[-1], targets[:-1])
        numbers[name] = sheet_numbers(sheet, paths[name])
    for name, sheet in PLATES.items():
        paths[name] = inflate(sheet, elements, fx.pole_height(12.0))
        numbers[name] = plate_numbers(sheet, paths[name])
    rising, falling = (paths["A"].state_at(fx.pressure(25.0), after=s) for s in (None, paths["A"].limit_points[0]))
    numbers["A"]["pole_height_in_at_25_psi"] = {"rising": rising.measures["pole_height"],
                                                "falling": falling.measures["pole_height"]}
    found = findings(paths, numbers)
    relaxing = relaxing_numbers(CASES["case2"], elements, paths["case2"])
    say(f"Material constants and aspect ratio, {elements[0]} x {elements[1]} x 2 triangles", *table(numbers, found),
        "Lai and Holt's sheet with its relaxation, over without it, at height/r0 of " + ", ".join(
            f"{h}: pressure {relaxing['pressure_over_elastic_at_height'][h]:.4f}, pole thickness"
            f" {relaxing['pole_thickness_over_elastic_at_height'][h]:.4f}" for h in HEIGHTS))
    for name, path in paths.items():
        path.to_csv(args.out / f"{name}.csv")
        files.write_profile(path.profile(), args.out / f"{name}_profile.csv", COMM)
    draw(paths, args.out, args.quick)
    summarise(args.out, {**numbers, "findings": found, "lai_holt_relaxing": relaxing, "versions": files.versions(),
                         "mesh": {"radius_elements": elements[0], "thickness_elements": elements[1]}})


if __name__ == "__main__":
    main()
