"""Paths and profiles as CSV tables, and summaries as JSON. Rank 0 writes; a file is written whole or not at all."""

import csv
import json
import platform
from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numpy as np

from ...errors import InputError, file_path
from ...io.output import replace
from ...units import NONE, Units


def write_path(path: Any, file: Any, units: Units = NONE) -> None:
    """Write states as rows of a CSV file, with units in the header (`Path.to_csv`); a failed file is an OSError."""
    units = units.per_depth() if path.scene.kinematics.dimension_of_volume == 2 else units
    staged = any(s.stage for s in path.states)
    rows = [[*[s.stage] * staged, s.kind, max(len(s.history) - 1, 0), *(s.measures[c] for c in path.columns)]
            for s in path.states]
    write_rows(file, [*["stage"] * staged, "kind", "iterations", *map(units.heading, path.columns)], rows,
               path.problem.comm)


def write_profile(profile: Any, file: Any, comm: Any) -> None:
    """Write the bottom points of a `Profile` as rows of a CSV file on rank 0; a failed file is an OSError."""
    columns = ["reference_radius", "reference_length", "arc_length", "r_bottom", "z_bottom", "r_top", "z_top",
               "thickness", "thickness_ratio"]
    table = np.column_stack([profile.reference_radius, profile.reference_length, profile.arc_length, profile.bottom,
                             profile.top, profile.thickness, profile.thickness_ratio])
    write_rows(file, columns, table.tolist(), comm)


def write_rows(file: Any, header: Sequence[str], rows: Iterable[Sequence[Any]], comm: Any) -> None:
    """Write a CSV file with a header row and all digits on rank 0; another ending than .csv is an InputError."""
    file = named("to_csv", file, ".csv")

    def write(stream):
        writer, quoted = (csv.writer(stream, lineterminator="\n", quoting=style)
                          for style in (csv.QUOTE_MINIMAL, csv.QUOTE_ALL))     # a line that begins with # is a remark
        (quoted if any(mark in name for name in header for mark in ";\t") else writer).writerow(header)
        for row in rows:
            cells = [repr(float(v)) if isinstance(v, (float, np.floating)) else v for v in row]
            (quoted if str(cells[0]).lstrip().startswith("#") else writer).writerow(cells)
    on_root(comm, lambda: replace(file, write))


def write_summary(file: Any, summary: dict[str, Any], comm: Any) -> None:
    """Write key numbers as JSON on rank 0; a ValueError for nan or inf, an OSError for the file."""
    text = json.dumps(summary, indent=2, allow_nan=False, default=float) + "\n"
    on_root(comm, lambda: replace(file, lambda stream: stream.write(text)))


def versions() -> dict[str, str]:
    """Return {name of the program: version} of the programs that results depend on."""
    import dolfinx
    import petsc4py
    from petsc4py import PETSc
    return {"dolfinx": dolfinx.__version__, "petsc": ".".join(map(str, PETSc.Sys.getVersion())),
            "petsc4py": petsc4py.__version__, "numpy": np.__version__, "python": platform.python_version()}


def on_root(comm: Any, action: Callable[[], Any]) -> Any:
    """Call a function on rank 0 alone, and return its result, or raise its error, on all ranks; collective."""
    result, error = None, None
    if comm.rank == 0:
        try:
            result = action()
        except Exception as found:
            error = found
    if comm.size > 1:                                       # (alone, a message would be a copy)
        result, error = comm.bcast((result, error), root=0)
    if error is not None:
        raise error
    return result


def named(caller: str, file: Any, *endings: str) -> Any:
    """Return the name of a file as a `pathlib.Path`; an InputError by `caller` for another ending."""
    file = file_path(f"{caller}: file", file)
    if file.suffix.lower() not in endings:
        other = {".xlsx": "to_excel", ".csv": "to_csv"}.get(file.suffix.lower())
        raise InputError(f"{caller}: file {str(file)!r}: its name must end in {' or '.join(endings)}"
                         + (f"; {other} writes that" if other else ""))
    return file
