"""Options, output folder and messages that all demos share."""

import argparse
import os
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context, parent_process
from pathlib import Path
from threading import Thread

from mpi4py import MPI

from formingx.results import files

COMM = MPI.COMM_WORLD


def parser(name: str, about: str, elements: int | None = None, layers: int | None = None,
           accuracy: float | None = None) -> argparse.ArgumentParser:
    """Return a parser with the options of all demos.

    --out and --quick always; --elements, --layers and --accuracy if a default is given.

    Args:
        name: name of the demo.
        about: its docstring; the first line is the description.
        elements: default of --elements, or None.
        layers: default of --layers, or None.
        accuracy: default of --accuracy, or None.
    """
    options = argparse.ArgumentParser(prog=f"demos/{name}.py", description=about.splitlines()[0],
                                      formatter_class=argparse.ArgumentDefaultsHelpFormatter)
    options.add_argument("--out", type=Path, default=Path("results") / name, help="folder for results")
    options.add_argument("--quick", action="store_true", help="coarse mesh and no 3-D view: takes seconds")
    if elements is not None:
        options.add_argument("--elements", type=int, default=elements, help="elements along the sheet")
    if layers is not None:
        options.add_argument("--layers", type=int, default=layers,
                             help="elements through the sheet, or through each of its layers")
    if accuracy is not None:
        options.add_argument("--accuracy", type=float, default=accuracy, help="relative error in time")
    return options


def say(*lines: str) -> None:
    """Print on rank 0."""
    if COMM.rank == 0:
        print(*lines, sep="\n", flush=True)


def save(figure, file: Path) -> None:
    """Save a matplotlib figure as PNG on rank 0."""
    if COMM.rank == 0:
        file.parent.mkdir(parents=True, exist_ok=True)
        figure.savefig(file, dpi=150)


def plain_ticks(axis, values) -> None:
    """Set those of the given ticks that a logarithmic axis reaches, written as plain numbers."""
    low, high = axis.get_view_interval()
    there = [v for v in values if low <= v <= high]
    axis.set_ticks(there, [f"{v:g}" for v in there])
    axis.set_ticks([], minor=True)


def sweep(function, cases: list) -> list:
    """Return function(case) of every case, computed in parallel: over the ranks, or on one rank in processes.

    The function must work on `MPI.COMM_SELF` and be importable by name.
    """
    if COMM.size > 1:
        found = COMM.allgather({k: function(cases[k]) for k in range(COMM.rank, len(cases), COMM.size)})
        return [next(part[k] for part in found if k in part) for k in range(len(cases))]
    with ProcessPoolExecutor(os.cpu_count(), mp_context=get_context("spawn"), initializer=_end_with_parent) as pool:
        return list(pool.map(function, cases))


def _end_with_parent() -> None:
    """End this process when its parent process has ended, because nobody waits for its results."""
    def wait() -> None:
        parent_process().join()
        os._exit(1)
    Thread(target=wait, daemon=True).start()


def summarise(out: Path, summary: dict) -> None:
    """Write OUT/summary.json and print the names of the files in OUT."""
    files.write_summary(out / "summary.json", summary, COMM)
    say(f"Results are in {out}/: " + ", ".join(sorted(f.name for f in out.iterdir())) if COMM.rank == 0 else "")
