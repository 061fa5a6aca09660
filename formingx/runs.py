"""Runs: a path with one control, Newton's method at fixed control, a process in stages.

The solvers emit states; a `Path` and, if asked for, a `Checkpoint` are told of each.
"""

from __future__ import annotations

import contextlib
import copy
import logging
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

from .checks.check import before_run
from .errors import ConvergenceError, InputError, Interrupted, count, finite, instance, known, several
from .findings import Finding, tell
from .measures.columns import Measure
from .measures.targets import Amplitude, Target
from .physics.contact import Contact
from .problem.problem import Problem
from .results.files.checkpoint import Checkpoint, holds_states, read
from .results.path import Path
from .run_hooks import MeshRenewal, StopCondition, adaptation
from .scene import aims, clearance
from .scene.scene import Scene
from .solve.arc_length import Curve
from .solve.load_control import FixedControlCurve
from .solve.newton import Tolerances
from .solve.path_following import Run
from .solve.process import Execution, begin, is_done
from .solve.record import Record
from .solve.stage import AT_LIMIT_POINT, Plan, Stage, plan
from .solve.state import State
from .solve.stepping import StepControl
from .solve.stepping import allowed as allowed_error

log = logging.getLogger("formingx")


def trace(scene: Scene, *, until: Target, intermediate: Sequence[Target] = (), step: StepControl | None = None,
          tolerances: Tolerances | None = None, max_steps: int | None = None, progress: bool = True,
          start: Path | None = None, checkpoint: Any = None, record: Mapping[str, Measure] | None = None,
          at_limit_point: str | None = None, resume: bool = False, allow_inadmissible: bool = False,
          adapt_mesh: bool | Mapping[str, float] = False, remesh: MeshRenewal | None = None,
          stop_at: StopCondition | None = None) -> Path:
    """Follow the equilibrium path from the unloaded body until a target is reached, through limit points.

    Args:
        scene: with one controlled load, support or tool.
        until: the target that ends the run, such as `pole_stretch(8.5)`; met exactly.
        intermediate: more targets to meet exactly on the way; targets that are not met are left out.
        step: step control; default `StepControl()`.
        tolerances: convergence criteria of a state; default `Tolerances()`.
        max_steps: accepted states before the run gives up; None: it gives up when it comes no nearer to its target.
        progress: show a progress bar on runs of more than two seconds (rank 0).
        start: a path of this scene to continue, also one that `formingx.load` read; it is not changed. The step length
            continues unless `step` is given. Targets that the path has met count as met. The run goes back where
            another target lies behind its start, except for a pressure, which may return ahead.
        checkpoint: a folder to which every accepted state is written after each step, see `formingx.load`.
        record: {name: quantity} of additional columns: a function of the `Problem` at the state that returns a number,
            or a target such as `displacement(0, at=(1, 0))`, whose quantity is recorded.
        at_limit_point: action at a limit point of the control. "continue": continue along the path, on which the
            control turns back; in contact, or with history variables, the body snaps through where the path has no
            further state. "snap_through": the control continues, and the body snaps to its next equilibrium, see
            `Path.jumps`. "stop": end there. None: "continue", but "snap_through"
            for time and, with history variables (friction), for all controls but a growing pressure. In contact or with
            history variables a growing pressure is continued while the enclosed volume grows, as by an air supply.
        resume: continue from the states of the checkpoint, which must be of this scene; without states, begin.
        allow_inadmissible: continue, with a warning, at states that a body cannot have: folded, inside a tool, with
            inverted elements. `State.verdict` tells why; by default the run ends there.
        adapt_mesh: run twice: on the scene's mesh, which may be coarse, and again on `mesh.adapted(path)`, whose
            columns of elements suit the first run. True, or arguments of `adapted`, such as {"error": 0.02}.
            `Path.pilot` is the first run; it may have ended before the target.
        remesh: a `Remesh`: a new mesh of the deformed body replaces crushed elements; the states of kind "remesh" have
            the relative change of force, energy and volume in `jump`. For solids of one layer, on one rank.
        stop_at: `instability(modes=range(2, 9))`: end, as a result, once the body is unstable in one of these modes;
            `Path.ended` tells which.

    Raises:
        InputError: nothing is driven, a target needs something that the scene does not have or cannot be met (it is
            held, inside a tool, behind the start, beyond what a material can bear), `start` is of another scene, or the
            checkpoint holds another run.
        ConvergenceError: the target was not reached. It carries the path so far and says what to try.
        OSError: the checkpoint cannot be written; the states in it are kept.

    >>> path = fx.trace(scene, until=fx.pole_height(12.0), progress=False)
    >>> len(path.limit_points), round(float(path["pole_height"][-1]), 6)           # through the pressure maximum
    (1, 12.0)
    """
    instance("trace: scene", scene, Scene, "a formingx.Scene")
    if remesh is not None:
        instance("trace: remesh", remesh, MeshRenewal, "a formingx.Remesh")
        remesh.check("trace", scene, [*intermediate, until])
        if adapt_mesh is not False or stop_at is not None:
            raise InputError("trace: remesh: cannot be combined with adapt_mesh or stop_at")
    if adapt_mesh is not False:
        return _after_pilot("trace", adapt_mesh, start, resume, scene, checkpoint, lambda scene, checkpoint: trace(
            scene, until=until, intermediate=intermediate, step=step, tolerances=tolerances, max_steps=max_steps,
            progress=progress, checkpoint=checkpoint, record=record, at_limit_point=at_limit_point,
            allow_inadmissible=allow_inadmissible, stop_at=stop_at))
    intermediate = several("trace: intermediate", intermediate, "targets, such as pole_stretch(3)")
    for target in (until, *intermediate):
        instance("trace: target", target, Target, "a target, such as pole_stretch(3)")
        if target.name == "travel" and isinstance(scene.driven, Contact):
            scene.check_travel(scene.driven, target.value)
    instance("trace: step", step, StepControl | None, "a StepControl or None")
    instance("trace: tolerances", tolerances, Tolerances | None, "a Tolerances or None")
    instance("trace: progress", progress, bool, "True or False")
    instance("trace: stop_at", stop_at, StopCondition | None, "fx.instability(modes=...) or None")
    max_steps = None if max_steps is None else count("trace: max_steps", max_steps)
    known("trace: at_limit_point =", at_limit_point, AT_LIMIT_POINT)
    scene.only_driven("trace")
    aims.check(scene, [until, *intermediate])
    if start is not None and (not isinstance(start, Path) or start.scene is not scene or not start.states):
        raise InputError("trace: start: must be a path of this very scene: fx.load(folder, scene), or what trace gave"
                         " back")
    start = _from_checkpoint("trace", resume, checkpoint, scene, start)
    with _carried(checkpoint) as carried:
        problem = Problem(scene) if start is None else start.problem
        path = carried(_path(Curve(problem, tolerances or Tolerances()), start, record, allow_inadmissible,
                             before_run(scene, [*intermediate, until])))
        _keep(path, checkpoint)
        if stop_at is not None:
            stop_at.watch(path)

        def part() -> None:
            on_the_way = [target for target in intermediate if len(path.segments) == 1 or path.met(target) is None]
            targets = [(target, target.bind(path.problem)) for target in (*on_the_way, until)]
            run = Run(path.record, targets, step, at_limit_point)
            run.follow(max_steps, progress, None if path.states else begin(path.record.curve), may_turn=True)
        if remesh is None:
            part()
        else:
            remesh.follow(path, tolerances or Tolerances(), part,
                          lambda: path.last.met is not None and path.last.met[:2] == until[:2])
    return path


def solve(scene: Scene, *, to: float, increments: int = 1, tolerances: Tolerances | None = None, max_steps: int = 1000,
          record: Mapping[str, Measure] | None = None, allow_inadmissible: bool = False) -> Path:
    """Load the body to a value of the control in increments, each by PETSc's SNES at fixed control.

    For scenes without limit point before `to`; `trace` passes limit points and picks its own steps. Options such as
    -formingx_0_snes_monitor (0: the first such run of a script) reach the SNES.

    Args:
        to: value of the controlled quantity: pressure (stress) or travel (length).
        increments: number of equal increments; one that fails is halved, and new contact shortens them.
        tolerances: when a state counts as converged; default `Tolerances()`.
        max_steps: accepted states before the run gives up.
        record, allow_inadmissible: see `trace`.

    Raises:
        InputError: nothing is driven, or an argument is not allowed.
        ConvergenceError: an increment did not converge; it carries the path so far.

    >>> path = fx.solve(scene, to=0.02)
    >>> round(float(path["pressure"][-1]), 6)
    0.02
    """
    instance("solve: scene", scene, Scene, "a formingx.Scene")
    instance("solve: tolerances", tolerances, Tolerances | None, "a Tolerances or None")
    scene.only_driven("solve")
    to, increments = finite("solve: to", to), count("solve: increments", increments)
    max_steps = count("solve: max_steps", max_steps)
    if increments > max_steps:
        raise InputError(f"solve: increments = {increments}: must be at most max_steps = {max_steps}")
    if to == 0:
        raise InputError("solve: to = 0: the body is at rest there")
    driven = scene.items.index(scene.driven)
    name = scene.driven.quantity
    with _carried() as carried:
        problem = Problem(scene)
        curve = FixedControlCurve(problem, tolerances or Tolerances())
        path = carried(_path(curve, None, record, allow_inadmissible, before_run(scene, [Target(name, to, None)])))
        targets = [(Target(name, to * k / increments, None), Amplitude(problem, driven))
                   for k in range(1, increments + 1)]
        increment = abs(to / problem.forms.control_scale) / increments
        step = StepControl(length=1.01 * increment, largest=1.01 * increment, smallest=1e-5 * increment)
        Run(path.record, targets, step).follow(max_steps, False, begin(curve))
    return path


class Process:
    """Stages on one scene, run in order, each from the last state of the one before.

    A pressure, support or tool without a fixed value (`Pressure` without value, `PrescribedDisplacement`, `Contact`
    with `direction`) starts at 0. It keeps its value in stages that do not control it.

    Args:
        scene: with any number of controllable items.

    >>> air, plug = fx.Pressure("bottom"), fx.Contact("top", fx.tools.plane(2.0), "none", direction=(0, -1))
    >>> scene = fx.Scene(mesh=fx.mesh.disc(radius=10.0, thickness=0.5, elements=(8, 1)), loads=[air], contacts=[plug],
    ...                  materials=fx.NeoHookean(c10=0.4), supports=[fx.Symmetry("axis"), fx.SimplySupported("rim")])
    >>> path = fx.Process(scene).run([fx.Stage("blow", control=air, until=fx.pole_height(1.0)),
    ...                               fx.Stage("press", control=plug, until=fx.travel(1.0))])
    >>> round(float(path["pole_height"][-1]), 3), path.states[-1].stage
    (0.501, 'press')
    """

    def __init__(self, scene: Scene):
        self.scene = instance("Process: scene", scene, Scene, "a formingx.Scene")

    def run(self, stages: Sequence[Stage], *, step: StepControl | None = None, tolerances: Tolerances | None = None,
            max_steps: int | None = None, progress: bool = True, start: Path | State | None = None,
            checkpoint: Any = None, record: Mapping[str, Measure] | None = None,
            accuracy: str | float = "standard", resume: bool = False, allow_inadmissible: bool = False,
            adapt_mesh: bool | Mapping[str, float] = False, remesh: MeshRenewal | None = None) -> Path:
        """Run the stages; one path holds the states of all of them, every stage from a state of kind "start" on.

        Args:
            stages: in order.
            step: step control of the stages that have none of their own, at their start; default `StepControl()`. (Of a
                flow its lengths are parts of the duration.)
            tolerances: when a state counts as converged; default `Tolerances()`.
            max_steps: accepted states of a stage (of a straight piece of its tables) before the run gives up; None: it
                gives up when it comes no nearer to its target.
            progress: show a progress bar on runs of more than two seconds (rank 0).
            start: a path of these stages to continue from, also one that `formingx.load` read, or a state of one.
            checkpoint: a folder to which every accepted state is written after each step, see `formingx.load`.
            record: {name: measure} of columns of your own, see `trace`.
            accuracy: of the steps in time of a material that relaxes, "draft", "standard" or "fine" (1, 0.2, 0.03 % of
                stress and thickness), or such an error as a number.
            resume: continue from the states of the checkpoint, which must be of this process; if it holds nothing,
                begin.
            allow_inadmissible, adapt_mesh, remesh: see `trace`.

        Raises:
            InputError: a stage drives or leaves out something that the scene does not have, leaves the body free to
                move, or lets tools overlap; a target does not fit its stage; a table does not begin where its item
                stands; a tool comes in where the body is; a moving tool does not meet its face within the rim.
            ConvergenceError: a target was not reached. It carries the path so far and says what to try.
            OSError: the checkpoint cannot be written; the states in it are kept.
        """
        stages = self._checked(stages)
        if remesh is not None:
            instance("Process: remesh", remesh, MeshRenewal, "a formingx.Remesh")
            remesh.check("Process", self.scene, [t for s in stages for t in (*s.intermediate, s.until) if t])
            if adapt_mesh is not False:
                raise InputError("Process: remesh: cannot be combined with adapt_mesh")
        if adapt_mesh is not False:
            return _after_pilot("Process", adapt_mesh, start, resume, self.scene, checkpoint, lambda scene, checkpoint:
                                Process(scene).run(stages, step=step, tolerances=tolerances, max_steps=max_steps,
                                                   progress=progress, checkpoint=checkpoint, record=record,
                                                   accuracy=accuracy, allow_inadmissible=allow_inadmissible))
        instance("Process: step", step, StepControl | None, "a StepControl or None")
        instance("Process: tolerances", tolerances, Tolerances | None, "a Tolerances or None")
        instance("Process: progress", progress, bool, "True or False")
        instance("Process: start", start, Path | State | None, "a path, a state or None")
        allowed = allowed_error("Process", accuracy)
        plans = [plan(self.scene, stage) for stage in stages]
        unsure = clearance.check(self.scene, plans)
        if isinstance(start, Path) and start.scene is not self.scene:
            raise InputError("Process: start: must be a path of this very scene: fx.load(folder, scene), or what run"
                             " gave back")
        start = _from_checkpoint("Process", resume, checkpoint, self.scene, start)
        tolerances = tolerances or Tolerances()
        with _carried(checkpoint) as carried:
            problem = start.problem if isinstance(start, Path) else Problem(self.scene)
            for state in [start] if isinstance(start, State) else start.states[-1:] if start else []:
                _check_start(state, stages, problem)
            timed = any(stage.timed for stage in stages)
            found = before_run(self.scene, stages=stages)
            path = carried(_path(Curve(problem, tolerances), start, record, allow_inadmissible, found, timed))
            _keep(path, checkpoint)
            max_steps = None if max_steps is None else count("Process: max_steps", max_steps)

            def part() -> None:
                Execution(path.record, plans, unsure, self._look_again, step, tolerances.residual, allowed).run(
                    max_steps, progress)
            if remesh is None:
                part()
            else:
                remesh.follow(path, tolerances, part, lambda: is_done(path.record, plans))
        return path

    def _look_again(self, plan: Plan, stands: Callable[[int], float]) -> None:
        """Raise an InputError if the tools of a stage cannot move as it says, now that their travels are known."""
        contacts = {i: stands(i) for i, item in enumerate(self.scene.items) if item in self.scene.contacts}
        clearance.check(self.scene, [plan], contacts)

    def _checked(self, stages: Any) -> list[Stage]:
        stages = several("Process: stages", stages,
                         "stages, such as Stage('vacuum', control=vacuum, until=pressure(1))")
        if not stages:
            raise InputError("Process: stages = []: must have at least one Stage")
        for stage in stages:
            instance("Process: stage", stage, Stage, "a formingx.Stage")
        for stage in stages:
            if sum(other.name == stage.name for other in stages) > 1:
                raise InputError(f"Process: two stages are called {stage.name!r}: names must differ")
        return stages


def load(folder: Any, scene: Scene, state: int | None = None) -> Path:
    """Return the path in a checkpoint, to look at or to continue from: `trace(scene, until=..., start=load("run",
    scene))`.

    Args:
        folder: what `trace(..., checkpoint=folder)` or `Path.save(folder)` wrote, on any number of ranks.
        scene: the same scene, made by the same script.
        state: continue from this state (0: the start), and leave out what came after; default the last.

    Raises:
        InputError: there is no checkpoint, it is damaged, or it is of another mesh or scene; the message says the
            difference.

    >>> path.save("run")
    >>> again = fx.load("run", scene)
    >>> len(again.states) == len(path.states)
    True
    """
    return Path(read(folder, scene, state))


def _after_pilot(caller: str, adapt_mesh: Any, start: Any, resume: bool, scene: Scene, checkpoint: Any,
                 run: Callable[[Scene, Any], Path]) -> Path:
    """Return the path of a run on the mesh that a first run asks for."""
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
    made = meshes.make(first, options)
    log.info("pilot run: %d states on %d elements; adapted: %d", len(first), *(
        mesh.domain.topology.index_map(2).size_global for mesh in (scene.mesh, made)))
    path = run(scene.with_mesh(made), checkpoint)
    path.pilot = first
    return path


def _check_start(state: State, stages: list[Stage], problem: Problem) -> None:
    """Raise an InputError unless a process of these stages can continue from the state."""
    number = state.setting.get("stage", -1)
    if len(state.x) != problem.x.getLocalSize() or not 0 <= number < len(stages):
        raise InputError("Process: start: must be a path of this process: its last state belongs to another scene or"
                         " stage")
    if stages[number].name != state.stage:
        raise InputError(f"Process: start: its last state is of stage {state.stage!r}, number {number + 1}, but"
                         f" stage {number + 1} is {stages[number].name!r} now: give all stages of the"
                         f" process, also those that are done")


def _path(curve: Curve, start: Path | State | None, columns: Mapping[str, Measure] | None, allow_inadmissible: bool,
          found: list[Finding], timed: bool = False) -> Path:
    """Return a path to be solved for by `curve`, that begins with the states of another, or with a state.

    found: findings of the checks before the run, which are logged here.
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


def _keep(path: Path, checkpoint: Any) -> None:
    """Let a checkpoint be written after each step."""
    if checkpoint is not None:
        kept = Checkpoint(checkpoint, path)
        path.record.on_step.append(kept.write)
        path.record.on_end.append(kept.end)


def _from_checkpoint(caller: str, resume: bool, checkpoint: Any, scene: Scene, start: Any) -> Any:
    """Return the start of a run: `start`, or with `resume` the states of its checkpoint."""
    if not resume:
        return start
    if checkpoint is None or start is not None:
        raise InputError(f"{caller}: resume=True: give a checkpoint to go on from, and no start")
    return load(checkpoint, scene) if holds_states(checkpoint, scene.mesh.comm) else None


@contextlib.contextmanager
def _carried(checkpoint: Any = None) -> Iterator[Callable[[Path], Path]]:
    """Attach the path so far to the errors of a run; yield the function that names the path; raise `Interrupted`."""
    paths: list[Path] = []

    def carried(path: Path) -> Path:
        paths.append(path)
        return path

    def so_far() -> Path | None:
        return next((path for path in paths if path.states), None)

    try:
        yield carried
    except (ConvergenceError, InputError) as error:
        error.path = path = so_far()
        if path is not None and isinstance(error, ConvergenceError):       # on all ranks
            _end(path, str(error), path.findings() if path.record.on_end else [])
        if isinstance(error, ConvergenceError) and error.diagnosis is not None:
            raise copy.copy(error) from None                # its diagnosis tells the cause: no traceback of the solver
        raise
    except KeyboardInterrupt:
        path = so_far()
        if path is None:
            raise Interrupted("interrupted before its first state") from None
        stands = f"at {path.describe(path.last)}, after {len(path)} states"
        how = (f"checkpoint={str(checkpoint)!r} holds it: the same script goes on with resume=True" if checkpoint else
               "it is lost; with checkpoint='folder', resume=True the same script would go on from there")
        raise Interrupted(f"interrupted {stands}; {how}", path) from None
    path = paths[0]
    found = path.findings()
    tell([finding for finding in found if finding not in path.record.findings], path.problem.comm.rank)
    _end(path, "", found)


def _end(path: Path, failure: str, found: list[Finding]) -> None:
    """Call the listeners at the end of a run with the failure, or "", and the findings."""
    for listener in path.record.on_end:
        listener(failure, found)
