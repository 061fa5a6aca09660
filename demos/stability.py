"""Find bifurcations of neo-Hookean cylinders, tubes, blocks, a plate and a sheet, against the exact equations.

c10 = 1/2, so mu = 1. Modes are told apart by their half waves along the body: U on its face, projected on
cos(m pi z/L).
"""

import numpy as np
from common import parser, save, say, summarise

import formingx as fx
from formingx.exact import stability as exact
from formingx.figures import figure

CYLINDERS = {0.2: [1], 0.5: [1], 1: [1], 2: [0, 1], 3: [0, 1, 2]}
TUBES, WAVES = (0.5, 0.8, 0.95), (2, 3, 4)
INFLATED, LENGTHS = (0.5, 0.8), (0.25, 1, 2)
BLOCKS = {0.25: ["flexure"], 0.5: ["flexure"], 1: ["flexure", "barrelling"], 2: ["flexure", "barrelling"]}
MATERIAL = fx.NeoHookean(c10=0.5)
ENDS = [fx.Symmetry("bottom", "z"), fx.PrescribedDisplacement("top", "z")]
STRETCHES = (0.95, 0.85, 0.7, 0.6, 0.5, 0.42, 0.38)
RATIOS = (1.5, 2.0, 2.5, 3.0, 3.5)


def purity(loss, radius, length):
    """Return the share of one half wave along the body in a mode on a face: 1 for a pure one."""
    there = np.abs(loss.points[:, 0] - radius) < 1e-9
    z, U = loss.points[there, 1], loss.amplitudes[there, 0]
    z, U = z[np.argsort(z)], U[np.argsort(z)]
    part, whole = (np.trapezoid(f, z) for f in (U * np.cos(np.pi * z / length), U**2))
    return abs(part) * np.sqrt(2 / length / whole)


def search(scene, targets, wanted, radius, length):
    """Return {(n, symmetry plane or None): critical point of one half wave}, from target to target until all are found.

    The modes of every state are counted, because many shorter ones may become unstable before, or in the same step.
    """
    found, path = {}, None
    for target in targets:
        seen = [] if path is None else path.states[:-1]
        path = fx.trace(scene, start=path, until=target, progress=False)
        new = [state for state in path.states if all(state is not point for point in seen)]
        for n, plane in [kind for kind in wanted if kind not in found]:
            losses = [point for point in path.stability([n], new).critical_points if point.antisymmetric_about == plane]
            best = max(losses, key=lambda point: purity(point, radius, length), default=None)
            if best is not None and purity(best, radius, length) > 0.7:
                found[n, plane] = best
        if len(found) == len(wanted):
            break
    return found


def compressed(length):
    """Return the travels of the plates."""
    return [fx.travel(-(1 - s) * length) for s in STRETCHES]


def cylinder(nu, numbers, fine):
    """Return {n: critical point of one half wave} of a cylinder between plates, and its height.

    A short cylinder first becomes unstable in short waves at its side. Elements are smaller towards it, and none is
    shorter than an eighth of the height, which is enough for one half wave.
    """
    height = np.pi / nu
    elements = (6 * fine, 5 * fine) if nu > 1 else (4 * fine, max(8, round(height * (4 if nu < 1 else 8))) * fine // 2)
    mesh = fx.mesh.disc(radius=1.0, thickness=height, elements=elements, grading=0.2 if nu > 1 else 1.0)
    scene = fx.Scene(mesh=mesh, materials=MATERIAL, supports=[fx.Symmetry("axis"), *ENDS])
    found = search(scene, compressed(height), [(n, None) for n in numbers], 1.0, height)
    return {n: found.get((n, None)) for n in numbers}, height


def tube(ratio, fine):
    """Return {n: critical point} of a ring of a long tube under outer pressure."""
    mesh = fx.mesh.disc(radius=1.0, inner_radius=ratio, thickness=(1 - ratio) / (8 * fine), elements=(8 * fine, 1))
    scene = fx.Scene(mesh=mesh, materials=MATERIAL, loads=[fx.Pressure("rim")],
                     supports=[fx.Symmetry("bottom", "z"), fx.Symmetry("top", "z")])
    found, path = {}, None
    for inward in (0.01, 0.1, 0.3, 0.5):
        path = fx.trace(scene, start=path, progress=False,
                        until=fx.displacement(-inward * ratio, at=(ratio, 0.0), component="r"))
        found = {n: path.stability([n], "all").first_of(n) for n in WAVES}
        if None not in found.values():
            break
    return found


def inflated(ratio, kB, numbers, fine):
    """Return {n: critical point of one half wave} of a tube inflated at constant length, and the length."""
    length = np.pi / kB
    along = max(12, round(4 * length))
    mesh = fx.mesh.disc(radius=1.0, inner_radius=ratio, thickness=length, elements=(2 * fine, along * fine // 2))
    scene = fx.Scene(mesh=mesh, materials=MATERIAL, loads=[fx.Pressure("inner")],
                     supports=[fx.Symmetry("bottom", "z"), fx.Symmetry("top", "z")])
    targets = [fx.displacement((s - 1) * ratio, at=(ratio, 0.0), component="r") for s in RATIOS]
    found = search(scene, targets, [(n, None) for n in numbers], ratio, length)
    return {n: found.get((n, None)) for n in numbers}, length


def block(nu, kinds, fine):
    """Return {kind: critical point of one half wave} of half a plane-strain block between plates, and its length."""
    length = np.pi / nu
    elements = (5 * fine, max(10, round(6 * length)) * fine // 2) if nu < 1 else (6 * fine, 5 * fine)   # see `cylinder`
    mesh = fx.mesh.disc(radius=1.0, thickness=length, elements=elements, grading=0.2 if nu >= 1 else 0.3)
    scene = fx.Scene(mesh=mesh, materials=MATERIAL, kinematics=fx.PlaneStrain(),
                     supports=[fx.Symmetry("axis", mirror=True), *ENDS])
    wanted = {kind: (0, "axis" if kind == "flexure" else None) for kind in kinds}
    found = search(scene, compressed(length), list(wanted.values()), 1.0, length)
    return {kind: found.get(key) for kind, key in wanted.items()}, length


def plate(fine):
    """Return {n: N a^2/D} of a thin clamped plate whose rim is pushed inward."""
    thickness = 0.02
    mesh = fx.mesh.disc(radius=1.0, thickness=thickness, elements=(32 * fine, 2 * fine))
    scene = fx.Scene(mesh=mesh, materials=MATERIAL,
                     supports=[fx.Symmetry("axis"), fx.Symmetry("rim", "z"), fx.PrescribedDisplacement("rim", "r")])
    path = fx.trace(scene, until=fx.travel(-4 * thickness**2), progress=False)
    found = path.stability(range(4), states="all")
    return {n: -18 * found.first_of(n).control / thickness**2 for n in range(4)}


def switched(ratio, kB, fine):
    """Return the two branches of an inflated tube, compared: largest difference, critical point, one branch.

    The difference of the two bulges, one of them turned round, is over their largest displacement.
    """
    losses, length = inflated(ratio, kB, [0], fine)
    loss, path = losses[0], losses[0].path
    ends, z = {}, np.linspace(0, length, 41)
    for sense in (1, -1):
        branch = loss.branch(sense)
        U = loss.amplitudes[np.argmin(np.hypot(loss.points[:, 0] - ratio, loss.points[:, 1]))][0] * sense
        here = 0.0 if U > 0 else length                                  # the end that bulges
        now = _radial(path, loss.state, ratio)
        ends[sense] = fx.trace(path.problem.scene, start=branch, progress=False,
                               until=fx.displacement(1.15 * now, at=(ratio, here), component="r"))
    from formingx.forms.probes import probe
    target = fx.pressure(float(ends[1].last.measures["pressure"]))
    moved = []
    for sense, point in ends.items():
        met = sense == 1 or abs(point.last.measures["pressure"] / target.value - 1) < 1e-9
        state = point.last if met else point.state_at(target, after=point.states[-2])
        with point.problem.state_context(state) as problem:
            moved.append(probe(problem, np.column_stack([np.full(41, ratio), z])).displacement(problem.x)[:, 0])
    return float(np.abs(moved[0] - moved[1][::-1]).max() / np.abs(moved[0]).max()), loss, ends[1]


def main():
    """Run all, print and draw them."""
    options = parser("stability", __doc__).parse_args()
    out, quick = options.out, options.quick
    fine = 1 if quick else 2
    summary, rows, pictures = {}, [], {}

    def note(found, reference, *keys):
        place = summary
        for key in keys[:-1]:
            place = place.setdefault(key, {})
        place[keys[-1]] = found
        if found is None:
            say(f"{'/'.join(keys)}: no mode of one half wave was found")
        else:
            rows.append(("/".join(keys), found, reference))
            say(f"{rows[-1][0]:45} {found:.8g}   exact {reference:.8g}   off {found / reference - 1:.1e}")
    for nu, numbers in {1: [1]}.items() if quick else CYLINDERS.items():
        losses, height = cylinder(nu, numbers, fine)
        for n, loss in losses.items():
            note(None if loss is None else 1 + loss.control / height, exact.cylinder(nu, n),
                 "cylinder", f"nu_{nu}", f"n_{n}")
            pictures[f"cylinder_nu_{nu}_n_{n}"] = loss
    for ratio in TUBES[1:2] if quick else TUBES:
        for n, loss in tube(ratio, fine if ratio > 0.6 else 3).items():
            pressure, inner = exact.tube(ratio, n)
            here = 1 + _radial(loss.path, loss.state, ratio) / ratio
            note(loss.control, pressure, "tube", f"{ratio}", f"n_{n}", "pressure_over_mu")
            note(here, inner, "tube", f"{ratio}", f"n_{n}", "inner_radius_ratio")
            pictures[f"tube_{ratio}_n_{n}"] = loss
    if not quick:
        for ratio in INFLATED:
            for kB in LENGTHS:
                for n, loss in inflated(ratio, kB, (0, 1), fine)[0].items():
                    found = None if loss is None else 1 + _radial(loss.path, loss.state, ratio) / ratio
                    note(found, exact.inflated_tube(ratio, kB, n), "inflated_tube", f"{ratio}", f"kB_{kB}", f"n_{n}",
                         "inner_radius_ratio")
        for n, value in plate(fine).items():
            note(value, exact.clamped_plate(n), "plate", "clamped", f"n_{n}")
    for nu, kinds in {1: ["flexure"]}.items() if quick else BLOCKS.items():
        losses, length = block(nu, kinds, fine)
        for kind, loss in losses.items():
            note(None if loss is None else 1 + loss.control / length, exact.block(nu, kind), "block", f"nu_{nu}", kind)
    mesh = fx.mesh.disc(radius=1.25, thickness=0.082, elements=(20 * fine, fine))
    scene = fx.Scene(mesh=mesh, materials=fx.NeoHookean(c10=2.0), loads=[fx.Pressure("bottom")],
                     supports=[fx.Symmetry("axis"), fx.SimplySupported("rim")])
    path = fx.trace(scene, until=fx.pole_stretch(8.5), progress=False)
    summary["sheet"] = {
        "alarms": len(path.stability(range(1, 7)).bifurcations),
        "n_0_lost_at_pole_stretch": path.stability([0]).critical_points[0].state.measures["pole_stretch"]}
    error, loss, bulge = switched(0.8, 1, fine)
    summary["switched"] = {"mirror_error": error}
    say(f"sheet: {summary['sheet']}", f"switched: mirror error {error:.1e}")
    drawing, axes = figure()
    bodies = list(dict.fromkeys(name.split("/")[0] for name, *_ in rows))
    axes.semilogx([max(abs(found / reference - 1), 1e-12) for _, found, reference in rows],
                  [bodies.index(name.split("/")[0]) for name, *_ in rows], "o", alpha=0.6)
    axes.set(yticks=range(len(bodies)), xlabel="difference from the exact bifurcation, relative")
    axes.set_yticklabels([body.replace("_", " ") for body in bodies])
    save(drawing, out / "accuracy.png")
    if not quick:
        for name in ("cylinder_nu_0.5_n_1", "tube_0.8_n_3"):
            pictures[name].view3d(out / f"{name}.png")
        loss.view3d(out / "bulge_mode.png")
    summarise(out, summary)


def _radial(path, state, ratio):
    """Return the radial displacement of the inner face at its lower end."""
    from formingx.forms.probes import probe
    with path.problem.state_context(state) as problem:
        return float(probe(problem, [(ratio, 0.0)]).displacement(problem.x)[0, 0])


if __name__ == "__main__":
    main()
