"""Measure the cost of time: steps of a material with two branches over steps and iterations of the elastic one.

Processor time of a step, all included (limit points, columns, error in time), of two bodies: Treloar's sheet as a
solid, inflated by a flow and kept at its volume, and a block that is stretched at once and kept so. The elastic
material has the same instantaneous modulus; it is inflated by arc length, or stretched. Readings are medians of
repetitions:

    iteration        one iteration with branches, loaded at once, over one elastic iteration
    step             one step in time over one elastic iteration
    step_over_step   one step in time over one elastic step
"""

import argparse
import json
import time
from pathlib import Path

import numpy as np

import formingx as fx

RUBBER = fx.NeoHookean(c10=0.05)
RELAXING = fx.Viscoelastic(RUBBER, branches=[(0.3, 0.5), (0.4, 5.0)])
ELASTIC = fx.NeoHookean(c10=0.4)
VOLUME, STRETCH = 2.0, 2.0


def sheet(material, elements):
    return fx.Scene(mesh=fx.mesh.disc(radius=1.0, thickness=0.05, elements=elements), materials=material,
                    supports=[fx.Symmetry("axis"), fx.SimplySupported("rim")],
                    loads=[fx.Pressure("bottom", name="air")])


def block(material, elements):
    side = round((elements[0] * elements[1]) ** 0.5)
    return fx.Scene(mesh=fx.mesh.disc(radius=1.0, thickness=1.0, elements=(side, side)), materials=material,
                    supports=[fx.Symmetry("axis"), fx.Symmetry("bottom", normal="z"),
                              fx.PrescribedDisplacement("top", "z", name="pull")])


def stages(body):
    """Return the stages at once and in time of a body."""
    if body is block:
        once = fx.Stage("at once", control="pull", until=fx.travel(STRETCH - 1))
        return [once], [once, fx.Stage("hold", duration=20.0)]
    table = [(0, 0), (4, VOLUME), (24, VOLUME)]
    return ([fx.Stage("at once", control="air", until=fx.enclosed_volume(VOLUME))],
            [fx.Stage("blow", control="air", amplitudes={fx.enclosed_volume: table[:2]}),
             fx.Stage("hold", control="air", amplitudes={fx.enclosed_volume: table[1:]})])


def cost(body, material, schedule, elements, accuracy):
    """Return {stage: (processor seconds, steps, iterations)}, from the first state on, with failed steps."""
    path = fx.Process(body(material, elements)).run(schedule, accuracy=accuracy, max_steps=5000, progress=False,
                                                    record={"cpu": lambda problem: time.process_time()})
    found = {}
    for stage in schedule:
        states = [s for s in path.states if s.stage == stage.name]
        first, last = (state.stepping["counts"] for state in (states[0], states[-1]))
        steps, failures, iterations = (last[k] - first[k] for k in ("steps", "failures", "iterations"))
        found[stage.name] = (states[-1].measures["cpu"] - states[0].measures["cpu"], steps + failures, iterations)
    return found


def compare(body, elements, accuracy, repeat):
    """Return {reading: value} of a body."""
    once, in_time = stages(body)
    rows = []
    for _ in range(repeat):                                  # one after the other: the machine does other things, too
        elastic = cost(body, ELASTIC, once, elements, accuracy)["at once"]
        sudden = cost(body, RELAXING, once, elements, accuracy)["at once"]
        rows.append((elastic, sudden, *cost(body, RELAXING, in_time, elements, accuracy).values()))
    seconds = np.median([[s for s, *_ in row] for row in rows], axis=0)
    steps, iterations = np.array([row[1:] for row in rows[0]]).T
    iteration, step = seconds[0] / iterations[0], seconds[0] / steps[0]
    name = body.__name__
    found = {f"{name}/elastic_iteration_ms": 1e3 * iteration, f"{name}/elastic_iterations_per_step":
             iterations[0] / steps[0], f"{name}/iteration": seconds[1] / iterations[1] / iteration}
    for k, stage in enumerate(in_time, 2):
        if stage is not once[0]:
            key = f"{name}/{stage.name}"
            found |= {f"{key}/steps": int(steps[k]), f"{key}/iterations_per_step": iterations[k] / steps[k],
                      f"{key}/step": seconds[k] / steps[k] / iteration,
                      f"{key}/step_over_step": seconds[k] / steps[k] / step}
    return found


def main():
    options = argparse.ArgumentParser(prog="benchmarks/time_cost.py", description=__doc__.splitlines()[0])
    options.add_argument("--out", type=Path, default=Path("results/time_cost"))
    options.add_argument("--elements", type=int, nargs=2, default=(40, 2))
    options.add_argument("--accuracy", type=float, default=2e-3)
    options.add_argument("--repeat", type=int, default=5)
    args = options.parse_args()
    found = {}
    for body in (sheet, block):
        found |= compare(body, tuple(args.elements), args.accuracy, args.repeat)
    for key, value in found.items():
        print(f"{key:40} {value:8.3g}")
    args.out.mkdir(parents=True, exist_ok=True)
    (args.out / "summary.json").write_text(json.dumps(found, indent=1))


if __name__ == "__main__":
    main()
