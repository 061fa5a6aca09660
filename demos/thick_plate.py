"""Inflate a thick plate, against linear plate theory and Timoshenko's formula (Song 1993, section 4.2.2, fig. 4.3).

Case 6 of table 4.2: r0 = 7.5 in, h0 = 0.5 in, Mooney, I1 constant 80 psi, I2 constant 20 psi (the table's C10 and C01),
to 40.1 psi; clamped as in the figure, and simply supported. Lengths in inches, stresses in psi.
"""

import numpy as np
from common import COMM, parser, save, say, summarise

import formingx as fx
from formingx import figures
from formingx.results import files

RADIUS, THICKNESS, C10, C01 = 7.5, 0.5, 80.0, 20.0
PRESSURES = ("1", "5", "10", "20", "30", "40.1")
HEIGHTS_CM = ("1", "2", "3", "5", "10")                        # where Timoshenko's pressure is compared
SMALL = 1e-3                                                   # psi: pole height about 1 % (4 %) of the thickness
INCH = 2.54
SUPPORTS = {"clamped": fx.Clamped("rim"), "simply_supported": fx.SimplySupported("rim")}
POISSON = 0.5
STIFFNESS = 6 * (C10 + C01) * THICKNESS**3 / 12 / (1 - POISSON**2)      # D, with E of eq. (4.7)


def linear(pressure, support):
    """Return the pole height (in) by linear plate theory."""
    clamped = pressure * RADIUS**4 / (64 * STIFFNESS)
    return clamped if support == "clamped" else clamped * (5 + POISSON) / (1 + POISSON)


def timoshenko_pressure(height):
    """Return the pressure (psi) of eq. (4.6), clamped, at a pole height."""
    return height * STIFFNESS / RADIUS**4 * (64 + 28.2828 / ((1 - POISSON**2) * THICKNESS**2) * height**2)


def timoshenko(pressure):
    """Return the pole height (in) of eq. (4.6), its one real root."""
    cubic = [28.2828 / ((1 - POISSON**2) * THICKNESS**2), 0, 64, -pressure * RADIUS**4 / STIFFNESS]
    return float(next(r.real for r in np.roots(cubic) if abs(r.imag) < 1e-9 * abs(r)))


def inflate(elements, support):
    """Return the path to 40.1 psi, or up to the crease of a clamped corner on a fine mesh."""
    mesh = fx.mesh.disc(radius=RADIUS, thickness=THICKNESS, elements=elements)
    scene = fx.Scene(mesh=mesh, materials=fx.MooneyRivlin(c10=C10, c01=C01), loads=[fx.Pressure("bottom")],
                     supports=[fx.Symmetry("axis"), support])
    targets = [fx.pressure(float(p)) for p in PRESSURES]
    try:
        return fx.trace(scene, until=targets[-1], intermediate=targets[:-1])
    except fx.ConvergenceError as error:
        say(f"WARNING, {support!r}: {error}", "")
        return error.path


def key_numbers(path, support):
    """Return the numbers of the summary of one path."""
    def met(p):
        state = path.target_state(fx.pressure(float(p)))
        return None if state is None else state.measures["pole_height"]

    def timoshenko_over_ours(height_cm):
        height = float(height_cm) / INCH
        if path["pole_height"].max() < height:
            return None
        return timoshenko_pressure(height) / path.state_at(fx.pole_height(height)).measures["pressure"]
    numbers = {
        "pole_height_in_at_psi": {p: met(p) for p in PRESSURES},
        "pole_height_in_linear_theory": {p: linear(float(p), support) for p in PRESSURES},
        "slope_over_linear_theory": path.state_at(fx.pressure(SMALL)).measures["pole_height"] / linear(SMALL, support),
        "pole_thickness_ratio_at_40.1_psi": path.profile().thickness_ratio[0] if met("40.1") else None,
        "mass_error": float(np.abs(path["mass_error"]).max()),
        "newton_iterations": path.counts.iterations, "steps": path.counts.steps}
    if support == "clamped":
        numbers["pole_height_in_timoshenko"] = {p: timoshenko(float(p)) for p in PRESSURES}
        numbers["timoshenko_pressure_over_ours_at_pole_height_cm"] = {
            u: timoshenko_over_ours(u) for u in HEIGHTS_CM}
    return numbers


def table(numbers):
    """Return lines of our values beside both theories."""
    simple, clamped = numbers["simply_supported"], numbers["clamped"]
    lines = [f"{'pole height, in, at a pressure of, psi':42}" + "".join(f"{p:>10}" for p in PRESSURES)]

    def row(name, values):
        lines.append(f"{name:42}" + "".join(f"{'-' if v is None else format(v, '.5g'):>10}" for v in values))
    for name, n in (("clamped", clamped), ("simply supported", simple)):
        row(name, n["pole_height_in_at_psi"].values())
        row("  linear theory", n["pole_height_in_linear_theory"].values())
        if n is clamped:
            row("  Timoshenko (4.6)", n["pole_height_in_timoshenko"].values())
    lines.append(f"initial slope over linear theory: clamped {clamped['slope_over_linear_theory']:.4f},"
                 f" simply supported {simple['slope_over_linear_theory']:.4f}")
    ratios = clamped["timoshenko_pressure_over_ours_at_pole_height_cm"]
    lines.append("Timoshenko's pressure over ours, clamped, at a pole height of: "
                 + ", ".join(f"{v:.3f} ({u} cm)" for u, v in ratios.items() if v))
    lines.append("thesis (text): both agree to a pole height of about 2 cm, then Timoshenko is much stiffer")
    return lines


def draw(paths, grid, out, quick):
    """Draw figure 4.3, (a) and (b), and the plate in 3-D."""
    figure, axes = figures.figure(width=6)
    for name, color in (("clamped", "tab:red"), ("simply_supported", "tab:blue")):
        paths[name].plot("pole_height", "pressure", axes, label=name.replace("_", " "), color=color)
    p = np.array([0.0, 4.0])
    u = np.linspace(0, timoshenko(40.1), 101)
    axes.plot(timoshenko_pressure(u), u, "k:", label="Timoshenko (4.6), clamped")
    axes.plot(p, linear(p, "clamped"), "--", color="tab:red", linewidth=1,
              label="linear theory, clamped")
    axes.plot(p, linear(p, "simply_supported"), "--", color="tab:blue", linewidth=1,
              label="linear theory, simply supported")
    axes.set(xlabel="pressure, psi", ylabel="pole height, in", xlim=(0, 42), ylim=(0, 12))
    axes.legend(frameon=False, loc="lower right", fontsize=9)
    save(figure, out / "loading_curve.png")

    figure, axes = figures.figure(width=5, height=6)
    state = grid.last
    for profile, color in ((grid.profile(grid.states[0]), "0.6"), (grid.profile(state), "tab:blue")):
        rungs = slice(None, None, 2)                           # element edges, not their middles
        edges = [profile.bottom, profile.top, *np.stack([profile.bottom, profile.top], 1)[rungs]]
        for edge in edges:
            axes.plot(*edge.T, color=color, linewidth=0.9)
    axes.set_aspect("equal")
    axes.set(xlabel="r, in", ylabel="z, in", xlim=(0, None),
             title=f"20 triangles, clamped, at rest and at {state.measures['pressure']:.3g} psi")
    save(figure, out / "grid.png")
    if not quick:
        paths["simply_supported"].view3d(out / "inflated_3d.png")


def main():
    options = parser("thick_plate", __doc__, elements=40, layers=2)
    args = options.parse_args()
    elements = (10, 1) if args.quick else (args.elements, args.layers)
    paths = {name: inflate(elements, support) for name, support in SUPPORTS.items()}
    numbers = {name: key_numbers(path, name) for name, path in paths.items()}
    say(f"Thick plate to 40.1 psi, {elements[0]} x {elements[1]} x 2 triangles", *table(numbers))
    for name, path in paths.items():
        path.to_csv(args.out / f"{name}.csv")
        files.write_profile(path.profile(), args.out / f"{name}_profile.csv", COMM)
    grid = paths["clamped"] if args.quick else inflate((10, 1), SUPPORTS["clamped"])
    draw(paths, grid, args.out, args.quick)
    summarise(args.out, {**numbers, "mesh": {"radius_elements": elements[0], "thickness_elements": elements[1]},
                         "versions": files.versions()})


if __name__ == "__main__":
    main()
