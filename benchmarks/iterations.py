"""Count Newton iterations for each state, over all paths of all demos: the cost of step control and contact.

    ./fx python3 benchmarks/iterations.py [--demos treloar cup] [--full]

Runs each demo with --quick (unless its summary is in the folder already) and reads states and iterations of each path
from its summary.json. Iterations of failed steps count, too.
"""

import argparse
import json
from pathlib import Path
from statistics import median

from all_demos import NAMES, run_demo

SECONDS = 600                                               # that a demo may take


def paths(summary, name=""):
    """Yield (name, states, iterations) of every path in a summary."""
    if isinstance(summary, dict):
        if "steps" in summary and "newton_iterations" in summary:
            yield name, summary["steps"], summary["newton_iterations"]
        for key, value in summary.items():
            yield from paths(value, f"{name} {key}".strip())
    elif isinstance(summary, list):
        for k, value in enumerate(summary):
            yield from paths(value, f"{name} {k}")


def main():
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--demos", nargs="+", choices=NAMES, default=NAMES)
    options.add_argument("--full", action="store_true", help="run the demos without --quick")
    options.add_argument("--out", type=Path, default=Path("results/iterations"), help="folder of the demos' results")
    args = options.parse_args()
    found = []
    for demo in args.demos:
        summary = args.out / demo / "summary.json"
        if not summary.exists() and (why := run_demo(demo, summary.parent, not args.full, SECONDS)):
            print(f"{demo}: left out: {why}", flush=True)
            continue
        for name, states, iterations in paths(json.loads(summary.read_text())):
            if states:
                found.append(iterations / states)
                print(f"{demo + ' ' + name:60}{states:6g}{iterations:7g}{found[-1]:8.2f}", flush=True)
    print(f"{len(found)} paths: median {median(found):.2f}, from {min(found):.2f} to {max(found):.2f}")


if __name__ == "__main__":
    main()
