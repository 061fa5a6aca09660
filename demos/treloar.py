"""Inflate Treloar's rubber sheet through its pressure maximum (Song 1993, section 4.3.2, figs. 4.6 to 4.8).

Neo-Hookean, c10 (the I1 constant) = 2.0 kg/cm2; r0 = 1.25 cm, h0 = 0.082 cm; lengths in cm, stresses in kg/cm2.
"""

import numpy as np
from common import COMM, parser, save, say, summarise

import formingx as fx
from formingx import figures
from formingx.exact.inflation import membrane_inflation, membrane_limit_point
from formingx.results import files
from formingx.results.show import plots

RADIUS, THICKNESS, C10 = 1.25, 0.082, 2.0
STRETCHES = ("1.2", "1.5", "2", "3", "4", "6", "8.5")
SUPPORTS = {"simply_supported": fx.SimplySupported("rim"), "clamped": fx.Clamped("rim")}
THESIS = {"limit pressure": 0.493, "pressure at stretch 8.5": 0.349, "pole thickness at 8.5": 0.0012,
          "thickness ratio near the rim": 0.5}


def inflate(mesh, support):
    """Return the path to pole stretch 8.5."""
    scene = fx.Scene(mesh=mesh, materials={"sheet": fx.NeoHookean(c10=C10)},
                     supports=[fx.Symmetry("axis"), support], loads=[fx.Pressure("bottom")])
    targets = [fx.pole_stretch(float(s)) for s in STRETCHES]
    try:
        return fx.trace(scene, until=targets[-1], intermediate=targets[:-1])
    except fx.ConvergenceError as error:      # a clamped corner on a fine mesh: what was reached is still of use
        if not error.path.limit_points:
            raise
        say(f"WARNING, {support!r}: {error}", "")
        return error.path


def key_numbers(path):
    """Return the numbers of the summary of one path."""
    limit, profile = path.limit_points[0].measures, path.profile()
    whole = path.target_state(fx.pole_stretch(float(STRETCHES[-1]))) is not None
    return {
        "limit_pressure_kg_per_cm2": limit["pressure"],
        "limit_pole_stretch": limit["pole_stretch"],
        "limit_pole_height_cm": limit["pole_height"],
        "pressure_kg_per_cm2_at_stretch": {
            s: met.measures["pressure"] if (met := path.target_state(fx.pole_stretch(float(s)))) else None
            for s in STRETCHES},
        "pole_thickness_cm": profile.thickness[0] if whole else None,
        "rim_thickness_ratio": profile.thickness_ratio[-1] if whole else None,
        "thickness_ratio_one_thickness_from_rim": profile.thickness_ratio_at(RADIUS - THICKNESS) if whole else None,
        "mass_error": abs(path.last.measures["mass_error"]),
        "steps": path.counts.steps,
        "newton_iterations": path.counts.iterations,
        "solve_seconds": path.counts.seconds,
    }


def table(numbers):
    """Return lines of our values beside membrane theory and the thesis."""
    limit = membrane_limit_point(radius=RADIUS, thickness=THICKNESS, c10=C10)
    at = {s: membrane_inflation(float(s), radius=RADIUS, thickness=THICKNESS, c10=C10) for s in STRETCHES}
    simple, clamped = numbers["simply_supported"], numbers["clamped"]
    rows = [("limit pressure, kg/cm2", "limit_pressure_kg_per_cm2", limit[1].pressure, THESIS["limit pressure"]),
            ("  its pole stretch", "limit_pole_stretch", limit[0], None),
            ("  its pole height, cm", "limit_pole_height_cm", limit[1].height, None)]
    rows = [(name, simple[key], clamped[key], *rest) for name, key, *rest in rows]
    for s in STRETCHES:
        rows.append((f"pressure at stretch {s}", *(n["pressure_kg_per_cm2_at_stretch"][s] for n in (simple, clamped)),
                     at[s].pressure, THESIS["pressure at stretch 8.5"] if s == "8.5" else None))
    rows.append(("pole thickness at 8.5, cm", simple["pole_thickness_cm"], clamped["pole_thickness_cm"],
                 THICKNESS * at["8.5"].thickness_ratio[0], THESIS["pole thickness at 8.5"]))
    rows.append(("thickness ratio at the rim", simple["rim_thickness_ratio"], clamped["rim_thickness_ratio"],
                 at["8.5"].thickness_ratio[-1], None))
    near, key = RADIUS - THICKNESS, "thickness_ratio_one_thickness_from_rim"
    rows.append(("  one thickness from the rim", simple[key], clamped[key],
                 np.interp(near, at["8.5"].R, at["8.5"].thickness_ratio), THESIS["thickness ratio near the rim"]))
    head = f"{'':30}{'simply supp.':>14}{'clamped':>12}{'membrane':>12}{'thesis':>9}"
    cell = "{:.6g}".format
    return [head] + [f"{name:30}{cell(a) if a else '-':>14}{cell(b) if b else '-':>12}{cell(m):>12}"
                     f"{t or '':>9}" for name, a, b, m, t in rows]


def draw(paths, out, quick):
    """Draw figures 4.6, 4.7 and 4.8, the convergence of Newton's method, and the sheet in 3-D."""
    path = paths["simply_supported"]
    figure, axes = figures.figure()
    for name, style in (("simply_supported", {"color": "tab:blue"}), ("clamped", {"color": "tab:red"})):
        paths[name].plot("pressure", "pole_stretch", axes, label=name.replace("_", " "), **style)
    stretches = np.linspace(1.02, 8.5, 60)
    axes.plot(stretches, [membrane_inflation(s, radius=RADIUS, thickness=THICKNESS, c10=C10).pressure
                          for s in stretches], "k--", linewidth=1, label="membrane theory")
    axes.axhline(THESIS["limit pressure"], color="0.6", linewidth=0.8, linestyle=":")
    axes.plot(8.5, THESIS["pressure at stretch 8.5"], "k^", label="thesis (text): maximum 0.493; 0.349 at 8.5")
    axes.set(xlabel="stretch at the pole", ylabel="pressure, kg/cm$^2$", xlim=(1, 8.8), ylim=(0, None))
    axes.legend(frameon=False, loc="lower right")
    save(figure, out / "loading_curve.png")

    limit = path.limit_points[0]
    rising, falling = (0.126, 0.440), (0.436, 0.349)
    states = [path.state_at(fx.pressure(p)) for p in rising] + [limit]
    states += [path.state_at(fx.pressure(p), after=limit) for p in falling]
    figure, (left, right) = figures.figure(2, width=6, ratios=(1, 1.6))
    for k, state in enumerate(states):
        profile, color = path.profile(state), f"C{k}"
        label = f"{state.measures['pressure']:.3f} kg/cm$^2$" + (" (maximum)" if state is limit else "")
        plots.outline(profile, left, 1 / RADIUS, color=color, label=label)
        right.plot(profile.reference_radius / RADIUS, profile.thickness_ratio, color=color)
    left.set(xlabel="r/r$_0$", ylabel="z/r$_0$", xlim=(0, None), title="profiles, simply supported")
    right.set(xlabel="reference radius R/r$_0$", ylabel="thickness/original", title="thickness", ylim=(0, 1.02))
    figure.legend(*left.get_legend_handles_labels(), frameon=False, loc="outside right center")
    save(figure, out / "profiles_and_thickness.png")

    figure, axes = figures.figure()
    path.plot_convergence(axes)
    axes.set_title("Newton's method, all states, simply supported")
    save(figure, out / "convergence.png")
    if not quick:
        path.view3d(out / "inflated_3d.png", states[-1])


def main():
    options = parser("treloar", __doc__, elements=40, layers=2)
    args = options.parse_args()
    elements = (10, 1) if args.quick else (args.elements, args.layers)
    mesh = fx.mesh.disc(radius=RADIUS, thickness=THICKNESS, elements=elements)
    paths = {name: inflate(mesh, support) for name, support in SUPPORTS.items()}
    numbers = {name: key_numbers(path) for name, path in paths.items()}
    say(f"Treloar's sheet to pole stretch 8.5, {elements[0]} x {elements[1]} x 2 triangles,"
        f" {paths['simply_supported'].problem.n_unknowns} unknowns", *table(numbers))
    for name, n in numbers.items():
        say(f"{name.replace('_', ' ')}: {n['steps']} states, {n['newton_iterations']} Newton iterations,"
            f" {n['solve_seconds']:.2f} s, mass error {n['mass_error']:.1e}")
    for name, path in paths.items():
        path.to_csv(args.out / f"{name}.csv")
        files.write_profile(path.profile(), args.out / f"{name}_profile.csv", COMM)
    draw(paths, args.out, args.quick)
    summarise(args.out, {**numbers, "mesh": {"radius_elements": elements[0], "thickness_elements": elements[1],
                                             "triangles": 2 * elements[0] * elements[1]},
                         "dofs": paths["simply_supported"].problem.n_unknowns, "versions": files.versions()})


if __name__ == "__main__":
    main()
