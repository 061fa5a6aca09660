"""Files that people open: CSV of a path and of a profile, JSON summaries. Rank 0 writes, whole files or none."""

from __future__ import annotations

import csv
import json
import os
import platform
from collections.abc import Iterable, Sequence
from pathlib import Path as FilePath
from typing import Any

import numpy as np


def write_path(path: Any, file: Any) -> None:
    """One row per state: stage (of a process), kind, iterations, then every measure of the path."""
    staged = any(s.stage for s in path.states)
    rows = [[*[s.stage] * staged, s.kind, max(len(s.history) - 1, 0), *(s.measures[c] for c in path.columns)]
            for s in path.states]
    write_rows(file, [*["stage"] * staged, "kind", "iterations", *path.columns], rows, path.problem.comm)


def write_profile(profile: Any, file: Any, comm: Any) -> None:
    """One row per node of the bottom face: where it was, arc length, both deformed faces, thickness, its ratio."""
    columns = ["reference_radius", "reference_length", "arc_length", "r_bottom", "z_bottom", "r_top", "z_top",
               "thickness", "thickness_ratio"]
    table = np.column_stack([profile.reference_radius, profile.reference_length, profile.arc_length, profile.bottom,
                             profile.top, profile.thickness, profile.thickness_ratio])
    write_rows(file, columns, table.tolist(), comm)


def write_rows(file: Any, header: Sequence[str], rows: Iterable[Sequence[Any]], comm: Any) -> None:
    """A CSV file with a header; numbers with all their digits."""
    if comm.rank != 0:
        return

    def write(stream):
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(header)
        for row in rows:
            writer.writerow([repr(float(v)) if isinstance(v, (float, np.floating)) else v for v in row])
    _replace(file, write)


def write_summary(file: Any, summary: dict[str, Any], comm: Any) -> None:
    """A JSON file of key numbers; NaN is refused."""
    if comm.rank == 0:
        text = json.dumps(summary, indent=2, allow_nan=False, default=float) + "\n"
        _replace(file, lambda stream: stream.write(text))


def versions() -> dict[str, str]:
    """Versions of what a result depends on."""
    import dolfinx
    import petsc4py
    from petsc4py import PETSc
    return {"dolfinx": dolfinx.__version__, "petsc": ".".join(map(str, PETSc.Sys.getVersion())),
            "petsc4py": petsc4py.__version__, "numpy": np.__version__, "python": platform.python_version()}


def _replace(file: Any, write: Any) -> None:
    """Write beside the file, then rename: an earlier file survives a failure."""
    file = FilePath(file)
    file.parent.mkdir(parents=True, exist_ok=True)
    part = file.with_name(file.name + ".part")
    try:
        with open(part, "w", newline="") as stream:
            write(stream)
        os.replace(part, file)
    except BaseException as error:
        part.unlink(missing_ok=True)
        if isinstance(error, OSError) and error.filename is None:           # a full disk does not say which file
            raise type(error)(error.errno, error.strerror, str(file)) from None
        raise
