"""Press blocks 20 times flatter without friction, and 8 times flatter stuck (Song 1993, chapter 7).

Without friction: the neo-Hookean block of `compression_homogeneous`, whose exact force is eq. (7.6). At H/h = 20 the
area is 20 times, and the height a 20th, of the first values. The plate therefore has a penalty by present area and
height (`Contact(present_area=True)`); with a penalty by the reference values the block would penetrate it by 2 % of its
height and more.

Stuck: the block of `compression_roll_over`. From H/h = 4 on, its elements at the corner that rolls in are crushed.
Where the volume ratio at a quadrature point leaves 0.8 to 1.2, the deformed body becomes the reference of a new mesh
(`trace(remesh=)`). "stuck" has elements of 0.025 cm, "stuck_coarse" twice as large ones. The pressure, up to 60 times
the shear modulus, changes within an element by more than that modulus. Each point therefore has a volume stiffness,
too (`MixedPressure(volume_stiffness=10)`).

On 64 x 32 elements without remeshing the force is 95,557 N at 5.23 and 190,689 N at 6.5. "stuck" is 0.2 and 0.6 % above
these, "stuck_coarse" 0.6 and 1.1 %. At 8 they give 379 and 388 kN; with ranges of 0.8 to 1.25 and 0.85 to 1.18 "stuck"
gives 374 and 381 kN. A new mesh lowers the force, because the old one was too stiff (`jumps`): by up to 0.27 % on the
fine mesh and 0.76 % on the coarse one.
"""

import numpy as np
from common import parser, plain_ticks, save, say, summarise
from compression_homogeneous import I1_CONSTANT, exact_force
from plates import HALF_HEIGHT, NEWTON, block, force, press

import formingx as fx
from formingx import figures
from formingx.results import files

RATIOS, GRIDS = (5, 10, 20), ((2, 2), (8, 8))
STUCK = (3.4, 5.23, 6.5, 8.0)
MESHES = {"stuck": ((16, 8), 0.025), "stuck_coarse": ((12, 6), 0.05)}      # at first; size of elements then, cm


def travel(ratio):
    """Return the travel of the plate (cm) at a compression ratio H/h."""
    return HALF_HEIGHT * (1 - 1 / ratio)


def frictionless(elements):
    """Return the path, its force over the exact one at the ratios, and how it ended."""
    scene = block(fx.NeoHookean(c10=I1_CONSTANT), "none", elements, present_area=True)
    path, end = press(scene, [travel(r) for r in RATIOS], progress=False)
    met = {r: path.target_state(fx.travel(travel(r))) for r in RATIOS}
    over = {f"{r:g}": force(s) / exact_force(HALF_HEIGHT / r) for r, s in met.items() if s is not None}
    return path, over, end


def stuck(elements, size, ratios):
    """Return the path of the stuck block, which is remeshed, and its numbers."""
    scene = block(fx.MooneyRivlin(c10=1.0, c01=0.1), "stick", elements, roll_over=True,
                  model=fx.MixedPressure(volume_stiffness=10.0))
    path, end = press(scene, [travel(r) for r in ratios], progress=False,
                      remesh=fx.Remesh(size=size, corner=size, volume_ratio=(0.8, 1.2)),
                      record={"least_J": lambda problem: problem.admissible.volume_ratios()[0]})
    met = {f"{r:g}": path.target_state(fx.travel(travel(r))) for r in ratios}
    least = [state.measures["least_J"] for state in path.states]
    made = [state for state in path.states if state.kind == "remesh"]
    return path, {
        "force_N": {r: force(state) for r, state in met.items() if state is not None},
        "least_J": float(min(least)), "remeshes": len(made), "ended": end,
        "reached_ratio": HALF_HEIGHT / (HALF_HEIGHT - path.last.measures["travel"]),
        "remesh_at_ratio": [HALF_HEIGHT / (HALF_HEIGHT - state.measures["travel"]) for state in made],
        "jumps": {what: [state.jump[what] for state in made] for what in ("force", "energy", "volume")},
        "triangles": [s.problem.scene.mesh.domain.topology.index_map(2).size_local for s in path.record.segments],
        "steps": path.counts.steps, "newton_iterations": path.counts.iterations}


def main():
    args = parser("compression_extreme", __doc__).parse_args()
    grids, paths = {}, {}
    for elements in GRIDS:
        name = "x".join(map(str, elements))
        paths[name], over, end = frictionless(elements)
        grids[name] = {"force_over_exact": over, "ended": end, "steps": paths[name].counts.steps,
                       "newton_iterations": paths[name].counts.iterations,
                       "max_penetration_over_h": float((paths[name]["penetration"]
                                                        / (HALF_HEIGHT - paths[name]["travel"])).max())}
        say(f"without friction, {name} elements: force over exact " + ", ".join(
            f"{v:.6f} at {r}" for r, v in over.items()) + f"; {grids[name]['steps']} states; {end[:200]}")
    there = set.intersection(*(set(g["force_over_exact"]) for g in grids.values()))
    worse = {f"{r:g}": max((g["force_over_exact"][f"{r:g}"] for g in grids.values()), key=lambda v: abs(v - 1))
             for r in RATIOS if f"{r:g}" in there}
    summary = {"frictionless": {"force_over_exact": worse, "grids": grids}}
    meshes = {"stuck_coarse": MESHES["stuck_coarse"]} if args.quick else MESHES
    for name, (elements, size) in meshes.items():
        paths[name], summary[name] = stuck(elements, size, STUCK[:1] if args.quick else STUCK)
        n = summary[name]
        say(f"{name}: force, N, " + ", ".join(f"{f:.0f} at {r}" for r, f in n["force_N"].items())
            + f"; {n['remeshes']} remeshes, least J {n['least_J']:.3f}; jumps of force at most"
            f" {max(map(abs, n['jumps']['force']), default=0):.1e}, {n['steps']} states; {n['ended'][:200]}")
    save(draw(paths), args.out / "compression_extreme.png")
    summarise(args.out, {**summary, "versions": files.versions()})


def draw(paths):
    """Return a figure of the forces over the compression ratio."""
    figure, axes = figures.figure()
    ratio = np.geomspace(1.02, 20, 200)
    axes.plot(ratio, exact_force(HALF_HEIGHT / ratio), "k", linewidth=1, label="without friction, exact, eq. (7.6)")
    for (name, path), mark in zip(paths.items(), ("o", "s", ".-", ".-")):
        label = name.replace("_", ", ") if "stuck" in name else f"{name} elements"
        axes.plot(HALF_HEIGHT / (HALF_HEIGHT - path["travel"][1:]), NEWTON * path["tool_force"][1:], mark,
                  fillstyle="none", markersize=4, linewidth=1, label=label)
    axes.set(xlabel="compression ratio H / h", ylabel="force on one plate, N", xscale="log", yscale="log")
    plain_ticks(axes.xaxis, (1, 2, 5, 10, 20))
    axes.legend(frameon=False)
    return figure


if __name__ == "__main__":
    main()
