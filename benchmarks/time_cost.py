"""What time costs: a step of a material with two branches over an iteration of the elastic one, in processor time.

Treloar's sheet as a solid, blown up through its pressure maximum by a flow (relaxing; its steps are those of the
default accuracy) and by arc length (elastic, the same instantaneous modulus).
"""

import argparse
import json
import time
from pathlib import Path

import formingx as fx

RUBBER = fx.NeoHookean(c10=0.05)
RELAXING = fx.Viscoelastic(RUBBER, branches=[(0.3, 0.5), (0.4, 5.0)])
ELASTIC = fx.NeoHookean(c10=0.4)
VOLUME = 2.0


def sheet(material, elements):
    return fx.Scene(mesh=fx.mesh.disc(radius=1.0, thickness=0.05, elements=elements), materials=material,
                    supports=[fx.Symmetry("axis"), fx.SimplySupported("rim")],
                    loads=[fx.Pressure("bottom", name="air")])


def cost(material, stage, elements, accuracy):
    """(seconds of the processor, steps, iterations) from the first state on."""
    path = fx.Process(sheet(material, elements)).run([stage], accuracy=accuracy, max_steps=5000, progress=False,
                                                     record={"cpu": lambda problem: time.process_time()})
    seconds = path["cpu"][-1] - path["cpu"][0]
    return seconds, path.counts.steps + path.counts.failures, path.counts.iterations


def main():
    options = argparse.ArgumentParser(prog="benchmarks/time_cost.py", description=__doc__.splitlines()[0])
    options.add_argument("--out", type=Path, default=Path("results/time_cost"))
    options.add_argument("--elements", type=int, nargs=2, default=(40, 2))
    options.add_argument("--accuracy", type=float, default=2e-3)
    args = options.parse_args()
    elastic = fx.Stage("blow", drive="air", until=fx.enclosed_volume(VOLUME))
    relaxing = fx.Stage("blow", drive="air", follow={fx.enclosed_volume: [(0, 0), (4, VOLUME)]})
    seconds, steps, iterations = cost(ELASTIC, elastic, tuple(args.elements), args.accuracy)
    iteration = seconds / iterations
    print(f"elastic: {steps} steps, {iterations} iterations, {1e3 * iteration:.2f} ms an iteration")
    found = {"elastic_iteration_seconds": iteration, "elastic_iterations_per_step": iterations / steps}
    seconds, steps, iterations = cost(RELAXING, relaxing, tuple(args.elements), args.accuracy)
    found |= {"step_seconds": seconds / steps, "iterations_per_step": iterations / steps,
              "step_over_elastic_iteration": seconds / steps / iteration}
    print(f"two branches: {steps} steps, {iterations} iterations, {1e3 * seconds / steps:.2f} ms a step:"
          f" {found['step_over_elastic_iteration']:.2f} elastic iterations")
    args.out.mkdir(parents=True, exist_ok=True)
    (args.out / "summary.json").write_text(json.dumps(found, indent=1))


if __name__ == "__main__":
    main()
