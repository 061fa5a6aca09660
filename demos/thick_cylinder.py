"""Inflate a thick cylinder and a thick sphere, against exact solutions (Song 1993, section 3.6).

Cylinder: plane strain, Mooney, inner radius 7 in, outer radius 18.625 in, constants 60 and 10 psi (60 taken as the I1
constant; the pressure depends on their sum alone). Sphere: the same wall, neo-Hookean with the same modulus, which has
a pressure maximum. The mesh is in inches and psi; the tables are in cm and MPa.
"""

from pathlib import Path

import numpy as np
from common import COMM, parser, save, say, summarise

import formingx as fx
from formingx import figures
from formingx.exact.inflation import thick_sphere_limit_point, thick_wall
from formingx.results import files

INCH, PSI = 2.54, 6894.757e-6                                  # cm, MPa
INNER, OUTER, C10, C01 = 7.0, 18.625, 60.0, 10.0               # in, psi
DISPLACEMENTS = ("10", "20", "30", "40", "50")                 # of the inner face, cm
CONSTANTS = {"tube": {"c10": C10, "c01": C01}, "sphere": {"c10": C10 + C01}}
GRIDS = Path(__file__).parents[1] / "meshes"
THESIS_PRESSURE = 1.26                                         # MPa, at 50 cm


def stretch(displacement):
    """Return the stretch of the inner face at its displacement in cm."""
    return 1 + float(displacement) / INCH / INNER


def exact(kind, displacement, R=None):
    """Return the exact state (in, psi)."""
    return thick_wall(kind, stretch(displacement), inner_radius=INNER, outer_radius=OUTER, R=R, **CONSTANTS[kind])


def exact_stress(kind, displacement, points):
    """Return the exact Cauchy stress (psi) at reference points, shape (n, 3, 3)."""
    R = points[:, 0] if kind == "tube" else np.hypot(*points.T)
    return exact(kind, displacement, R).cauchy((1.0, 0.0) if kind == "tube" else points)


def inner(displacement, mesh):
    """Return the target: displacement of the inner face, in cm."""
    R, Z = mesh.nodes_of("inner")[-1]                          # the sphere's node on the equator
    return fx.displacement(float(displacement) / INCH, at=(R, Z), component="r")


def inflate(kind, mesh, **scene):
    """Return the path to an inner displacement of 50 cm, and its targets."""
    supports = [fx.Symmetry("bottom", normal="z"), fx.Symmetry("top", normal="z")] if kind == "tube" else \
        [fx.Symmetry("axis"), fx.Symmetry("equator", normal="z")]
    scene = fx.Scene(mesh=mesh, materials=fx.MooneyRivlin(**{"c01": 0.0, **CONSTANTS[kind]}), supports=supports,
                     loads=[fx.Pressure("inner")], **scene)
    targets = {d: inner(d, mesh) for d in DISPLACEMENTS}
    path = fx.trace(scene, until=targets["50"], intermediate=list(targets.values())[:-1],
                    step=fx.StepControl(largest=0.15))         # for the picture
    return path, targets


def wall(kind, n):
    """Return a mesh of n elements through the wall: the tube two rows high, the sphere 2 n along the meridian."""
    if kind == "tube":
        return fx.mesh.disc(radius=OUTER, inner_radius=INNER, thickness=2 * (OUTER - INNER) / n, elements=(n, 2))
    return fx.mesh.sphere(inner_radius=INNER, thickness=OUTER - INNER, elements=(2 * n, n))


def through(kind, mesh, n):
    """Return points through the wall, shape (n, 2), their radii and their direction: 45 degrees in the sphere."""
    R = np.linspace(INNER, OUTER, n)
    if kind == "tube":
        return np.column_stack([R, np.full(n, 0.7 * mesh.nodes_of("top")[0, 1])]), R, np.array([1.0, 0.0])
    direction = np.array([1.0, 1.0]) / np.sqrt(2)
    return R[:, None] * direction, R, direction


def errors(kind, path, targets):
    """Return errors over the size of the exact solution.

    The pressure has the largest error of five. Displacement and stress are taken at 10 cm: the displacement at the
    exact pressure, as root mean square through the wall; the stress (radial, hoop, pressure) at the quadrature points.
    The last number is the estimated over the true error of the stress (effectivity), both integrated.
    """
    pressure = max(abs(path.target_state(t).measures["pressure"] / exact(kind, d).pressure - 1)
                   for d, t in targets.items())
    points, R, direction = through(kind, path.problem.scene.mesh, 101)
    reference = exact(kind, "10", R)
    state = path.state_at(fx.pressure(reference.pressure))           # before the sphere's maximum
    bounds = [fx.displacement(0.0, at=tuple(p), component="r").bind(path.problem) for p in points]
    u, true = np.array([path.value(b, state) for b in bounds]) / direction[0], reference.r - reference.R
    field = path.stress(path.target_state(targets["10"]))
    stress = field.at_quadrature_points()
    R = stress.points[:, 0] if kind == "tube" else np.hypot(*stress.points.T)
    face, reference = stress.on_face(direction if kind == "tube" else stress.points), exact(kind, "10", R)
    found = np.array([face.normal, face.hoop, stress.hydrostatic_pressure])
    sought = np.array([reference.radial, reference.hoop, reference.hydrostatic_pressure])
    return {"pressure": pressure, "displacement": float(np.sqrt(np.mean((u - true) ** 2) / np.mean(true**2))),
            "stress": float(np.sqrt(np.mean((found - sought) ** 2) / np.mean(sought**2))),
            "effectivity": field.error().total / field.error(exact=lambda X: exact_stress(kind, "10", X)).total}


def study(kind, counts):
    """Return the finest path with its targets, and the key numbers of all meshes."""
    runs = {}
    for n in counts:
        path, targets = inflate(kind, wall(kind, n))
        runs[n] = errors(kind, path, targets)
    numbers = {
        "elements_through_wall": counts[-1],
        "triangles": path.problem.forms.domain.topology.index_map(2).size_global,
        "pressure_MPa_at_inner_displacement_cm": {
            d: path.target_state(t).measures["pressure"] * PSI for d, t in targets.items()},
        "exact_pressure_MPa_at_inner_displacement_cm": {d: exact(kind, d).pressure * PSI for d in DISPLACEMENTS},
        "largest_relative_error_of_pressure": runs[counts[-1]]["pressure"],
        "relative_errors_at_elements_through_wall": {str(n): e for n, e in runs.items()},
        "observed_order": {k: float(np.log(runs[counts[-2]][k] / runs[counts[-1]][k])
                                    / np.log(counts[-1] / counts[-2])) for k in ("pressure", "displacement", "stress")},
        "newton_iterations": path.counts.iterations, "steps": path.counts.steps,
    }
    if kind == "sphere":
        at, state = thick_sphere_limit_point(inner_radius=INNER, outer_radius=OUTER, **CONSTANTS[kind])
        found = path.limit_points[0]
        bound = targets["50"].bind(path.problem)
        numbers |= {"limit_pressure_MPa": found.measures["pressure"] * PSI,
                    "exact_limit_pressure_MPa": state.pressure * PSI,
                    "inner_displacement_cm_at_limit": path.value(bound, found) * INCH,
                    "exact_inner_displacement_cm_at_limit": (at - 1) * INNER * INCH}
    return path, targets, numbers


def coarse():
    """Return the thesis' grids of 6 and 12 triangles."""
    found = {}
    for n in (6, 12):
        mesh = fx.mesh.read(GRIDS / f"cylinder_{n}.msh")
        found[n] = inflate("tube", mesh)
    return found


def geometry_of_the_thesis():
    """Return the outer radius and the inner radius (in) that give the thesis' pressure at 50 cm.

    In each case the other radius is the given one.
    """
    from scipy.optimize import brentq

    def relative_error(A, B):
        return thick_wall("tube", 1 + 50 / INCH / A, inner_radius=A, outer_radius=B,
                          **CONSTANTS["tube"]).pressure * PSI - THESIS_PRESSURE
    return brentq(lambda B: relative_error(INNER, B), 8, 100), brentq(lambda A: relative_error(A, OUTER), 1, 18)


def table(cylinder, grids, sphere):
    """Return lines of pressures beside the exact ones, and of the errors on all meshes."""
    head = [f"{d:>10}" for d in DISPLACEMENTS]
    lines = [f"{'pressure, MPa, at an inner displacement of, cm':48}" + "".join(head)]

    def row(name, values):
        lines.append(f"{name:48}" + "".join(f"{v:10.6f}" for v in values))
    for n, (path, targets) in grids.items():
        row(f"cylinder, {n} triangles", [path.target_state(t).measures["pressure"] * PSI for t in targets.values()])
    for name, numbers in (("cylinder", cylinder), ("sphere", sphere)):
        row(f"{name}, {numbers['triangles']} triangles", numbers["pressure_MPa_at_inner_displacement_cm"].values())
        row("  exact", numbers["exact_pressure_MPa_at_inner_displacement_cm"].values())
    lines.append(f"sphere's limit point: {sphere['limit_pressure_MPa']:.7f} MPa at"
                 f" {sphere['inner_displacement_cm_at_limit']:.3f} cm; exact {sphere['exact_limit_pressure_MPa']:.7f}"
                 f" at {sphere['exact_inner_displacement_cm_at_limit']:.3f}")
    outer, inside = geometry_of_the_thesis()
    lines.append(f"thesis: about {THESIS_PRESSURE} MPa at 50 cm. This wall cannot carry more than"
                 f" {2 * (C10 + C01) * PSI * np.log(OUTER / INNER):.3f} MPa; an outer radius of {outer:.2f} in, or an"
                 f" inner one of {inside:.2f} in, would give it")
    lines.append(f"{'relative errors, elements through the wall':48}{'pressure':>14}{'displacement':>14}{'stress':>14}"
                 f"{'estimated/true':>16}")
    for name, numbers in (("cylinder", cylinder), ("sphere", sphere)):
        for n, e in numbers["relative_errors_at_elements_through_wall"].items():
            lines.append(f"{name + ', ' + n:48}" + "".join(f"{e[k]:14.2e}" for k in numbers["observed_order"])
                         + f"{e['effectivity']:16.3f}")
        lines.append(f"{'  order':48}" + "".join(f"{v:14.2f}" for v in numbers["observed_order"].values()))
    return lines


def thesis_h(stress):
    """Return the scalar h of (3.4.2), from the stress along the tube (Z), where the stretch is 1 (psi)."""
    I1 = np.sum(stress.principal_stretches**2, axis=1)
    return stress.cauchy[:, 1, 1] - 2 * C10 - 2 * C01 * (I1 - 1)


def draw_wall(grids, path, targets, out):
    """Draw figure 3.4, pressure through the wall at 50 cm, and the thesis' h; return errors on the grids."""
    figure, (left, right) = figures.figure(2, width=5.2)
    R = np.linspace(INNER, OUTER, 49)
    true = exact("tube", "50", R)
    l = true.r / R
    h = true.radial - 2 * C10 / l**2 - 2 * C01 * (1 + 1 / l**2)
    left.plot(R * INCH, true.hydrostatic_pressure * PSI, "k", linewidth=1, label="exact")
    right.plot(R * INCH, h * PSI, "k", linewidth=1, label="exact")
    misses, rows = {}, [R * INCH, true.hydrostatic_pressure * PSI, h * PSI]
    runs = {f"{n} triangles": run for n, run in grids.items()}
    runs[f"{path.problem.forms.domain.topology.index_map(2).size_global} triangles"] = (path, targets)
    for (name, (run, targets)), style in zip(runs.items(), ("C1.--", "C0.-", "C2-"), strict=True):
        points, _, _ = through("tube", run.problem.scene.mesh, len(R))
        stress = run.stress(run.target_state(targets["50"])).at_points(points)
        p = stress.hydrostatic_pressure
        misses[name] = float(np.abs(p - true.hydrostatic_pressure).max() / np.abs(true.hydrostatic_pressure).max())
        every = {"markevery": 8} if name.startswith(("6 ", "12 ")) else {}
        left.plot(R * INCH, p * PSI, style, linewidth=1.2, label=name, **every)
        right.plot(R * INCH, thesis_h(stress) * PSI, style, linewidth=1.2, label=name, **every)
        rows += [p * PSI, thesis_h(stress) * PSI]
    left.set(xlabel="reference radius, cm", ylabel="hydrostatic pressure -tr$\\,\\sigma$/3, MPa")
    right.set(xlabel="reference radius, cm", ylabel="h of eq. (3.4.2), MPa")
    left.legend(frameon=False)
    figure.suptitle("cylinder, inner displacement 50 cm")
    save(figure, out / "hydrostatic_pressure.png")
    names = [f"{q}_{n.replace(' ', '_')}" for n in ("exact", *runs) for q in ("hydrostatic_pressure", "h")]
    files.write_rows(out / "wall.csv", ["R_cm", *(f"{n}_MPa" for n in names)], np.column_stack(rows).tolist(), COMM)
    return misses


def draw_curves(kind, path, targets, out, grids=None):
    """Draw the pressure over the inner displacement (figure 3.3)."""
    figure, axes = figures.figure()
    u = np.linspace(0, 50, 101)
    axes.plot(u, [exact(kind, d).pressure * PSI for d in u], "k", linewidth=1, label="exact")
    runs = {f"{n} triangles": run for n, run in (grids or {}).items()}
    runs[f"{path.problem.forms.domain.topology.index_map(2).size_global} triangles"] = (path, targets)
    for (name, (run, targets)), style in zip(reversed(runs.items()), ("C2.", "C0x", "C1+")):
        bound = targets["50"].bind(run.problem)
        displacement = [run.value(bound, s) * INCH for s in run.states]
        axes.plot(displacement, run["pressure"] * PSI, style, markersize=7, label=name)
        for s in run.limit_points:
            axes.plot(run.value(bound, s) * INCH, s.measures["pressure"] * PSI, "o", color="C2", fillstyle="none",
                      markersize=11, label="limit point")
    if kind == "tube":
        axes.plot(50, THESIS_PRESSURE, "k^", label="thesis (text): about 1.26")
    axes.set(xlabel="displacement of the inner face, cm", ylabel="pressure, MPa", ylim=(0, None), xlim=(0, 52))
    axes.legend(frameon=False, loc="lower right")
    save(figure, out / f"{'cylinder' if kind == 'tube' else 'sphere'}.png")


def main():
    options = parser("thick_cylinder", __doc__)
    options.add_argument("--elements", type=int, default=16,
                         help="elements through the wall; a quarter and a half of them are run, too")
    args = options.parse_args()
    n = 12 if args.quick else args.elements
    counts = [max(n // 4, 1), max(n // 2, 2), n]
    (tube, tube_targets, cylinder), (ball, ball_targets, sphere) = study("tube", counts), study("sphere", counts)
    grids = coarse()
    say("Thick cylinder and thick sphere under internal pressure", *table(cylinder, grids, sphere))
    misses = draw_wall(grids, tube, tube_targets, args.out)
    say("largest error of the hydrostatic pressure through the wall, over its largest value: "
        + ", ".join(f"{v:.1e} ({k})" for k, v in misses.items()))
    draw_curves("tube", tube, tube_targets, args.out, grids)
    draw_curves("sphere", ball, ball_targets, args.out)
    tube.to_csv(args.out / "cylinder.csv")
    ball.to_csv(args.out / "sphere.csv")
    outer, inside = geometry_of_the_thesis()
    cylinder |= {
        "pressure_MPa_at_inner_displacement_cm_on_grid": {
            str(k): {d: p.target_state(t).measures["pressure"] * PSI for d, t in targets.items()}
            for k, (p, targets) in grids.items()},
        "hydrostatic_pressure_error": misses,
        "outer_radius_in_that_gives_1.26_MPa": outer, "inner_radius_in_that_gives_1.26_MPa": inside}
    summarise(args.out, {"cylinder": cylinder, "sphere": sphere, "versions": files.versions()})


if __name__ == "__main__":
    main()
