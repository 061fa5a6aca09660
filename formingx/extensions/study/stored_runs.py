"""Folder in which a parameter study stores its runs."""

from __future__ import annotations

import json
import math
import re
import zlib
from dataclasses import asdict
from pathlib import Path as FilePath
from typing import Any

from ...errors import InputError
from ...results.files import replace
from .task import StudyRun, Task


def prepare_folder(folder: FilePath, task: Task, variables: list[str]) -> FilePath:
    """Make the folder of a study, or check that an existing folder belongs to it, and return its path.

    The names of variables and of the task's functions must be those stored; another study is an InputError.
    """
    about = {"study": 1, "build": getattr(task.build, "__qualname__", ""), "variables": variables,
             "measures": list(task.measures)}
    file = folder / "study.json"
    if file.exists():
        stored = _json(file)
        if stored != about:
            raise InputError(f"study: folder {str(folder)!r} holds another study: {stored}; here: {about}")
    elif folder.exists() and any(folder.iterdir()):
        raise InputError(f"study: folder {str(folder)!r} is there already and holds no study")
    else:
        replace(file, lambda stream: json.dump(about, stream, indent=1))
    return folder


def read(folder: FilePath, variables: list[str]) -> list[StudyRun]:
    """Return stored runs in order, repeated ones (after a fault of the script) once; an unreadable file: InputError."""
    found: list[StudyRun] = []                                  # of runs with equal values the first final one counts
    for file in sorted(_files(folder)):
        try:
            run = StudyRun(**_json(file))
            valid = (set(run.values) == set(variables) and isinstance(run.error, str)
                     and all(math.isfinite(v) for v in (*run.values.values(), *run.measures.values(), run.seconds)))
        except (TypeError, AttributeError):
            valid = False
        if not valid:
            raise InputError(f"study: {str(file)!r} is damaged: it holds no run of this study; remove it, and the run"
                             f" is made again")
        found = [other for other in found if other.is_final or other.values != run.values]
        found += [run] if all(run.values != other.values for other in found) else []
    return found


def write(folder: FilePath, run: StudyRun) -> None:
    """Write a run to a new file in the folder of a study."""
    # the number is one above the largest; the checksum distinguishes files of two processes with one number
    last = max((int(file.name[4:9]) for file in _files(folder)), default=-1)
    values = zlib.crc32(json.dumps(run.values, sort_keys=True).encode())
    file = folder / f"run-{last + 1:05d}-{values:08x}.json"
    replace(file, lambda stream: json.dump(asdict(run), stream, indent=1))


def _files(folder: FilePath) -> list[FilePath]:
    """Return the files of runs in the folder of a study."""
    return [file for file in folder.glob("run-*.json") if re.match(r"run-[0-9]{5}[-.]", file.name)]


def _json(file: FilePath) -> Any:
    """Return the content of a JSON file; raise an InputError if it cannot be read."""
    try:
        return json.loads(file.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError) as error:
        raise InputError(f"study: {str(file)!r} is damaged or cannot be read: {error}; remove it, and what it held is"
                         f" made again") from None
