"""Inflate a sheet of two bonded layers (Song 1993, section 4.5, table 4.3, figs. 4.14 to 4.16).

Mooney layers, each r0 = 19.1 cm and h0 = 0.635 cm, simply supported; c10 (the table's C10) belongs to I1. The bottom
layer is material 1; the top layer is the same (case 1), softer (case 2) or stiffer (case 3). Lengths in cm, stresses in
MPa. --stack takes any materials, from the bottom up: any number of layers.
"""

import itertools

import numpy as np
from common import COMM, parser, save, say, summarise

import formingx as fx
from formingx import figures
from formingx.results import files
from formingx.results.show import plots

RADIUS, LAYER = 19.1, 0.635
CONSTANTS = {1: (0.552, 0.138), 2: (0.414, 0.0), 3: (0.759, 0.276)}         # c10, c01
CASES = {"case1": (1, 1), "case2": (1, 2), "case3": (1, 3)}
NAMES = {"case1": "reference", "case2": "softer", "case3": "stiffer"}
PRESSURE, HEIGHT = 0.142, 16.08
LAST = 20.0                                                    # pole height at which the curves end


def inflate(stack, elements):
    """Return the path of a stack of materials, from the bottom up, through both levels of the study."""
    layers = {f"layer{k}": LAYER for k in range(1, len(stack) + 1)}
    mesh = fx.mesh.disc(radius=RADIUS, thickness=layers, elements=elements)
    materials = {m: fx.MooneyRivlin(c10=CONSTANTS[m][0], c01=CONSTANTS[m][1]) for m in set(stack)}
    scene = fx.Scene(mesh=mesh, materials=dict(zip(layers, (materials[m] for m in stack))),
                     supports=[fx.Symmetry("axis"), fx.SimplySupported("rim")], loads=[fx.Pressure("bottom")])
    return fx.trace(scene, until=fx.pole_height(LAST), intermediate=[fx.pole_height(HEIGHT)])


def levels(path):
    """Return the states at equal pressure (None if the path does not reach it) and at equal pole height."""
    reached = path["pressure"].max() > PRESSURE
    return path.state_at(fx.pressure(PRESSURE)) if reached else None, path.target_state(fx.pole_height(HEIGHT))


def interfaces(path, state, R):
    """Return [(stress below, stress above)] at radii R of each interface, from the bottom up."""
    names = list(path.problem.scene.mesh.layers)
    stress = path.stress(state)
    return [tuple(stress.at_points(np.column_stack([R, np.full(len(R), k * LAYER)]), name) for name in pair)
            for k, pair in enumerate(itertools.pairwise(names), 1)]


def key_numbers(path):
    """Return the numbers of the summary of one stack."""
    load, height = levels(path)
    profile = path.profile(height)
    numbers = {"pole_height_cm_at_0.142MPa": load.measures["pole_height"] if load else None,
               "pressure_MPa": height.measures["pressure"],
               "pole_thickness_ratio": profile.thickness_ratio[0],
               "rim_thickness_ratio": profile.thickness_ratio[-1],
               "mass_error": float(np.abs(path["mass_error"]).max()),
               "newton_iterations": path.counts.iterations, "steps": path.counts.steps}
    if load:
        ratio = path.profile(load).thickness_ratio
        numbers["at_0.142MPa"] = {"pole_thickness_ratio": ratio[0], "rim_thickness_ratio": ratio[-1],
                                  "rim_over_pole_thickness": ratio[-1] / ratio[0]}
    numbers["interfaces_at_half_radius_MPa"] = [
        {side: {"hydrostatic_pressure": float(s.hydrostatic_pressure[0]),
                **{k: float(v[0]) for k, v in s.on_face((0, 1))._asdict().items()}}
         for side, s in zip(("below", "above"), pair)} for pair in interfaces(path, height, np.array([RADIUS / 2]))]
    return numbers


def table(numbers):
    """Return lines of the key numbers of all stacks."""
    lines = [f"{'':12}{'at 0.142 MPa:':>14}{'thickness':>12}{'':>9}{'rim':>9}{f'at {HEIGHT} cm:':>16}{'thickness':>12}",
             f"{'':12}{'height, cm':>14}{'pole':>12}{'rim':>9}{'/pole':>9}{'pressure, MPa':>16}{'pole':>12}{'rim':>9}"]
    for name, n in numbers.items():
        at = n.get("at_0.142MPa")
        cells = [f"{n['pole_height_cm_at_0.142MPa']:>14.4f}" + "".join(
            f"{v:>{w}.4f}" for v, w in zip(at.values(), (12, 9, 9)))] if at else [f"{'not reached':>44}"]
        lines.append(f"{name:12}" + cells[0] + f"{n['pressure_MPa']:>16.6f}{n['pole_thickness_ratio']:>12.4f}"
                     f"{n['rim_thickness_ratio']:>9.4f}")
    lines.append(f"interfaces at half the radius, pole height {HEIGHT} cm, MPa:")
    lines.append(f"{'':24}{'normal':>10}{'shear':>10}{'pressure':>10}{'meridional':>12}{'hoop':>10}")
    for name, n in numbers.items():
        for k, sides in enumerate(n["interfaces_at_half_radius_MPa"], 1):
            for side, s in sides.items():
                lines.append(f"{f'{name}, {k}, {side}':24}{s['normal']:10.4f}{s['shear']:10.4f}"
                             f"{s['hydrostatic_pressure']:10.4f}{s['meridional']:12.4f}{s['hoop']:10.4f}")
    return lines


def draw(paths, out, quick):
    """Draw figures 4.14 to 4.16, and the stresses on both sides of the interface."""
    figure, axes = figures.figure(3, width=4.6)
    for k, (name, path) in enumerate(paths.items()):
        load, height = levels(path)
        label = f"{NAMES.get(name, name)}"
        for a, state in zip(axes[1:], (load, height)):
            if state:
                profile = path.profile(state)
                a.plot(profile.reference_radius, profile.thickness_ratio, color=f"C{k}", label=label)
        if load:
            plots.outline(path.profile(load), axes[0], color=f"C{k}", label=label)
    axes[0].set(xlabel="r, cm", ylabel="z, cm", title=f"profiles at {PRESSURE} MPa", xlim=(0, None))
    for a, title in zip(axes[1:], (f"at {PRESSURE} MPa", f"at pole height {HEIGHT} cm")):
        a.set(xlabel="reference radius, cm", ylabel="thickness/original", title=title, ylim=(0.3, 1))
        a.legend(frameon=False)
    save(figure, out / "profiles_and_thickness.png")

    R = np.linspace(0, 0.98 * RADIUS, 120)
    rows, header = [R], ["R_cm"]
    figure, axes = figures.figure(3, width=4.6)
    colors = (f"C{k}" for k in itertools.count())
    for name, path in paths.items():
        for j, pair in enumerate(interfaces(path, levels(path)[1], R), 1):
            color = next(colors)
            for side, stress, line in zip(("below", "above"), pair, ("-", "--")):
                face = stress.on_face((0, 1))
                values = {"normal": face.normal, "pressure": stress.hydrostatic_pressure, "meridional": face.meridional}
                for a, v in zip(axes, values.values()):
                    a.plot(R, v, line, color=color, linewidth=1.4,
                           label=f"{NAMES.get(name, f'{name}, {j}')}, {side}")
                rows += list(values.values())
                header += [f"{name}_{j}_{side}_{v}_MPa" for v in values]
    for a, title in zip(axes, ("stress normal to it", "hydrostatic pressure", "meridional stress")):
        a.set(xlabel="reference radius, cm", ylabel="MPa", title=title)
    figure.legend(*axes[0].get_legend_handles_labels(), frameon=False, loc="outside right center")
    figure.suptitle(f"on both sides of the interface, pole height {HEIGHT} cm")
    save(figure, out / "interface.png")
    files.write_rows(out / "interface.csv", header, np.column_stack(rows).tolist(), COMM)

    figure, axes = figures.figure()
    for k, (name, path) in enumerate(paths.items()):
        path.plot("pressure", "pole_height", axes, color=f"C{k}", label=NAMES.get(name, name))
    axes.axhline(PRESSURE, color="0.6", linewidth=0.8, linestyle=":")
    axes.axvline(HEIGHT, color="0.6", linewidth=0.8, linestyle=":")
    axes.set(xlabel="pole height, cm", ylabel="pressure, MPa", xlim=(0, None), ylim=(0, None))
    axes.legend(frameon=False)
    save(figure, out / "loading_curve.png")
    if not quick:
        paths["case2"].view3d(out / "softer_3d.png", levels(paths["case2"])[1])


def main():
    options = parser("two_layer", __doc__, elements=40, layers=2)
    options.add_argument("--stack", type=int, nargs="+", choices=CONSTANTS, metavar="MATERIAL", default=None,
                         help="a further case: material 1, 2 or 3 of each layer, from the bottom up")
    args = options.parse_args()
    elements = (10, 1) if args.quick else (args.elements, args.layers)
    cases = CASES | ({"stack": tuple(args.stack)} if args.stack else {})
    paths = {name: inflate(stack, elements) for name, stack in cases.items()}
    numbers = {name: key_numbers(path) for name, path in paths.items()}
    say(f"Sheets of bonded layers, {elements[0]} x {elements[1]} x 2 triangles in each layer", *table(numbers))
    for name, path in paths.items():
        path.to_csv(args.out / f"{name}.csv")
        for level, state in zip(("pressure", "height"), levels(path)):
            if state:
                files.write_profile(path.profile(state), args.out / f"{name}_at_equal_{level}.csv", COMM)
    draw(paths, args.out, args.quick)
    summarise(args.out, {**numbers, "mesh": {"radius_elements": elements[0], "elements_through_a_layer": elements[1]},
                         "versions": files.versions()})


if __name__ == "__main__":
    main()
