"""Parts that all runs share: a new path, its checkpoints, its errors, and the first run of an adapted mesh."""

from __future__ import annotations

import contextlib
import copy
import logging
from collections.abc import Callable, Iterator, Mapping
from typing import Any

from .errors import ConvergenceError, InputError, Interrupted, instance, known
from .findings import Finding, tell
from .measures.columns import Measure
from .problem.problem import Problem
from .results.files.checkpoint import Checkpoint, holds_states, read
from .results.path import Path
from .run_hooks import adaptation
from .scene.scene import Scene
from .solve.arc_length import Curve
from .solve.record import Record
from .solve.stage import Stage
from .solve.state import State

log = logging.getLogger("formingx")


def run_on_adapted_mesh(caller: str, adapt_mesh: Any, start: Any, resume: bool, scene: Scene, checkpoint: Any,
                        run: Callable[[Scene, Any], Path]) -> Path:
    """Return the path of a run on the mesh that is adapted to a first run.

    Args:
        caller: name of the calling function, for messages.
        adapt_mesh: its argument.
        start: its argument; must be None.
        resume: its argument; must be False.
        scene: the scene on the first mesh.
        checkpoint: checkpoint of the second run.
        run: function of a scene and a checkpoint that returns the path of a run.

    Raises:
        InputError: an argument is not allowed.
        ConvergenceError: a run failed; a first run of three states or more is used nevertheless.
    """
    if start is not None or resume:
        raise InputError(f"{caller}: adapt_mesh={adapt_mesh!r}: a pilot run begins at rest and makes the mesh; with"
                         f" start or resume a run goes on with the mesh that it has: give only one of them")
    if adapt_mesh is not True and not isinstance(adapt_mesh, Mapping):
        raise InputError(f"{caller}: adapt_mesh = {adapt_mesh!r}: must be True, False or arguments of mesh.adapted,"
                         f" such as {{'error': 0.02}}")
    options = {} if adapt_mesh is True else dict(adapt_mesh)
    meshes = adaptation(caller)
    for name in options:
        known(f"{caller}: adapt_mesh", name, ("share", "error"))
    meshes.check(scene.mesh)
    try:
        first = run(scene, None)
    except ConvergenceError as error:
        if error.path is None or len(error.path) < 3:
            raise
        first = error.path
        log.warning("the pilot run ended early, at %s; the mesh is adapted to what it has"
                    " computed", first.describe(first.last))
    adapted = meshes.make(first, options)
    log.info("pilot run: %d states on %d elements; adapted: %d", len(first), *(
        mesh.domain.topology.index_map(2).size_global for mesh in (scene.mesh, adapted)))
    path = run(scene.with_mesh(adapted), checkpoint)
    path.pilot = first
    return path


def check_start(state: State, stages: list[Stage], problem: Problem) -> None:
    """Check that a process of given stages can continue from a state.

    Args:
        state: a `State` of the path.
        stages: all stages of the process.
        problem: the discretised problem.

    Raises:
        InputError: the state belongs to another scene or stage.
    """
    number = state.setting.get("stage", -1)
    if len(state.x) != problem.x.getLocalSize() or not 0 <= number < len(stages):
        raise InputError("Process: start: must be a path of this process: its last state belongs to another scene or"
                         " stage")
    if stages[number].name != state.stage:
        raise InputError(f"Process: start: its last state is of stage {state.stage!r}, number {number + 1}, but"
                         f" stage {number + 1} is {stages[number].name!r} now: give all stages of the"
                         f" process, also those that are done")


def new_path(curve: Curve, start: Path | State | None, columns: Mapping[str, Measure] | None, allow_inadmissible: bool,
             found: list[Finding], timed: bool = False) -> Path:
    """Return a new path that begins with the states of another path, or with a state.

    Args:
        curve: solver of its states.
        start: the path, or the state; None to begin without states.
        columns: additional columns.
        allow_inadmissible: see `trace`.
        found: findings of the checks before the run, which are logged here.
        timed: True if the process time is a column.
    """
    record = Record(curve.problem, curve)
    record.findings = found
    tell(found, curve.problem.comm.rank)
    record.allow_inadmissible = instance("allow_inadmissible", allow_inadmissible, bool, "True or False")
    if isinstance(start, Path):
        record.go_on_from(start.record)
    elif start is not None:
        record.segments[-1].states.append(start)
    return Path(record, timed=timed, columns=columns)


def write_checkpoints(path: Path, checkpoint: Any) -> None:
    """Register a checkpoint that is written after each step.

    Args:
        path: path of the run.
        checkpoint: the folder, or None.
    """
    if checkpoint is not None:
        writer = Checkpoint(checkpoint, path)
        path.record.hooks.on_step.append(writer.write)
        path.record.hooks.on_end.append(writer.end)


def first_path(caller: str, resume: bool, checkpoint: Any, scene: Scene, start: Any) -> Any:
    """Return the path that a run continues: `start`, or with `resume` the path in its checkpoint, or None.

    Args:
        caller: name of the calling function, for messages.
        resume: its argument.
        checkpoint: its argument.
        scene: the scene.
        start: its argument.

    Raises:
        InputError: `resume` is given together with `start`, or without a checkpoint.
    """
    if not resume:
        return start
    if checkpoint is None or start is not None:
        raise InputError(f"{caller}: resume=True: give a checkpoint to go on from, and no start")
    return Path(read(checkpoint, scene)) if holds_states(checkpoint, scene.mesh.comm) else None


@contextlib.contextmanager
def run_errors(checkpoint: Any = None) -> Iterator[Callable[[Path], Path]]:
    """Attach the path so far to the errors of a run within a block, and call its end listeners.

    Args:
        checkpoint: the folder, for messages; or None.

    Yields:
        Function that registers and returns the path of the run.

    Raises:
        ConvergenceError: the run failed; without the traceback of the solver.
        InputError: a stage was refused during the run.
        Interrupted: Ctrl-C was pressed.
    """
    paths: list[Path] = []

    def register(path: Path) -> Path:
        """Return the path of the run after registering it."""
        paths.append(path)
        return path

    def so_far() -> Path | None:
        """Return the first path with a state, or None."""
        return next((path for path in paths if path.states), None)

    try:
        yield register
    except (ConvergenceError, InputError) as error:
        error.path = path = so_far()
        if path is not None and isinstance(error, ConvergenceError):       # on all ranks
            _call_listeners(path, str(error), path.findings() if path.record.hooks.on_end else [])
        if isinstance(error, ConvergenceError) and error.diagnosis is not None:
            without_traceback = copy.copy(error)            # the diagnosis names the cause
            raise without_traceback from None
        raise
    except KeyboardInterrupt:
        path = so_far()
        if path is None:
            raise Interrupted("interrupted before its first state") from None
        position = f"at {path.describe(path.last)}, after {len(path)} states"
        advice = "it is lost; with checkpoint='folder', resume=True the same script would go on from there"
        if checkpoint:
            advice = f"checkpoint={str(checkpoint)!r} holds it: the same script goes on with resume=True"
        raise Interrupted(f"interrupted {position}; {advice}", path) from None
    path = paths[0]
    found = path.findings()
    tell([finding for finding in found if finding not in path.record.findings], path.problem.comm.rank)
    _call_listeners(path, "", found)


def _call_listeners(path: Path, failure: str, found: list[Finding]) -> None:
    """Call the listeners at the end of a run with the error message, or "", and the findings."""
    for listener in path.record.hooks.on_end:
        listener(failure, found)
