"""Curves of a STEP or BREP file, read by a separate process (`cad_process`)."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError
from . import cad_process
from .arcs import arcs_along, in_plane, piece_through
from .pieces import Arc, Line

_BASE_SECONDS = 10               # computing time allowed for a file, s
_BYTES_PER_SECOND = 50_000  # size of a file that adds one second, bytes


def curves(file: str, kind: str, tolerance: float | None) -> dict[int, Callable[[], list[Line | Arc]]]:
    """Return {number of a curve: function that returns its lines and arcs} of a "step" or "brep" file.

    `tolerance` is the distance of arcs that replace a spline or an ellipse; None forbids it. The function raises an
    InputError outside the plane or without a tolerance.
    """
    if kind == "step":
        _check_references(file)
    with _Reader(file, kind) as reader:
        return {tag: _of_curve(partial(reader.evaluate, tag), bounds, tolerance, f"tool file {file!r}: curve {tag}")
                for tag, bounds in reader.bounds.items()}


class _Reader:
    """Reader of a "step" or "brep" file in a process for a `with` block; bounds: {curve: [low, high parameter]}."""

    def __init__(self, file: str, kind: str):
        self._file, self._seconds = file, _BASE_SECONDS + os.path.getsize(file) // _BYTES_PER_SECOND
        # not a rank of a run under mpirun
        environment = {k: v for k, v in os.environ.items() if not k.startswith(("OMPI_COMM", "PMIX_", "PMI_", "PRTE_"))}
        self._process = subprocess.Popen(
            [sys.executable, "-P", cad_process.__file__, file, kind, str(self._seconds)], env=environment, text=True,
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)

    def __enter__(self) -> _Reader:
        """Return the reader, once the separate process has read the file and `bounds` has the curves."""
        try:
            self.bounds = {int(tag): ends for tag, ends in self._answer()["curves"].items()}
        except BaseException:
            self.__exit__()
            raise
        return self

    def __exit__(self, *_: Any) -> None:
        """End the separate process."""
        self._process.kill()
        self._process.communicate()

    def evaluate(self, tag: int, parameters: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return points and derivatives, (n, 3) each, of curve `tag` at parameters of shape (n,)."""
        points, derivatives = self._answer([tag, parameters.tolist()])
        return np.array(points).reshape(-1, 3), np.array(derivatives).reshape(-1, 3)

    def _answer(self, question: Any = None) -> Any:
        """Send a question to the separate process, if it is not None, and return its next line of output, as JSON data.

        An error, a crash or a timeout of the process is an InputError.
        """
        process, line = self._process, ""
        assert process.stdin is not None and process.stdout is not None
        try:
            if question is not None:
                process.stdin.write(json.dumps(question) + "\n")
                process.stdin.flush()
            line = process.stdout.readline()
        except BrokenPipeError:
            pass
        if not line.endswith("\n"):
            ended = process.wait()
            cause = (f"it took more than {self._seconds} s" if ended in (-signal.SIGXCPU, -signal.SIGKILL) else
                   f"Open CASCADE ended at it ({signal.Signals(-ended).name if ended < 0 else ended})")
            raise InputError(f"tool file {self._file!r} cannot be read: {cause}: is it damaged?")
        found = json.loads(line)
        if "error" in found:
            raise InputError(f"tool file {self._file!r} cannot be read: {found['error']}")
        return found


def _of_curve(evaluate: Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]], bounds: list[float],
              tolerance: float | None, name: str) -> Callable[[], list[Line | Arc]]:
    """Return a function that returns the lines and arcs of a curve, or raises the error of their computation.

    `evaluate`: parameters (n,) to points and derivatives, (n, 3) each. Without tolerance: lines and arcs only.
    """
    low, high = bounds

    def curve(t):
        points, derivatives = evaluate(low + (high - low) * t)
        return in_plane(points, name), derivatives[:, :2]
    try:
        try:
            pieces = [piece_through(curve(np.linspace(0, 1, 9))[0], name)]
        except InputError:
            if tolerance is None:
                raise
            pieces = arcs_along(curve, tolerance, name)
    except InputError as error:
        return partial(_raise, error)
    return lambda: pieces


def _raise(error: InputError) -> list[Line | Arc]:
    """Raise `error`; replaces the function that returns the pieces of a curve if the curve cannot be read."""
    raise error


def _check_references(file: str) -> None:
    """Raise an InputError unless a STEP file is whole, with all items once: readers leave parts out silently."""
    text = re.sub(r"'[^']*'|/\*.*?\*/", "", Path(file).read_bytes().decode("latin-1"), flags=re.DOTALL)
    if "END-ISO-10303-21" not in text:
        raise InputError(f"tool file {file!r} cannot be read: it has no end: it was cut off")
    for record in text.split(";"):
        if record.count("(") != record.count(")") or record.count("=") > 1 or _names_twice(record):
            raise InputError(f"tool file {file!r} cannot be read: the record {' '.join(record.split())[:60]!r} is not"
                             f" whole: it is damaged")
    if re.search(r"\bGLOBAL_UNIT_ASSIGNED_CONTEXT\s*\((?!\s*\(\s*#)", text):
        raise InputError(f"tool file {file!r} cannot be read: its units are lost: it is damaged")
    defined = re.findall(r"#(\d+)\s*=", text)
    used = set(re.findall(r"#(\d+)(?!\d|\s*=)", text))
    missing = used - set(defined)
    places = r"#(\d+)\s*=\s*(?:\([^;]*\bREPRESENTATION_RELATIONSHIP_WITH_|ITEM_DEFINED_)TRANSFORMATION\b"
    if unused := set(re.findall(places, text)) - used:
        raise InputError(f"tool file {file!r} cannot be read: nothing refers to #{min(unused, key=int)}, a"
                         f" transformation: what it moves has lost it, or is lost")
    if missing or len(set(defined)) < len(defined):
        what = f"refers to #{min(missing, key=int)}, which is not in it" if missing else "defines a number twice"
        raise InputError(f"tool file {file!r} cannot be read: it {what}: it is damaged")


def _names_twice(record: str) -> bool:
    """Return True if a record of several parts, #1 = ( A(...) B(...) ), contains a part twice."""
    parts = re.search(r"=\s*\((.*)\)\s*$", record, re.DOTALL)
    names, count = (parts[1] if parts else ""), 1
    while count:
        names, count = re.subn(r"\([^()]*\)", " ", names)
    return len(set(names.split())) < len(names.split())
