"""Reading of the files of a checkpoint folder without a scene; the module `checkpoint` describes the files."""

import itertools
import json
import time
import zlib
from collections.abc import Callable
from dataclasses import fields
from pathlib import Path as FilePath
from typing import Any

from mpi4py import MPI

from ...errors import InputError, file_path
from ...findings import SEVERITIES, Finding
from ...solve.state import State
from .arrays import unpack
from .description import differences
from .progress import progress

FORMAT = 12  # number of the format of the files, in scene.json
FIELDS = ("x", "direction")
HISTORIES = ("history_variables", "history_variables_before")
ARRAYS = "arrays.bin"
END = "end.json"
PILOT = "pilot"
"""Folder in a checkpoint with the checkpoint of the run to which its mesh was adapted."""


def begun(folder: Any) -> bool:
    """Return True if a checkpoint holds a complete state; a folder of other files is an InputError."""
    folder = file_path("checkpoint", folder)
    if not folder.exists() or folder.is_dir() and all(entry.suffix == ".part" for entry in folder.iterdir()):
        return False
    read_json(folder / "scene.json")
    return bool(complete_states(folder))


def latest(folder: Any, count: int) -> tuple[int, list[dict[str, Any]], float]:
    """Return count of states, attributes of the last `count` states, and seconds since the last was written.

    A run may still be writing. A missing, empty or damaged checkpoint is an InputError.
    """
    folder = file_path("checkpoint", folder)
    _check_format(folder, read_json(folder / "scene.json"))
    n = len(complete_states(folder))
    if not n:
        raise InputError(f"checkpoint {str(folder)!r} holds no state")
    age = max(time.time() - (folder / state_name(n - 1) / "state.json").stat().st_mtime, 0.0)
    return n, [read_data(folder, k, checksums=False) for k in range(max(n - count, 0), n)], age


def ended(folder: Any) -> dict[str, Any] | None:
    """Return {"failure": message or "", "findings": [Finding]} at the end of a run; None if it has not ended.

    Older checkpoints without the file give None, too; a damaged file is an InputError.
    """
    file = file_path("checkpoint", folder) / END
    if not file.exists():
        return None
    found = read_json(file)
    rows = found.get("findings")
    if not (isinstance(found.get("failure"), str) and isinstance(rows, list) and all(
            isinstance(row, list) and list(map(type, row)) == [str] * 4 and row[0] in SEVERITIES for row in rows)):
        raise InputError(f"checkpoint: {str(file)!r} is damaged: it does not say how the run ended")
    return {"failure": found["failure"], "findings": [Finding(*entry) for entry in rows]}


def contents(folder: Any) -> tuple[dict[str, Any], list[dict[str, Any]]]:
    """Return scene.json with `ended`, and states' attributes, for reports; a damaged checkpoint is an InputError."""
    folder = file_path("checkpoint", folder)
    about = read_json(folder / "scene.json")
    _check_format(folder, about)
    states = read_states(folder, len(complete_states(folder)), MPI.COMM_WORLD)
    if not states:
        raise InputError(f"checkpoint {str(folder)!r} holds no state")
    return about | {"ended": ended(folder)}, states


def read_states(folder: FilePath, count: int, comm: Any) -> list[dict]:
    """Return the data of the first `count` states, {name: value} each, with a progress bar; not collective."""
    found = []
    with progress(comm, f"{folder}: {count} states") as done:
        for k in range(count):
            found.append(read_data(folder, k))
            done((k + 1) / count)
    return found


def _check_format(folder: FilePath, about: dict) -> None:
    """Raise an InputError if this version cannot read the format of a checkpoint."""
    if about.get("formingx") != FORMAT:
        raise InputError(f"checkpoint {str(folder)!r} has the format {about.get('formingx')!r}; this version of"
                         f" formingx reads {FORMAT}")


def check_scene(folder: FilePath, about: dict, scene: dict) -> None:
    """Raise an InputError unless a checkpoint has a known format and the description `scene`, undamaged."""
    _check_format(folder, about)
    if not isinstance(about.get("scene"), dict):
        raise InputError(f"checkpoint {str(folder)!r} is damaged: scene.json has no description of the scene")
    found = list(differences(about["scene"], json.loads(json.dumps(scene))))
    if found:
        shown = "; ".join(itertools.starmap(_difference, found[:4]))
        further = f"; and {len(found) - 4} more" if len(found) > 4 else ""
        raise InputError(f"checkpoint {str(folder)!r} is of another scene: {shown}{further}")


def _difference(where: str, there: Any, here: Any) -> str:
    """Return a difference between two descriptions of a scene as text."""
    function, _, entry = where.rpartition(".")
    if entry == "code" and isinstance(there, str) and isinstance(here, str):
        return f"{function}: the code of the function differs"
    if isinstance(there, dict | list) or isinstance(here, dict | list):
        return f"{where}: {brief(there)} there, {brief(here)} here"
    return f"{where}: {there!r} there, {here!r} here"


def brief(value: Any) -> str:
    """Return JSON data as text of at most 80 characters."""
    text = repr(value)
    return text if len(text) <= 80 else f"{text[:77]}..."


def state_name(number: int) -> str:
    """Return the name of the folder of a state, such as "0012"."""
    return f"{number:04d}"


def complete_states(folder: FilePath) -> list[FilePath]:
    """Return the folders of the complete states of a checkpoint, in order. A missing state is an InputError."""
    names = (entry for entry in folder.iterdir() if entry.name.isascii() and entry.name.isdigit())
    found = sorted(names, key=lambda entry: int(entry.name))
    for k, entry in enumerate(found):
        if int(entry.name) != k:
            raise InputError(f"checkpoint {str(folder)!r} is damaged: state {k} is missing")
    return found


def read_data(folder: FilePath, number: int, checksums: bool = True) -> dict:
    """Return the data of a state of a checkpoint as {name: value}, with its arrays.

    They are attributes of the `State`, "memory" (history), "profile", "number", "checksums"; damage: InputError.
    """
    state_folder = folder / state_name(number)
    data = read_json(state_folder / "state.json")
    try:
        content = (state_folder / ARRAYS).read_bytes()
        missing = [f.name for f in fields(State) if f.name not in (*FIELDS, *HISTORIES) and f.name not in data]
        complete = not missing and data.get("number") == number and (
            not checksums or crc_sums(data, content) == data.get("checksums"))
        found = unpack(data, content) if complete else data
    except (OSError, ValueError, TypeError):
        complete, found = False, data
    if not complete:
        raise InputError(f"checkpoint {str(state_folder)!r} is damaged: its files are not those that were written"
                         f" (load's state= picks an earlier one)")
    return found


def read_json(file: FilePath) -> Any:
    """Return a dictionary from a JSON file of a checkpoint; otherwise an InputError."""
    try:
        with open(file, encoding="utf-8") as stream:
            found = json.load(stream)
    except FileNotFoundError:
        raise InputError(f"checkpoint: {_instead(file)}") from None
    except NotADirectoryError:
        raise InputError(f"checkpoint: {str(file.parent)!r} is not a folder") from None
    except (ValueError, OSError, RecursionError) as error:
        raise InputError(f"checkpoint: {str(file)!r} is damaged or cannot be read: {error}") from None
    if not isinstance(found, dict):
        raise InputError(f"checkpoint: {str(file)!r} is damaged or cannot be read: it holds no dictionary")
    return found


def _instead(file: FilePath) -> str:
    """Return a message that a file of a checkpoint is missing, with the files that are there instead."""
    folder = file.parent
    if file.name != "scene.json":
        return f"{str(file)!r} is not there"
    if not folder.exists():
        return f"there is no folder {str(folder)!r}"
    if not any(folder.iterdir()):
        return f"the folder {str(folder)!r} is empty"
    if (folder / "study.json").exists():
        return (f"{str(folder)!r} is the folder of a study: it keeps numbers of runs, not their states; the same"
                f" fx.study(..., folder=...) reads them, and its report() shows them")
    inside = sorted(entry.parent.name for entry in folder.glob("*/scene.json"))
    return f"{str(folder)!r} holds no run" + (f", but folders that do: {', '.join(inside[:5])}"
                                              f"{', ...' * (len(inside) > 5)}" if inside else "")


def crc_sums(data: dict, content: bytes) -> dict[str, int]:
    """Return {file: CRC-32 checksum} of state.json and the arrays of a state in a checkpoint."""
    summed = {key: value for key, value in data.items() if key != "checksums"}
    return {"state.json": zlib.crc32(json.dumps(summed, sort_keys=True).encode()), ARRAYS: zlib.crc32(content)}


def named_os_errors(action: Callable[[], Any], folder: FilePath, what: str) -> Any:
    """Call a function; an OSError of it gets the folder and the failed task `what` into its message."""
    try:
        return action()
    except OSError as error:
        raise OSError(error.errno, f"checkpoint {str(folder)!r}: {what}: {error.strerror}") from None
