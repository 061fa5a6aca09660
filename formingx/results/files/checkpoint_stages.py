"""Stages of a process in its checkpoint: a run that resumes must have the stages by which the stored states were made.

    run/stages.json       the stages of the process, as data; missing for a run by `trace`.
"""

import json
from collections.abc import Sequence
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from ...errors import InputError
from .. import files
from .checkpoint_data import named_os_errors, read_json
from .description import differences
from .functions import described

STAGES = "stages.json"
_MAY_CHANGE = ("until", "intermediate", "duration", "tables")
"""Entries that may differ in the last stage of the stored states, which continues to another end."""


def describe_stages(plans: Sequence[Any]) -> list[dict[str, Any]]:
    """Return the stages of a process as JSON data."""
    return json.loads(json.dumps([_describe(plan) for plan in plans]))


def write_stages(folder: FilePath, plans: Sequence[Any], comm: Any) -> None:
    """Write the stages of a process into the folder of its checkpoint; collective. Raises OSError."""
    about = {"stages": describe_stages(plans)}
    files.on_root(comm, lambda: named_os_errors(
        lambda: files.replace(folder / STAGES, lambda stream: json.dump(about, stream, indent=1)),
        folder, f"{STAGES} could not be written"))


def check_stages(folder: FilePath, plans: Sequence[Any], number: int, now: float, comm: Any) -> None:
    """Check that a process has the stages by which the states of a checkpoint were made; collective.

    Stage `number`, at process time `now`, may go on to another end. The first difference is an InputError.
    """
    def check():
        if not (folder / STAGES).exists():
            raise InputError(f"checkpoint {str(folder)!r} has no {STAGES}, by which its stages are compared: it is not"
                             f" of a process with checkpoint=..., or the file was removed; go on from it with"
                             f" start=fx.load({str(folder)!r}, scene), or remove the folder")
        stored, here = read_json(folder / STAGES)["stages"], describe_stages(plans)
        if number >= len(here):
            found = (f"its last state is of stage {number + 1}, {stored[number]['name']!r}, but the process has"
                     f" {len(here)} now")
        else:
            found = next((f"stage {a['name']!r}: {fault}" for k, (a, b) in enumerate(zip(stored[:number + 1], here))
                          if (fault := _difference(a, b, now if k == number else None))), "")
        if found:
            raise InputError(f"checkpoint {str(folder)!r} is of another process: {found}: give another folder, or"
                             f" remove it")
    files.on_root(comm, check)


def _difference(there: dict[str, Any], here: dict[str, Any], now: float | None) -> str:
    """Return the first difference of two stages as text, or ""; `now` is the time run so far, None at its end."""
    found = [f"{where} = {a!r} there, {b!r} here" for where, a, b in differences(there, here)
             if now is None or where.split("[")[0] not in _MAY_CHANGE]
    if not found and now is not None and not _same_until(there["tables"], here["tables"], now):
        found = [f"the amplitudes differ before the process time {now:g}, that of the last state"]
    return next(iter(found), "")


def _describe(plan: Any) -> dict[str, Any]:
    """Return a stage as JSON data; items of the scene are given by their numbers in `Scene.items`."""
    stage = plan.stage

    def target(value: Any) -> Any:
        return None if value is None else f"{value.name} {value.value!r}"
    quantity, amplitude = stage.prescribed or (None, None)
    return {"name": stage.name, "control": plan.numbers, "inactive": plan.inactive, "speed": stage.speed,
            "duration": stage.duration, "until": target(stage.until), "constant": target(stage.constant),
            "intermediate": [target(t) for t in stage.intermediate], "at_limit_point": stage.at_limit_point,
            "tables": [[i, table.tolist()] for i, table in plan.tables],
            "measure": quantity and quantity(0.0).name,
            "function_of_time": described(amplitude) if callable(amplitude) else None,
            "table_of_measure": amplitude.tolist() if isinstance(amplitude, np.ndarray) else None}


def _same_until(there: list[Any], here: list[Any], now: float) -> bool:
    """Return True if tables [[item, knots (time, value)]] of amplitudes agree up to the process time `now`."""
    if [number for number, _ in there] != [number for number, _ in here]:
        return False
    for (_, a), (_, b) in zip(there, here):
        a, b = np.array(a), np.array(b)
        times = [now, *(t for t in (*a[:, 0], *b[:, 0]) if t < now)]
        if a[0, 0] != b[0, 0] or not np.allclose(np.interp(times, *a.T), np.interp(times, *b.T), rtol=1e-9):
            return False
    return True
