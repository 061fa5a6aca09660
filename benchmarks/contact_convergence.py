"""Measure how the thickness of the cup of demos/cup.py converges with mesh, penalty and ramp, and the cost.

The error of a run is the largest |t - t_ref| / t_ref over the nodes up to one thickness from the clamped rim, whose
corner is singular. t_ref is the thickness in the last row of its group. The smallest thickness ratio is given, too.
"""

import argparse
import time
from pathlib import Path

import numpy as np
from contact_extremes import run
from mpi4py import MPI

import formingx as fx
from formingx.results import files

PRESSURES = (8.0, 30.0, 160.0)
MESHES = [(15, 1), (30, 1), (30, 2), (60, 1), (60, 2), (120, 2), (120, 4)]
GROUPS = {
    "mesh": [{"elements": n, "layers": m} for n, m in MESHES],
    "penalty": [{"penalty": 2.0 * 10**k} for k in range(1, 7)],
    "ramp": [{"ramp": 10.0**-k} for k in range(1, 7)],
}


def measure(elements, friction, case):
    """Return the thickness ratio by R at each pressure that was met, the path, seconds, and how it ended."""
    began = time.perf_counter()
    path, end = run(**{"elements": elements, **case}, friction=friction, pressures=PRESSURES)
    met = {p: path.target_state(fx.pressure(p)) for p in PRESSURES}
    profiles = {p: path.profile(state) for p, state in met.items() if state is not None}
    return profiles, path, time.perf_counter() - began, end


def error(profile, reference):
    """Return the largest relative difference in thickness, away from the rim."""
    R, h = profile.reference_radius, profile.original_thickness[0]
    exact = np.interp(R, reference.reference_radius, reference.thickness)
    return np.abs(profile.thickness / exact - 1)[R[-1] - h >= R].max()


def main():
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--elements", type=int, default=60, help="elements along the radius, for penalty and ramp")
    options.add_argument("--groups", nargs="+", choices=GROUPS, default=list(GROUPS), help="groups of rows")
    options.add_argument("--laws", nargs="+", choices=("stick", "none"), default=["stick", "none"],
                         help="laws of friction")
    options.add_argument("--out", type=Path, default=Path("results/contact_convergence"), help="folder for table.csv")
    args = options.parse_args()
    head = [f"error at {p:g} psi" for p in PRESSURES] + [f"least t/t0 at {p:g} psi" for p in PRESSURES]
    head += ["depth/h0", "states", "Newton", "cuts", "s"]
    rows = []
    for law in args.laws:
        for group in args.groups:
            runs = [(case, *measure(args.elements, law, case)) for case in GROUPS[group]]
            reference = runs[-1][1]
            print(f"\nfriction {law}, {group}", f"{'':>26}  error at psi: 8, 30, 160    least t/t0 there          "
                  "depth/h0   states Newton  cuts      s  end", sep="\n")
            for case, profiles, path, seconds, end in runs:
                label = ", ".join(f"{k} {v:g}" for k, v in case.items())
                errors = [error(profiles[p], reference[p]) if p in profiles and p in reference else None
                          for p in PRESSURES]
                least = [profiles[p].thickness_ratio.min() if p in profiles else None for p in PRESSURES]
                counts = path.counts
                numbers = [path["penetration"].max() / 0.3, counts.steps, counts.iterations, counts.failures, seconds]
                rows.append([law, label, *("" if v is None else v for v in errors + least), *numbers, end])
                print(f"{label:>26}" + "".join("       -" if e is None else f"{e:9.1e}" for e in errors)
                      + "".join("       -" if t is None else f"{t:9.5f}" for t in least)
                      + "{:10.1e}{:9d}{:7d}{:6d}{:7.1f}".format(*numbers) + f"  {end}", flush=True)
    files.write_rows(args.out / "table.csv", ["friction", "case", *head, "end"], rows, MPI.COMM_WORLD)


if __name__ == "__main__":
    main()
