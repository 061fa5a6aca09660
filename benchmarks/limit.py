"""Compare a run with the cost of its linear algebra: iterations times (tangent, factors, two solves).

Inflation of Treloar's sheet to pole stretch 8.2, and the shallow cup with stick to 30 psi. `--profile` lists the
functions that take the rest. Times are processor seconds of one process, on which other work has little effect.
"""

import argparse
import contextlib
import cProfile
import pstats
import sys
import time
from pathlib import Path
from unittest import mock

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "demos"))
from common import COMM, say  # noqa: E402

import formingx as fx  # noqa: E402
from formingx.problem.problem import Problem  # noqa: E402
from formingx.results import files  # noqa: E402
from formingx.solve.arc_length import Curve  # noqa: E402
from formingx.solve.linear import DirectSolver  # noqa: E402

SIZES = {"inflation": [(20, 1), (40, 2), (80, 4)], "cup": [(30, 1), (60, 2)]}
LARGE = {"inflation": [(160, 8), (320, 16), (1000, 55)], "cup": [(120, 4), (240, 8)]}


def inflation(elements):
    """Return the scene of Treloar's sheet, and a target far beyond its limit point."""
    mesh = fx.mesh.disc(radius=1.25, thickness=0.082, elements=elements)
    return fx.Scene(mesh=mesh, materials=fx.NeoHookean(c10=2.0), loads=[fx.Pressure("bottom")],
                    supports=[fx.Symmetry("axis"), fx.SimplySupported("rim")]), fx.pole_stretch(8.2)


def cup(elements):
    """Return the scene of a clamped sheet that sticks to a shallow cup, and its target."""
    mesh = fx.mesh.disc(radius=10.0, thickness=0.3, elements=elements)
    mould = fx.tools.cup(radius=10.0, depth=5.0, mouth=0.3, fillet=1.0)
    return fx.Scene(mesh=mesh, materials=fx.MooneyRivlin(c10=50.0, c01=15.0), loads=[fx.Pressure("bottom")],
                    supports=[fx.Symmetry("axis"), fx.Clamped("rim")],
                    contacts=[fx.Contact("top", mould, "stick")]), fx.pressure(30.0)


@contextlib.contextmanager
def clocked(*methods, clock=time.process_time):
    """Yield {name: list} with the processor seconds of each call of some methods, (class, name), while it is open.

    Another clock may be given.
    """
    spent = {name: [] for _, name in methods}

    def with_clock(function, calls):
        def called(*args, **options):
            began = clock()
            try:
                return function(*args, **options)
            finally:
                calls.append(clock() - began)
        return called
    with contextlib.ExitStack() as patches:
        for of, name in methods:
            patches.enter_context(mock.patch.object(of, name, with_clock(getattr(of, name), spent[name])))
        yield spent


def measure(case, elements, profile=None):
    """Return the cost of a run: set-up and path, its iterations, the linear algebra of one iteration, and the ratio.

    Set-up is the time of a run up to the unloaded state (forms, columns, the first factorisation with its analysis).
    The linear algebra is measured in the run itself, where other work empties the caches. "look ahead" is the time of
    `Curve.update_path_tangent` at a state.

    Args:
        profile: a `cProfile.Profile` that records the run, or None.
    """
    scene, target = case(elements)
    began = time.process_time()
    fx.trace(scene, until=fx.pressure(0.0), progress=False)
    setup = time.process_time() - began
    with clocked((Problem, "tangent"), (DirectSolver, "factorise"), (DirectSolver, "solve_all"),
                 (Curve, "update_path_tangent")) as spent, profile or contextlib.nullcontext():
        began = time.process_time()
        path = fx.trace(scene, until=target, step=fx.StepControl(target=8) if scene.contacts else None, progress=False)
        spent_on_path = time.process_time() - began - setup
    *linear, ahead = spent.values()
    tangent, factors, _ = (np.mean(calls[1:]) for calls in linear)                  # the first one is set-up
    solves = np.median(linear[2])                           # contact points that settle have more columns
    n = path.counts.iterations
    return {"unknowns": path.problem.n_unknowns, "states": len(path), "failed": path.counts.failures, "iterations": n,
            "set-up": setup, "path": spent_on_path, "tangent": tangent, "factors": factors, "two solves": solves,
            "all solves": sum(linear[2]),
            "look ahead": sum(ahead) / len(path), "ratio": spent_on_path / (n * (tangent + factors + solves))}


def main():
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--quick", action="store_true", help="the smallest mesh of each case")
    options.add_argument("--large", action="store_true", help="1e5 and 1e6 unknowns, too (minutes)")
    options.add_argument("--case", choices=SIZES, help="run this case alone")
    options.add_argument("--profile", action="store_true", help="list the functions that take the rest of the time")
    options.add_argument("--out", type=Path, default=Path("results/limit"))
    args = options.parse_args()
    results, head = [], f"{'':12}{'elements':>10}"
    for case in (inflation, cup):
        name = case.__name__
        if args.case not in (None, name):
            continue
        measure(case, (10, 1))                              # imports and forms
        for elements in SIZES[name][:1 if args.quick else None] + LARGE[name] * args.large:
            profile = cProfile.Profile(time.process_time) if args.profile else None
            found = measure(case, elements, profile)
            if not results:
                say(head + "".join(f"{column:>12}" for column in found))
            say(f"{name:12}{elements[0]:>6} x {elements[1]}" + "".join(f"{v:12.4g}" for v in found.values()))
            if profile:
                pstats.Stats(profile).sort_stats("tottime").print_stats(25)
            results.append({"case": name, "elements": list(elements), **found})
    files.write_summary(args.out / "summary.json", {"rows": results}, COMM)


if __name__ == "__main__":
    main()
