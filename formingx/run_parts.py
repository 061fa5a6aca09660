"""Parts that all runs share: a new path, its checkpoints, its errors, and the first run of an adapted mesh."""

from __future__ import annotations

import contextlib
import copy
import logging
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

from .errors import ConvergenceError, InputError, Interrupted, check_name, check_type, file_path
from .findings import Finding, log_findings
from .measures.columns import Measure
from .problem.problem import Problem
from .results import files
from .results.files.checkpoint import Checkpoint, holds_states, read
from .results.files.checkpoint_data import PILOT, ended
from .results.files.checkpoint_stages import check_stages, write_stages
from .results.path import Path
from .run_hooks import adaptation
from .scene.scene import Scene
from .solve.arc_length import Curve
from .solve.record import Record
from .solve.stage import Plan, Stage
from .solve.state import State

log = logging.getLogger("formingx")


def run_on_adapted_mesh(caller: str, adapt_mesh: Any, start: Any, resume: bool, scene: Scene, checkpoint: Any,
                        run: Callable[[Scene, Any, bool], Path]) -> Path:
    """Return the path of a run on a mesh that is adapted to a first run, `Path.pilot`, kept in the folder "pilot".

    adapt_mesh, start, resume, checkpoint: arguments of `caller`. `run` maps a scene, a checkpoint and `resume` to a
    path. Raise `InputError` for an argument that is not allowed, `ConvergenceError` if the second run failed, or the
    first with fewer than three states.
    """
    if start is not None:
        raise InputError(f"{caller}: adapt_mesh={adapt_mesh!r}: a pilot run begins with the unloaded body and makes"
                         f" the mesh; with start a run continues on its own mesh: give only one of them")
    if adapt_mesh is not True and not isinstance(adapt_mesh, Mapping):
        raise InputError(f"{caller}: adapt_mesh = {adapt_mesh!r}: must be True, False or arguments of mesh.adapted,"
                         f" such as {{'error': 0.02}}")
    options = {} if adapt_mesh is True else dict(adapt_mesh)
    meshes = adaptation(caller)
    for name in options:
        check_name(f"{caller}: adapt_mesh", name, ("max_rotation", "error"))
    meshes.check(scene.mesh)
    folder = None if checkpoint is None else file_path("checkpoint", checkpoint) / PILOT
    first = _stored_pilot(folder, scene) if resume else None
    try:
        first = first or run(scene, folder, resume)
    except ConvergenceError as error:
        if error.path is None or len(error.path) < 3:
            raise
        first = error.path
        log.warning("the pilot run ended early, at %s; the mesh is adapted to its states",
                    first.record.describe(first.last))
    # a resumed run reads the stored states, so its mesh is made from them, too
    adapted = meshes.make(first if folder is None else _stored_pilot(folder, scene) or first, options)
    log.info("pilot run: %d states on %d elements; adapted: %d", len(first), *(
        mesh.domain.topology.index_map(2).size_global for mesh in (scene.mesh, adapted)))
    path = run(scene.with_mesh(adapted), checkpoint, resume)
    path.pilot = first
    return path


def _stored_pilot(folder: Any, scene: Scene) -> Path | None:
    """Return the path of a pilot run that has ended, from the checkpoint `folder`; None without one; collective."""
    comm = scene.mesh.comm
    if folder is None or not holds_states(folder, comm) or not files.on_root(comm, lambda: ended(folder) is not None):
        return None
    path = Path(read(folder, scene, resumes=True))
    return path if len(path) > 2 else None


def check_start(state: State, stages: list[Stage], problem: Problem) -> None:
    """Raise `InputError` if a state belongs to another scene, or to none of the stages of a process."""
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
    """Return a new path from `start`, a path, state or None; columns: `record` of `trace`; found: findings, logged."""
    record = Record(curve.problem, curve)
    record.findings = found
    log_findings(found, curve.problem.comm.rank)
    record.allow_inadmissible = check_type("allow_inadmissible", allow_inadmissible, bool, "True or False")
    if isinstance(start, Path):
        record.continue_from(start.record)
    elif start is not None:
        record.segments[-1].states.append(start)
    return Path(record, timed=timed, columns=columns, other=start if isinstance(start, Path) else None)


def write_checkpoints(path: Path, checkpoint: Any, plans: Sequence[Plan] = ()) -> None:
    """Register functions that write a checkpoint after each step and at the end of a run; None: no checkpoint."""
    if checkpoint is not None:
        writer = Checkpoint(checkpoint, path)
        if plans:
            write_stages(writer.folder, plans, path.problem.comm)
        path.record.hooks.on_step.append(writer.write)
        path.record.hooks.on_end.append(writer.end)


def first_path(caller: str, resume: bool, checkpoint: Any, scene: Scene, start: Any,
               plans: Sequence[Plan] = ()) -> Any:
    """Return the path that a run continues: `start`, or with `resume` the path in the checkpoint, or None.

    InputError: `resume` with `start`, without a checkpoint, or for other stages; `caller`: for the message.
    """
    if not resume:
        return start
    if checkpoint is None or start is not None:
        raise InputError(f"{caller}: resume=True: give a checkpoint to continue from, and no start")
    if not holds_states(checkpoint, scene.mesh.comm):
        return None
    path = Path(read(checkpoint, scene, resumes=True))
    if plans:
        check_stages(file_path("checkpoint", checkpoint), plans, path.last.setting["stage"], path.last.time,
                     scene.mesh.comm)
    return path


@contextlib.contextmanager
def run_errors(checkpoint: Any = None) -> Iterator[Callable[[Path], Path]]:
    """Attach the path, which the yielded function registers and returns, to the errors of a run in a block.

    At the end of the block `path.record.hooks.on_end` are called. `ConvergenceError` (without the traceback of the
    solver), `InputError`, `Interrupted` and errors of a script's functions, such as a material or a column, pass on.
    """
    paths: list[Path] = []

    def register(path: Path) -> Path:
        """Register the path of the run, and return it."""
        paths.append(path)
        return path

    def first_with_states() -> Path | None:
        """Return the first registered path that has a state, or None."""
        return next((path for path in paths if path.states), None)

    try:
        yield register
    except (ConvergenceError, InputError) as error:
        error.path = path = first_with_states()
        if path is not None and isinstance(error, ConvergenceError):       # all ranks raise it
            _call_listeners(path, str(error), path.findings() if path.record.hooks.on_end else [])
        if isinstance(error, ConvergenceError) and error.diagnosis is not None:
            without_traceback = copy.copy(error)            # the diagnosis names the cause
            raise without_traceback from None
        raise
    except Exception as error:                              # such as a function of the script that fails in a state
        path = first_with_states()
        if path is not None:
            error.path = path                               # type: ignore[attr-defined]
            error.add_note(f"`error.path` has the {len(path)} states before it, up to"
                           f" {path.record.describe(path.last)}")
        raise
    except KeyboardInterrupt:
        path = first_with_states()
        if path is None:
            raise Interrupted("interrupted before its first state") from None
        position = f"at {path.record.describe(path.last)}, after {len(path)} states"
        advice = "it is lost; with checkpoint='folder', resume=True the same script would continue from there"
        if checkpoint:
            advice = f"checkpoint={str(checkpoint)!r} holds it: the same script continues with resume=True"
        raise Interrupted(f"interrupted {position}; {advice}", path) from None
    path = paths[0]
    found = path.findings()
    log_findings([finding for finding in found if finding not in path.record.findings], path.problem.comm.rank)
    _call_listeners(path, "", found)


def _call_listeners(path: Path, failure: str, found: list[Finding]) -> None:
    """Call `path.record.hooks.on_end` with the error message of a failed run, or "", and the findings."""
    for listener in path.record.hooks.on_end:
        listener(failure, found)
