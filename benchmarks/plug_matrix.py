"""Push every plug with every friction into every sheet: does it reach three plug radii, and how exact is its force?

Flat plugs with four fillets, a sphere, a cone; mu from 0 to 10 and stick; r0/h0 from 5 to 300; elements as in
`plug_extremes`, and halved: 720 runs of seconds to minutes, in a shuffled order, each added to
results/plug_matrix/rows.csv. A new run continues with the missing rows; --minutes ends it after a time, and the rows so
far are a fair sample. Then it prints how many plugs arrived, what ended the others, their cost, and the change of the
force by halved elements.
"""

import argparse
import csv
import itertools
import random
import signal
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "demos"))
import numpy as np  # noqa: E402
import plugs  # noqa: E402
from plug_extremes import Plug, run  # noqa: E402

import formingx as fx  # noqa: E402

ENDS = {"flat 0.05": {"fillet": 0.05}, "flat 0.2": {"fillet": 0.2}, "flat 0.8": {"fillet": 0.8}, "flat h0/2": {},
        "sphere": {"fillet": 1.0}, "cone": {"fillet": 0.2, "cone": True}}        # fillets over the radius of the plug
FRICTIONS = ("frictionless", 0.05, 0.1, 0.2, 0.3, 0.5, 1.0, 3.0, 10.0, "stick")
SLENDERNESS = (5, 10, 20, 30, 100, 300)
AT = (1.0, 2.0, 3.0)                                         # travels over the radius of the plug
NAMES = ("end", "mu", "r0/h0", "refine", "reached", *(f"force at {t:g}" for t in AT), "jumps", "states", "iterations",
         "seconds", "ended")
KEY = 4                                                      # so many of them name a row


def plug(end, mu, slenderness, refine) -> Plug:
    """Return the plug of a row."""
    made = Plug(slenderness=slenderness, law=mu, refine=refine, **ENDS[end])
    if end == "flat h0/2":
        return made
    radius, _, thickness = made.lengths
    return Plug(**{**vars(made), "fillet": made.fillet * radius / thickness})


def row(key, seconds) -> list:
    """Return one row; it ends after `seconds` of processor time."""
    def late(*_):
        raise KeyboardInterrupt

    made = plug(*key)
    began = time.process_time()
    signal.signal(signal.SIGPROF, late)
    signal.setitimer(signal.ITIMER_PROF, seconds)
    try:
        path, end, _ = run(made, intermediate=AT[:-1])
    except fx.Interrupted as error:
        path, end = error.path, f"not done in {seconds} s of CPU time"
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
    radius = made.lengths[0]
    met = [path and path.target_state(fx.travel(t * radius)) for t in AT]
    forces = [f"{plugs.force(state):.6g}" if state else "" for state in met]
    reached = [0, *forces, 0, 0, 0] if path is None else [
        f"{path['travel'].max() / radius:.4g}", *forces, len(path.jumps), path.counts.steps, path.counts.iterations]
    return [*key, *reached, f"{time.process_time() - began:.1f}", end]


def tell(rows) -> None:
    """Print the findings of the table."""
    arrived = [r for r in rows if r["ended"] == "arrived"]
    print(f"{len(rows)} of {len(keys())} rows: {len(arrived)} arrived, {sum(r['jumps'] != '0' for r in rows)} with"
          " jumps; the others:")
    for r in rows:
        if r not in arrived:
            print("  " + ", ".join(f"{name} {r[name]}" for name in NAMES[:KEY + 1]), r["ended"][:120], sep=": ")
    for name in FRICTIONS:
        costs = [int(r["iterations"]) / int(r["states"]) for r in arrived if r["mu"] == str(name)]
        if costs:
            print(f"mu {name}: iterations per state {np.median(costs):.1f} in the median")
    by_key = {tuple(r[name] for name in NAMES[:KEY]): r for r in arrived}
    pairs = [(r, by_key[halved]) for (*key, refine), r in by_key.items()
             if refine == "1" and (halved := (*key, "2")) in by_key]
    for t in AT:
        change = [abs(float(a[f"force at {t:g}"]) / float(b[f"force at {t:g}"]) - 1) for a, b in pairs]
        if change:
            print(f"force at {t:g} plug radii, halved elements change it by {np.median(change):.2%} in the median,"
                  f" {np.max(change):.2%} at most ({sum(np.array(change) > 0.01)} of {len(change)} by more than 1 %)")


def keys() -> list:
    """Return the keys of all rows, shuffled; both meshes of a plug follow each other."""
    found = list(itertools.product(ENDS, FRICTIONS, SLENDERNESS))
    random.Random(1).shuffle(found)
    return [(*key, refine) for key in found for refine in (1, 2)]


def main():
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--minutes", type=float, default=600, help="time for all rows")
    options.add_argument("--row-seconds", type=int, default=600, help="processor time for one row")
    options.add_argument("--out", type=Path, default=Path("results/plug_matrix"), help="folder of the table")
    args = options.parse_args()
    args.out.mkdir(parents=True, exist_ok=True)
    file, end = args.out / "rows.csv", time.time() + 60 * args.minutes
    if not file.exists():
        file.write_text(",".join(NAMES) + "\n")
    with open(file, newline="") as table:
        done = {tuple(line[:KEY]) for line in csv.reader(table)}
    for key in keys():
        if tuple(map(str, key)) not in done and time.time() < end:
            with open(file, "a", newline="") as table:
                csv.writer(table).writerow(row(key, args.row_seconds))
    with open(file, newline="") as table:
        tell(list(csv.DictReader(table)))


if __name__ == "__main__":
    main()
