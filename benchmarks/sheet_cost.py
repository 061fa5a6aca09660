"""Measure the cost of a fine sheet in three dimensions, with L U and with L D L^T (20,000 triangles).

The sheet is the tray of `demos/tray.py`: processor time of a run and of its parts, and its memory; then how far a
tangent is from symmetric, and time and memory of its factorisation and of a solution by L U and by L D L^T (MUMPS).
`--friction MU` lets the sheet slide; `--symmetric` makes the whole run with L D L^T, as if its tangent were symmetric.
"""

import argparse
import contextlib
import resource
import sys
import time
from pathlib import Path
from unittest import mock

import numpy as np
from petsc4py import PETSc

sys.path.insert(0, str(Path(__file__).parents[1] / "demos"))
from common import COMM, say  # noqa: E402
from limit import clocked  # noqa: E402
from tray import BOX, tray  # noqa: E402

import formingx as fx  # noqa: E402
from formingx.contact.step_limit import Approach  # noqa: E402
from formingx.extensions.space.solid_tool import SolidTool  # noqa: E402
from formingx.problem.problem import Problem  # noqa: E402
from formingx.results import files  # noqa: E402
from formingx.solve.linear import DirectSolver  # noqa: E402

PARTS = {"tangent": (Problem, "tangent"), "residual": (Problem, "residual"), "factors": (DirectSolver, "factorise"),
         "solves": (DirectSolver, "solve_all"), "one solve": (DirectSolver, "solve"), "reach": (Approach, "reach"),
         "distances": (SolidTool, "signed_distance")}


def asymmetry(matrix):
    """Return |K - K^T| over |K| without its diagonal, on which the penalty of stick is (Frobenius norms)."""
    body = matrix.copy()
    body.setDiagonal(body.createVecRight())
    other = body.transpose(PETSc.Mat())
    other.axpy(-1.0, body, PETSc.Mat.Structure.DIFFERENT_NONZERO_PATTERN)
    return other.norm() / body.norm()


def factorised(matrix, symmetric):
    """Return CPU time (s) of a first and a second factorisation and of a solution, memory (MB) and the residual."""
    matrix = matrix.copy()
    matrix.setOption(PETSc.Mat.Option.SYMMETRIC, symmetric)
    solver, times = DirectSolver(matrix, symmetric), []
    b, x, r = (matrix.createVecRight() for _ in range(3))
    b.array_w[:] = np.random.default_rng(0).normal(size=b.getLocalSize())
    for call in (solver.factorise, solver.factorise, lambda: solver.solve(b, x)):
        matrix.stateIncrease()
        began = time.process_time()
        call()
        times.append(time.process_time() - began)
    matrix.mult(x, r)
    r.axpy(-1.0, b)
    used = solver._ksp.getPC().getFactorMatrix()
    return {"first_s": times[0], "again_s": times[1], "solve_s": times[2], "memory_MB": used.getMumpsInfog(22),
            "factors_millions": used.getMumpsInfog(29) / 1e6, "residual": r.norm() / b.norm()}


def main():
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--size", type=float, default=0.013, help="size of the triangles; the box is 1 x 1.5 x 1")
    options.add_argument("--friction", type=float, help="coefficient of friction (default: the sheet sticks)")
    options.add_argument("--symmetric", action="store_true", help="solve with L D L^T")
    options.add_argument("--out", type=Path, default=Path("results/sheet_cost"))
    args = options.parse_args()
    contact = {} if args.friction is None else {"friction": args.friction or "none", "separates": True}
    solver = mock.patch.object(Problem, "symmetric", True) if args.symmetric else contextlib.nullcontext()
    with solver, clocked(*PARTS.values()) as spent:
        began = time.process_time()
        path = tray(args.size, fx.tools.box(**BOX), **contact)
        whole = time.process_time() - began
    parts = {name: {"s": float(np.sum(calls)), "calls": len(calls)} for name, calls in zip(PARTS, spent.values())}
    state = next(s for s in path.states if s.control > 0.1 * path.last.control)          # part of the sheet is free
    with path.problem.state_context(state) as problem:
        problem.tangent(problem.x, state.control)
        found = {"triangles": len(path.wall().wall), "unknowns": problem.n_unknowns, "states": len(path),
                 "iterations": path.counts.iterations, "failures": path.counts.failures, "seconds": whole,
                 "min_wall_ratio": path.wall().ratio.min(), "parts": parts,
                 "memory_MB": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
                 "asymmetry": asymmetry(problem.matrix), "LU": factorised(problem.matrix, False),
                 "LDLT": factorised(problem.matrix, True)}
    say(*(f"{name}: {value}" for name, value in found.items()))
    files.write_summary(args.out / "summary.json", found, COMM)


if __name__ == "__main__":
    main()
