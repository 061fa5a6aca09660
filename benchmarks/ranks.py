"""Measure the gain of a second rank: time of the parts of an iteration, for a clamped disc with some 3e5 unknowns.

Run it on one rank and on two: `./fx python3 benchmarks/ranks.py`, `./fx mpirun -n 2 python3 benchmarks/ranks.py`. The
time is wall time, which has no meaning on a busy machine; with `--processor` it is the processor time of the slowest
rank.
"""

import argparse
import sys
import time
from pathlib import Path

import numpy as np
from mpi4py import MPI

sys.path.insert(0, str(Path(__file__).parents[1] / "demos"))
from common import COMM, say  # noqa: E402
from limit import clocked  # noqa: E402

import formingx as fx  # noqa: E402
from formingx.problem.problem import Problem  # noqa: E402
from formingx.results import files  # noqa: E402
from formingx.solve.linear import DirectSolver  # noqa: E402

PARTS = {"tangent": (Problem, "tangent"), "residual": (Problem, "residual"), "factors": (DirectSolver, "factorise"),
         "two solves": (DirectSolver, "solve_all")}


def wall() -> float:
    """Return the wall time (s) at which the last rank arrives."""
    COMM.barrier()
    return time.perf_counter()


def main():
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--elements", type=int, nargs=2, default=(400, 40))
    options.add_argument("--processor", action="store_true", help="processor time of the slowest rank, not wall time")
    options.add_argument("--out", type=Path, default=Path("results/ranks"))
    args = options.parse_args()
    disc = fx.mesh.disc(radius=10.0, thickness=1.0, elements=tuple(args.elements))
    scene = fx.Scene(mesh=disc, materials=fx.NeoHookean(c10=1.0), loads=[fx.Pressure("bottom")],
                     supports=[fx.Symmetry("axis"), fx.Clamped("rim")])
    clock = time.process_time if args.processor else wall
    with clocked(*PARTS.values(), clock=clock) as spent:
        began = clock()
        path = fx.trace(scene, until=fx.pressure(0.05), progress=False)
        whole = COMM.allreduce(clock() - began, MPI.MAX)
    found = {name: COMM.allreduce(float(np.median(calls[1:])), MPI.MAX) for name, calls in zip(PARTS, spent.values())}
    say(f"{COMM.size} ranks, {path.problem.n_unknowns} unknowns, {path.counts.iterations} iterations, {whole:.2f} s: "
        + ", ".join(f"{name} {seconds * 1e3:.1f} ms" for name, seconds in found.items()))
    files.write_summary(args.out / f"ranks_{COMM.size}" / "summary.json",
                        {"unknowns": path.problem.n_unknowns, "seconds": whole, **found}, COMM)


if __name__ == "__main__":
    main()
