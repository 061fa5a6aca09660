"""Blocks pressed 20 times flatter without friction, and 8 times flatter stuck (Song 1993, chapter 7).

Without friction: the neo-Hookean block of `compression_homogeneous`, whose exact force is eq. (7.6). At H/h = 20 the
wall is a 20th and the area 20 times what they were, so the plate is held by present area and wall
(`Contact(present_area=True)`); with the penalty of the block at rest it would sink in by 2 % of the wall and more.
"""

import numpy as np
from common import parser, save, say, summarise
from compression_homogeneous import I1_CONSTANT, exact_force
from plates import HALF_HEIGHT, NEWTON, block, force, press

import formingx as fx
from formingx.results import files
from formingx.results.show import plots

RATIOS, GRIDS = (5, 10, 20), ((2, 2), (8, 8))


def travel(ratio):
    """Of the plate, cm."""
    return HALF_HEIGHT * (1 - 1 / ratio)


def frictionless(elements):
    """(path, force over the exact one at the ratios, how it ended)."""
    scene = block(fx.NeoHookean(c10=I1_CONSTANT), "none", elements, present_area=True)
    path, end = press(scene, [travel(r) for r in RATIOS], progress=False)
    met = {r: path.met(fx.travel(travel(r))) for r in RATIOS}
    over = {f"{r:g}": force(s) / exact_force(HALF_HEIGHT / r) for r, s in met.items() if s is not None}
    return path, over, end


def main():
    args = parser("compression_extreme", __doc__.splitlines()[0]).parse_args()
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
    save(draw(paths), args.out / "compression_extreme.png")
    summarise(args.out, {**summary, "versions": files.versions()})


def draw(paths):
    """Forces over the compression ratio."""
    figure, axes = plots.figure()
    ratio = np.geomspace(1.02, 20, 200)
    axes.plot(ratio, exact_force(HALF_HEIGHT / ratio), "k", linewidth=1, label="without friction, exact, eq. (7.6)")
    for (name, path), mark in zip(paths.items(), "os"):
        axes.plot(HALF_HEIGHT / (HALF_HEIGHT - path["travel"][1:]), NEWTON * path["tool_force"][1:], mark,
                  fillstyle="none", label=f"{name} elements")
    axes.set(xlabel="compression ratio H / h", ylabel="force on one plate, N", xscale="log", yscale="log")
    axes.legend(frameon=False)
    return figure


if __name__ == "__main__":
    main()
