"""Error of the walls of sliding sheets in three dimensions by the length of steps, at a coefficient of friction of 0.3.

    ./fx python3 benchmarks/friction_steps.py

Contact is lagged: points come into contact, and the pressure that limits friction changes, between steps only. A box
tray and a round cup are formed with `nodes_per_step` 0.03, 0.02 and 0.01, and with steps of at most 0.02 and 0.01. The
walls are compared, triangle by triangle, with those of the shortest steps. The table shows the difference of the least
wall, the root mean square and the largest difference.
"""

import time

import numpy as np

import formingx as fx

MODEL, HELD = fx.Membrane(wrinkles=0.01), [fx.SimplySupported("rim"), fx.Symmetry("x0", "x"), fx.Symmetry("y0", "y")]
RUNS = ((0.03, None), (0.02, None), (0.01, None), (0.01, 0.02), (0.01, 0.01))
"""Pairs (nodes_per_step, largest step), the shortest steps last."""


def box(nodes, largest=None):
    """Return the path of a quarter of a box tray, in triangles of 6 with a lip of radius 3."""
    mould = fx.tools.box(half=(72, 42), depth=30, corner=18, fillet=8, lip=3, draft=8)
    sheet = fx.mesh.sheet(fx.mesh.rectangle(160.0, 100.0, corner=20.0, part="quarter"), size=6.0)
    return form(sheet, 1.5, fx.NeoHookean(c10=0.05), mould, 0.09, nodes, largest)


def cup(nodes, largest=None):
    """Return the path of a quarter of a round cup."""
    mould = fx.tools.revolved(fx.Tool([(2, 0), (0.95, 0), (0.75, -0.6), (0, -0.6)], [0, 0.1, 0.15, 0]))
    sheet = fx.mesh.sheet(fx.mesh.circle(1.0, part="quarter"), size=0.06)
    return form(sheet, 0.01, fx.NeoHookean(c10=1.0), mould, 0.3, nodes, largest)


def form(sheet, thickness, material, mould, pressure, nodes, largest):
    """Return the path of a sheet that slides into a mould."""
    scene = fx.Scene(mesh=sheet, thickness=thickness, materials=material, model=MODEL, supports=HELD,
                     loads=[fx.Pressure("top")],
                     contacts=[fx.Contact("bottom", mould, 0.3, nodes_per_step=nodes, name="mould")])
    return fx.trace(scene, until=fx.pressure(pressure), progress=False,
                    step=fx.StepControl(largest=largest) if largest else None)


def main():
    print("tray  nodes  largest  states  failed  iterations  time    least      rms    worst")
    for name, run in (("box", box), ("cup", cup)):
        found = []
        for nodes, largest in RUNS:
            begin = time.process_time()
            path = run(nodes, largest)
            found.append((nodes, largest, path, time.process_time() - begin, path.wall().ratio))
        last = found[-1][-1]
        for nodes, largest, path, seconds, ratio in found:
            d = 100 * (ratio / last - 1)
            print(f"{name:4}  {nodes:5}  {largest or 'default':>7}  {len(path):6}  {path.counts.failures:6}"
                  f"  {path.counts.iterations:10}  {seconds:4.0f}  {100 * (ratio.min() / last.min() - 1):6.2f} %"
                  f" {np.sqrt((d**2).mean()):6.2f} % {np.abs(d).max():6.2f} %", flush=True)


if __name__ == "__main__":
    main()
