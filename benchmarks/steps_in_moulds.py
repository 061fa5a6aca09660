"""Error of the wall that is due to the steps, in random moulds with stick and with friction.

    ./fx python3 benchmarks/steps_in_moulds.py [--seeds 100] [--first 200] [--out FOLDER]

The moulds are those of `random_moulds.py`, with the elements of accuracy "standard". The error is the largest relative
difference of the wall at a node to the wall of a run with one node a step, in steps of at most `FINEST`.
"""

import numpy as np
from mpi4py import MPI
from random_moulds import arguments, scene

import formingx as fx
from formingx.results import files

FINEST = 0.02                                                # dimensionless


def errors(run, sheet, targets=(4, 8)):
    """Return the errors of runs with each `StepControl.target` of `targets`, and their numbers of states."""
    def path(**steps):
        return run(fx.mesh.disc(**sheet, accuracy="standard"), **steps)
    fine = path(step=fx.StepControl(length=FINEST, largest=FINEST), nodes_per_step=1).profile().wall_thickness
    paths = [path(step=fx.StepControl(target=target)) for target in targets]
    return [(float(np.abs(p.profile().wall_thickness / fine - 1).max()), p.counts.steps) for p in paths]


def main():
    seeds, out = arguments(__doc__, "steps_in_moulds", 100, 200)
    found = {"stick": [], "friction": []}
    for seed in seeds:
        try:
            name, run, sheet = scene(seed)
        except fx.InputError:                                # its fillets do not fit
            continue
        if "none" not in name:
            (default, states), (longer, fewer) = errors(run, sheet)
            found["stick" if "stick" in name else "friction"].append((default, longer))
            print(f"{seed} {name:60} {default:.3%} in {states} states, target = 8: {longer:.3%} in {fewer}", flush=True)
    summary = {kind: {"moulds": len(rows), "median": float(np.median(rows, axis=0)[0]),
                      "largest": float(np.max(rows, axis=0)[0]), "largest_target_8": float(np.max(rows, axis=0)[1])}
               for kind, rows in found.items() if rows}
    files.write_summary(out / "summary.json", summary, MPI.COMM_WORLD)
    print(summary)


if __name__ == "__main__":
    main()
