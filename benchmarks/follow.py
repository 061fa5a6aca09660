"""Follow the steps of a run through the package: functions, files, and calls from one file to another.

    ./fx python3 benchmarks/follow.py [stick | free | COEFFICIENT] [--step 12] [--pairs 20]

The run is a sheet blown into a cup with stick or Coulomb's friction, or free inflation. Counted is from one recorded
state to the next; the numbers are medians over all steps but the first five. `--step` lists the files of one step,
`--pairs` the pairs of files with most calls between them.
"""

import argparse
import collections
import logging
import statistics
import sys
from pathlib import Path

import formingx as fx

ROOT = str(Path(fx.__file__).parent)
SKIPPED = 5                                                  # first steps, in which forms are compiled and stored


def steps(friction):
    """Return for each step {(file, function): calls} and {(calling file, called file): calls}."""
    found, stack = [], []
    seen, moves = collections.Counter(), collections.Counter()

    def profile(frame, kind, arg):
        if kind not in ("call", "return") or not (file := frame.f_code.co_filename).startswith(ROOT):
            return
        if kind == "return":
            if stack:
                stack.pop()
            return
        name = file[len(ROOT) + 1:]
        if stack and stack[-1] != name:
            moves[stack[-1], name] += 1
        stack.append(name)
        seen[name, frame.f_code.co_qualname] += 1

    def mark(problem):
        """Close the step: recorded at every state."""
        found.append((seen.copy(), moves.copy()))
        seen.clear()
        moves.clear()
        return 0.0
    contacts = []
    if friction != "free":
        mould = fx.tools.cup(radius=10.0, depth=5.0, mouth=0.3, fillet=1.0)
        contacts = [fx.Contact("top", mould, friction if friction in ("stick", "none") else float(friction))]
    scene = fx.Scene(mesh=fx.mesh.disc(radius=10.0, thickness=0.3, elements=(30, 1)),
                     materials=fx.MooneyRivlin(c10=50.0, c01=15.0), loads=[fx.Pressure("bottom")], contacts=contacts,
                     supports=[fx.Symmetry("axis"), fx.Clamped("rim")])
    before = sys.getprofile()
    sys.setprofile(profile)
    try:
        fx.trace(scene, until=fx.pressure(60.0) if contacts else fx.pole_height(8.0), progress=False,
                 step=fx.StepControl(target=8), record={"mark": mark})
    finally:
        sys.setprofile(before)
    return found


def medians(found):
    """Return the median numbers of functions, of files and of calls from file to file in a step."""
    kept = found[SKIPPED:-1] or found
    counted = [(len(seen), len({file for file, _ in seen}), moves.total()) for seen, moves in kept]
    return tuple(int(statistics.median(column)) for column in zip(*counted))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("friction", nargs="?", default="stick")
    parser.add_argument("--step", type=int)
    parser.add_argument("--pairs", type=int, default=0)
    options = parser.parse_args()
    logging.disable(logging.CRITICAL)
    found = steps(options.friction)
    print("median step: {} functions, {} files, {} calls from file to file".format(*medians(found)))
    if options.step is not None:
        files = collections.Counter()
        for (file, _), calls in found[options.step][0].items():
            files[file] += calls
        for file, calls in files.most_common():
            print(f"{calls:8d} {file}")
    total = sum((moves for _, moves in found[SKIPPED:-1]), collections.Counter())
    for (a, b), calls in total.most_common(options.pairs):
        print(f"{calls / max(len(found[SKIPPED:-1]), 1):8.1f} {a} -> {b}")


if __name__ == "__main__":
    main()
