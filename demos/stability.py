"""Bifurcations of neo-Hookean cylinders, tubes, blocks, a plate and a sheet, against the exact equations.

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
ENDS = [fx.Symmetry("bottom", "z"), fx.Displaced("top", "z")]


def purity(loss, radius, length):
    """How much of the mode, on a face, is one half wave along the body: 1, all of it."""
    there = np.abs(loss.points[:, 0] - radius) < 1e-9
    z, U = loss.points[there, 1], loss.amplitudes[there, 0]
    z, U = z[np.argsort(z)], U[np.argsort(z)]
    parts = [abs(np.trapezoid(U * np.cos(m * np.pi * z / length), z)) for m in range(40)]
    return parts[1] / np.linalg.norm(parts)


def one_half_wave(path, n, radius, length, flipped=None, states=20):
    """The loss whose mode has one half wave, or None."""
    found = [loss for loss in path.stability([n], states).losses if loss.flipped == flipped]
    best = max(found, key=lambda loss: purity(loss, radius, length), default=None)
    return best if best is not None and purity(best, radius, length) > 0.7 else None


def around(stretch, length):
    """Travels of a plate shortly before and behind a stretch: shorter waves may have been lost before."""
    return [fx.travel(-(1 - s) * length) for s in (min(1.015 * stretch, (1 + stretch) / 2), 0.985 * stretch)]


def compress(scene, stretches, length):
    """A path to the least of the stretches, and {stretch: its states around}."""
    targets = {s: around(s, length) for s in stretches}
    every = sorted((t for pair in targets.values() for t in pair), key=lambda t: -t.value)
    path = fx.trace(scene, until=every[-1], through=every[:-1], progress=False)
    return path, {s: [path.met(t) for t in pair] for s, pair in targets.items()}


def cylinder(nu, numbers, fine):
    """{n: the loss with one half wave} of a cylinder between plates, its height."""
    height = np.pi / nu
    stubby = nu > 1
    elements = (5 * fine, 16 * fine) if stubby else (4 * fine, max(8, round(height * (4 if nu < 1 else 8))) * fine // 2)
    mesh = fx.mesh.disc(radius=1.0, thickness=height, elements=elements, grading=0.2 if stubby else 1.0)
    scene = fx.Scene(mesh=mesh, materials=MATERIAL, supports=[fx.Symmetry("axis"), *ENDS])
    stretch = {n: exact.cylinder(nu, n) for n in numbers}
    path, states = compress(scene, stretch.values(), height)
    return {n: one_half_wave(path, n, 1.0, height, states=states[s]) for n, s in stretch.items()}, height


def tube(ratio, fine):
    """A ring of a long tube under outer pressure, until it has lost four waves."""
    mesh = fx.mesh.disc(radius=1.0, inner_radius=ratio, thickness=(1 - ratio) / (8 * fine), elements=(8 * fine, 1))
    scene = fx.Scene(mesh=mesh, materials=MATERIAL, loads=[fx.Pressure("rim")],
                     supports=[fx.Symmetry("bottom", "z"), fx.Symmetry("top", "z")])
    inward = 1.1 * (1 - exact.tube(ratio, max(WAVES))[1]) * ratio
    return fx.trace(scene, until=fx.displacement(-inward, at=(ratio, 0.0), component="r"), progress=False)


def inflated(ratio, kB, numbers, fine):
    """{n: the loss with one half wave} of a tube inflated at its length, and the length."""
    length = np.pi / kB
    along = max(12, round(4 * length))
    mesh = fx.mesh.disc(radius=1.0, inner_radius=ratio, thickness=length, elements=(2 * fine, along * fine // 2))
    scene = fx.Scene(mesh=mesh, materials=MATERIAL, loads=[fx.Pressure("inner")],
                     supports=[fx.Symmetry("bottom", "z"), fx.Symmetry("top", "z")])
    targets = {n: [fx.displacement((s * exact.inflated_tube(ratio, kB, n) - 1) * ratio, at=(ratio, 0.0), component="r")
                   for s in (0.985, 1.015)] for n in numbers}
    every = sorted((t for pair in targets.values() for t in pair), key=lambda t: t.value)
    path = fx.trace(scene, until=every[-1], through=every[:-1], progress=False)
    return {n: one_half_wave(path, n, ratio, length, states=[path.met(t) for t in pair])
            for n, pair in targets.items()}, length


def block(nu, kinds, fine):
    """{kind: the loss with one half wave} of half a plane-strain block between plates, its length."""
    length = np.pi / nu
    along = max(10, round(length * (6 if nu < 1 else 10)))
    mesh = fx.mesh.disc(radius=1.0, thickness=length, elements=(5 * fine, along * fine // 2), grading=0.3)
    scene = fx.Scene(mesh=mesh, materials=MATERIAL, kinematics=fx.PlaneStrain(),
                     supports=[fx.Symmetry("axis", mirror=True), *ENDS])
    stretch = {kind: exact.block(nu, kind) for kind in kinds}
    path, states = compress(scene, stretch.values(), length)
    return {kind: one_half_wave(path, 0, 1.0, length, "axis" if kind == "flexure" else None, states[s])
            for kind, s in stretch.items()}, length


def plate(fine):
    """{n: N a^2/D} of a thin clamped plate whose rim is pushed inward."""
    thickness = 0.02
    mesh = fx.mesh.disc(radius=1.0, thickness=thickness, elements=(32 * fine, 2 * fine))
    scene = fx.Scene(mesh=mesh, materials=MATERIAL,
                     supports=[fx.Symmetry("axis"), fx.Symmetry("rim", "z"), fx.Displaced("rim", "r")])
    path = fx.trace(scene, until=fx.travel(-62 / 18 * thickness**2), progress=False)
    found = path.stability(range(4), states="all")
    return {n: -18 * found.first_of(n).control / thickness**2 for n in range(4)}


def switched(ratio, kB, fine):
    """(largest difference of the two bulges, one turned round, over their largest displacement; the loss; a bulge)."""
    losses, length = inflated(ratio, kB, [0], fine)
    loss, path = losses[0], losses[0].path
    ends, z = {}, np.linspace(0, length, 41)
    for sense in (1, -1):
        branch = loss.branch(sense)
        U = loss.amplitudes[np.argmin(np.hypot(loss.points[:, 0] - ratio, loss.points[:, 1]))][0] * sense
        here = 0.0 if U > 0 else length                                  # the end that bulges
        now = float((exact.inflated_tube(ratio, kB, 0) - 1) * ratio)
        ends[sense] = fx.trace(path.problem.scene, start=branch, progress=False,
                               until=fx.displacement(1.15 * now, at=(ratio, here), component="r"))
    from formingx.discrete.probes import probe
    target = fx.pressure(float(ends[1].last.measures["pressure"]))
    moved = []
    for sense, one in ends.items():
        state = one.last if sense == 1 or abs(one.last.measures["pressure"] / target.value - 1) < 1e-9 else one.at(
            target, after=one.states[-2])
        with one.problem.at(state) as problem:
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
        path = tube(ratio, fine if ratio > 0.6 else 3)
        found = path.stability(WAVES)
        for n in WAVES:
            loss, (pressure, inner) = found.first_of(n), exact.tube(ratio, n)
            here = 1 + _radial(path, loss.state, ratio) / ratio
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
        "alarms": len(path.stability(range(1, 7)).alarms),
        "n_0_lost_at_pole_stretch": path.stability([0]).losses[0].state.measures["pole_stretch"]}
    error, loss, bulge = switched(0.8, 1, fine)
    summary["switched"] = {"mirror_error": error}
    say(f"sheet: {summary['sheet']}", f"switched: mirror error {error:.1e}")
    drawing, axes = figure()
    off = [max(abs(found / reference - 1), 1e-12) for _, found, reference in rows]
    axes.semilogx(off, range(len(rows)), "o")
    axes.set(yticks=range(len(rows)), xlabel="difference from the exact bifurcation, relative")
    axes.set_yticklabels([name for name, *_ in rows], fontsize=5)
    save(drawing, out / "accuracy.png")
    if not quick:
        for name in ("cylinder_nu_0.5_n_1", "tube_0.8_n_3"):
            pictures[name].view3d(out / f"{name}.png")
        loss.view3d(out / "bulge_mode.png")
    summarise(out, summary)


def _radial(path, state, ratio):
    """Radial displacement of the inner face at its lower end."""
    from formingx.discrete.probes import probe
    with path.problem.at(state) as problem:
        return float(probe(problem, [(ratio, 0.0)]).displacement(problem.x)[0, 0])


if __name__ == "__main__":
    main()
