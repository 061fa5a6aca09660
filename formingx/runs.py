"""Runs: path following with one control, Newton's method at fixed control, processes in stages.

The solvers accept states. A `Path` and, on request, a `Checkpoint` record each of them.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from .checks.check import before_run
from .errors import InputError, as_list, check_name, check_type, count, finite
from .measures.columns import Measure
from .measures.targets import Amplitude, Target
from .physics.contact import Contact
from .problem.problem import Problem
from .results.files.checkpoint import read
from .results.path import Path
from .run_hooks import RunExtension, check_argument
from .run_parts import check_start, first_path, new_path, run_errors, run_on_adapted_mesh, write_checkpoints
from .scene import clearance, target_checks
from .scene.contact_checks import check_travel
from .scene.scene import Scene
from .solve.arc_length import Curve
from .solve.load_control import FixedControlCurve
from .solve.newton import Tolerances
from .solve.path_following import Run
from .solve.process import Execution, begin, is_done
from .solve.stage import AT_LIMIT_POINT, Plan, Stage, plan
from .solve.state import State
from .solve.stepping import StepControl
from .solve.stepping import allowed as allowed_error

log = logging.getLogger("formingx")


def trace(scene: Scene, *, until: Target, intermediate: Sequence[Target] = (), step: StepControl | None = None,
          tolerances: Tolerances | None = None, max_steps: int | None = None, progress: bool = True,
          start: Path | None = None, checkpoint: Any = None, record: Mapping[str, Measure] | None = None,
          at_limit_point: str | None = None, resume: bool = False, allow_inadmissible: bool = False,
          adapt_mesh: bool | Mapping[str, float] = False, remesh: RunExtension | None = None,
          stop_at: RunExtension | None = None) -> Path:
    """Follow the equilibrium path from the unloaded body to a target, through limit points.

    Args:
        scene: scene with one controlled load, support or tool.
        until: target that ends the run, such as `pole_stretch(8.5)`; it is met exactly.
        intermediate: further targets to be met exactly; a target that does not occur is skipped.
        step: step control; default `StepControl()`.
        tolerances: convergence criteria; default `Tolerances()`.
        max_steps: largest number of accepted states. Default: the run ends when it no longer approaches its target.
        progress: show a progress bar on runs of more than two seconds (rank 0).
        start: path of this scene to be continued, for example from `formingx.load`; it is not changed. Without `step`
            the run begins with the last step length of this path. Targets that the path has met count as met. If its
            last state is already beyond a target, the run goes back along the path to it. A target pressure is an
            exception: the run goes on, because the pressure may reach the target again.
        checkpoint: folder to which every accepted state is written (`formingx.load`).
        record: {name: quantity} of additional columns. A quantity is a function of the `Problem` that returns a number,
            or a target such as `displacement(0, at=(1, 0))`, whose quantity is recorded.
        at_limit_point: action at a limit point of the control. "continue": follow the path beyond it, with a decreasing
            control. In contact or with history variables the path may end; then the body snaps through. "snap_through":
            increase the control, and jump to the next equilibrium (`Path.jumps`). "stop": end the run. The default
            depends on the control. Time: "snap_through". A pressure on a body in contact or with history variables,
            such as friction: "snap_through" if it decreases. If it grows, the run continues while the enclosed volume
            grows, as with an air supply. Other cases: "snap_through" with history variables, "continue" without.
        resume: continue from the states in the checkpoint, which must be of this scene; begin if there are none.
        allow_inadmissible: continue, with a warning, through states that no body can have: self-penetrated, inside a
            tool, with inverted elements. `State.inadmissible_reason` gives the reason. By default the run ends there.
        adapt_mesh: True to run twice: on the mesh of the scene, which may be coarse, and on `mesh.adapted(path)`. Or
            arguments of `adapted`, such as {"error": 0.02}. `Path.pilot` is the path of the first run, which may have
            ended before the target. A checkpoint stores it in its folder "pilot".
        remesh: a `Remesh`, which replaces crushed elements by a new mesh of the deformed body. A state of kind "remesh"
            stores the relative change of force, energy and volume in `jump`. For solids of one layer, on one rank.
        stop_at: `instability(modes=range(2, 9))` ends the run when the body becomes unstable in one of these modes.
            This is a result, no error; `Path.ended` names the mode.

    Returns:
        The path with all accepted states.

    Raises:
        InputError: there is no controlled item. A target needs an item that the scene does not have. A target cannot be
            met: its point is constrained or would lie inside a tool, or its value lies before the start or beyond the
            largest stretch of the material. `start` or the checkpoint belongs to another run.
        ConvergenceError: the target was not reached. The error carries the path so far and gives advice.
        OSError: the checkpoint cannot be written; its states are kept.

    >>> path = fx.trace(scene, until=fx.pole_height(12.0), progress=False)
    >>> len(path.limit_points), round(float(path["pole_height"][-1]), 6)           # through the pressure maximum
    (1, 12.0)
    """
    check_type("trace: scene", scene, Scene, "a formingx.Scene")
    if remesh is not None:
        check_argument("trace", "remesh", remesh, "a formingx.Remesh")
        remesh.check("trace", scene, [*intermediate, until])
        if adapt_mesh is not False or stop_at is not None:
            raise InputError("trace: remesh: cannot be combined with adapt_mesh or stop_at")
    if adapt_mesh is not False:
        def run(scene: Scene, checkpoint: Any, resume: bool) -> Path:
            """Return the path of a run on the mesh of `scene`."""
            return trace(scene, until=until, intermediate=intermediate, step=step, tolerances=tolerances,
                         max_steps=max_steps, progress=progress, checkpoint=checkpoint, record=record, resume=resume,
                         at_limit_point=at_limit_point, allow_inadmissible=allow_inadmissible, stop_at=stop_at)
        return run_on_adapted_mesh("trace", adapt_mesh, start, resume, scene, checkpoint, run)
    intermediate = as_list("trace: intermediate", intermediate, "targets, such as pole_stretch(3)")
    for target in (until, *intermediate):
        check_type("trace: target", target, Target, "a target, such as pole_stretch(3)")
        if target.name == "travel" and isinstance(scene.driven, Contact):
            check_travel(scene, scene.driven, target.value)
    check_type("trace: step", step, StepControl | None, "a StepControl or None")
    check_type("trace: tolerances", tolerances, Tolerances | None, "a Tolerances or None")
    check_type("trace: progress", progress, bool, "True or False")
    if stop_at is not None:
        check_argument("trace", "stop_at", stop_at, "fx.instability(modes=...) or None")
    max_steps = None if max_steps is None else count("trace: max_steps", max_steps)
    check_name("trace: at_limit_point =", at_limit_point, AT_LIMIT_POINT)
    scene.only_driven("trace")
    target_checks.check(scene, [until, *intermediate], continues=start is not None)
    clearance.check_target(scene, until)
    if start is not None and (not isinstance(start, Path) or start.scene is not scene or not start.states):
        raise InputError("trace: start: must be a path of this very scene: fx.load(folder, scene), or what trace gave"
                         " back")
    start = first_path("trace", resume, checkpoint, scene, start)
    with run_errors(checkpoint) as register:
        problem = Problem(scene) if start is None else start.problem
        path = register(new_path(Curve(problem, tolerances or Tolerances()), start, record, allow_inadmissible,
                                 before_run(scene, [*intermediate, until])))
        write_checkpoints(path, checkpoint)
        for extension in filter(None, (remesh, stop_at)):
            extension.attach(path)

        def part() -> None:
            """Continue the run from its last state, on the mesh of this state."""
            on_the_way = [t for t in intermediate if len(path.record.segments) == 1 or path.target_state(t) is None]
            targets = [(target, target.bind(path.problem)) for target in (*on_the_way, until)]
            run = Run(path.record, targets, step, at_limit_point)
            run.follow(max_steps, progress, None if path.states else begin(path.record.curve), may_turn=True)
        path.record.hooks.renew(part, lambda: path.last.target is not None and path.last.target[:2] == until[:2])
    return path


def solve(scene: Scene, *, to: float, increments: int = 1, tolerances: Tolerances | None = None, max_steps: int = 1000,
          record: Mapping[str, Measure] | None = None, allow_inadmissible: bool = False) -> Path:
    """Load the body to a value of the control in increments, with PETSc's SNES at fixed control.

    The scene must have no limit point before `to`. (`trace` passes limit points and chooses its own steps.) Options
    such as -formingx_0_snes_monitor reach the SNES of the first such run of a script.

    Args:
        scene: scene with one controlled load, support or tool.
        to: value of the controlled quantity: pressure (stress) or travel (length).
        increments: number of equal increments. An increment that fails is halved, and new contact shortens increments.
        tolerances: convergence criteria; default `Tolerances()`.
        max_steps: largest number of accepted states.
        record: {name: quantity} of additional columns: a function of the `Problem` that returns a number, or a target.
        allow_inadmissible: continue through states that no body can have, such as self-penetrated ones.

    Returns:
        The path with all accepted states.

    Raises:
        InputError: there is no controlled item, or an argument is not allowed.
        ConvergenceError: an increment did not converge; the error carries the path so far.

    >>> path = fx.solve(scene, to=0.02)
    >>> round(float(path["pressure"][-1]), 6)
    0.02
    """
    check_type("solve: scene", scene, Scene, "a formingx.Scene")
    check_type("solve: tolerances", tolerances, Tolerances | None, "a Tolerances or None")
    scene.only_driven("solve")
    to, increments = finite("solve: to", to), count("solve: increments", increments)
    max_steps = count("solve: max_steps", max_steps)
    if increments > max_steps:
        raise InputError(f"solve: increments = {increments}: must be at most max_steps = {max_steps}")
    if to == 0:
        raise InputError("solve: to = 0: the unloaded body is in equilibrium there")
    driven = scene.items.index(scene.driven)
    name = scene.driven.quantity
    with run_errors() as register:
        problem = Problem(scene)
        curve = FixedControlCurve(problem, tolerances or Tolerances())
        path = register(new_path(curve, None, record, allow_inadmissible, before_run(scene, [Target(name, to, None)])))
        targets = [(Target(name, to * k / increments, None), Amplitude(problem, driven))
                   for k in range(1, increments + 1)]
        increment = abs(to / problem.forms.control_scale) / increments
        step = StepControl(length=1.01 * increment, largest=1.01 * increment, smallest=1e-5 * increment)
        Run(path.record, targets, step).follow(max_steps, False, begin(curve))
    return path


class Process:
    """Sequence of stages on one scene, each of which continues from the last state of the stage before.

    A pressure, support or tool without a fixed value (`Pressure` without value, `PrescribedDisplacement`, `Contact`
    with `direction`) starts at 0. It keeps its value in stages that do not control it.

    Args:
        scene: scene with any number of controllable items.

    >>> air, plug = fx.Pressure("bottom"), fx.Contact("top", fx.tools.plane(2.0), "none", direction=(0, -1))
    >>> scene = fx.Scene(mesh=fx.mesh.disc(radius=10.0, thickness=0.5, elements=(8, 1)), loads=[air], contacts=[plug],
    ...                  materials=fx.NeoHookean(c10=0.4), supports=[fx.Symmetry("axis"), fx.SimplySupported("rim")])
    >>> path = fx.Process(scene).run([fx.Stage("blow", control=air, until=fx.pole_height(1.0)),
    ...                               fx.Stage("press", control=plug, until=fx.travel(1.0))])
    >>> round(float(path["pole_height"][-1]), 3), path.states[-1].stage
    (0.501, 'press')
    """

    def __init__(self, scene: Scene):
        self.scene = check_type("Process: scene", scene, Scene, "a formingx.Scene")

    def run(self, stages: Sequence[Stage], *, step: StepControl | None = None, tolerances: Tolerances | None = None,
            max_steps: int | None = None, progress: bool = True, start: Path | State | None = None,
            checkpoint: Any = None, record: Mapping[str, Measure] | None = None,
            accuracy: str | float = "standard", resume: bool = False, allow_inadmissible: bool = False,
            adapt_mesh: bool | Mapping[str, float] = False, remesh: RunExtension | None = None) -> Path:
        """Run the stages in order.

        Args:
            stages: the stages.
            step: step control at the start of stages without their own; default `StepControl()`. In a stage in which
                an output quantity follows a table over time, its lengths are fractions of the duration.
            tolerances: convergence criteria; default `Tolerances()`.
            max_steps: largest number of accepted states of a stage, or of a linear piece of its tables. Default: the
                run ends when it no longer approaches its target.
            progress: show a progress bar on runs of more than two seconds (rank 0).
            start: path of these stages to be continued, for example from `formingx.load`, or one of its states.
            checkpoint: folder to which every accepted state is written (`formingx.load`).
            record: {name: quantity} of additional columns: a function of the `Problem` that returns a number, or a
                target.
            accuracy: accuracy of the time integration of viscoelastic materials: "draft", "standard" or "fine" (1, 0.2,
                0.03 % of stress and thickness), or the relative error.
            resume: continue from the states in the checkpoint, which must be of this process; begin if there are none.
            allow_inadmissible: continue, with a warning, through states that no body can have, such as self-penetrated
                ones. By default the run ends there.
            adapt_mesh: True to run twice: on the mesh of the scene, and on `mesh.adapted(path)`; or {argument of
                `adapted`: value}.
            remesh: a `Remesh`, which replaces crushed elements by a new mesh of the deformed body.

        Returns:
            The path with the states of all stages; every stage begins with a state of kind "start".

        Raises:
            InputError: a stage refers to an item that the scene does not have, leaves the body free to move, or lets
                tools overlap. A target does not fit its stage, or a table does not begin at the present value. A tool
                starts inside the body, or does not meet its face within the rim.
            ConvergenceError: a target was not reached. The error carries the path so far and gives advice.
            OSError: the checkpoint cannot be written; its states are kept.
        """
        stages = self._check_stages(stages)
        if remesh is not None:
            check_argument("Process", "remesh", remesh, "a formingx.Remesh")
            remesh.check("Process", self.scene, [t for s in stages for t in (*s.intermediate, s.until) if t])
            if adapt_mesh is not False:
                raise InputError("Process: remesh: cannot be combined with adapt_mesh")
        if adapt_mesh is not False:
            def run(scene: Scene, checkpoint: Any, resume: bool) -> Path:
                """Return the path of a run on the mesh of `scene`."""
                return Process(scene).run(stages, step=step, tolerances=tolerances, max_steps=max_steps,
                                          progress=progress, checkpoint=checkpoint, record=record, accuracy=accuracy,
                                          resume=resume, allow_inadmissible=allow_inadmissible)
            return run_on_adapted_mesh("Process", adapt_mesh, start, resume, self.scene, checkpoint, run)
        check_type("Process: step", step, StepControl | None, "a StepControl or None")
        check_type("Process: tolerances", tolerances, Tolerances | None, "a Tolerances or None")
        check_type("Process: progress", progress, bool, "True or False")
        check_type("Process: start", start, Path | State | None, "a path, a state or None")
        allowed = allowed_error("Process", accuracy)
        plans = [plan(self.scene, stage) for stage in stages]
        uncertain = clearance.check(self.scene, plans)
        if isinstance(start, Path) and start.scene is not self.scene:
            raise InputError("Process: start: must be a path of this very scene: fx.load(folder, scene), or what run"
                             " gave back")
        start = first_path("Process", resume, checkpoint, self.scene, start, plans)
        tolerances = tolerances or Tolerances()
        with run_errors(checkpoint) as register:
            problem = start.problem if isinstance(start, Path) else Problem(self.scene)
            for state in [start] if isinstance(start, State) else start.states[-1:] if start else []:
                check_start(state, stages, problem)
            timed = any(stage.timed for stage in stages)
            found = before_run(self.scene, stages=stages)
            path = register(new_path(Curve(problem, tolerances), start, record, allow_inadmissible, found, timed))
            write_checkpoints(path, checkpoint, plans)
            max_steps = None if max_steps is None else count("Process: max_steps", max_steps)

            def part() -> None:
                """Continue the run from its last state, on the mesh of this state."""
                execution = Execution(path.record, plans, uncertain, self._check_tool_paths, step,
                                      tolerances.residual, allowed)
                execution.run(max_steps, progress)
            if remesh is not None:
                remesh.attach(path)
            path.record.hooks.renew(part, lambda: is_done(path.record, plans))
        return path

    def _check_tool_paths(self, plan: Plan, travel: Callable[[int], float]) -> None:
        """Raise an InputError if a tool cannot move as a stage states from travels at its start, length."""
        contacts = {i: travel(i) for i, item in enumerate(self.scene.items) if item in self.scene.contacts}
        clearance.check(self.scene, [plan], contacts)

    def _check_stages(self, stages: Any) -> list[Stage]:
        """Return the argument `stages` of `run` as a list; no stage, or two of one name, are an InputError."""
        stages = as_list("Process: stages", stages,
                         "stages, such as Stage('vacuum', control=vacuum, until=pressure(1))")
        if not stages:
            raise InputError("Process: stages = []: must have at least one Stage")
        for stage in stages:
            check_type("Process: stage", stage, Stage, "a formingx.Stage")
        for stage in stages:
            if sum(other.name == stage.name for other in stages) > 1:
                raise InputError(f"Process: two stages are called {stage.name!r}: names must differ")
        return stages


def load(folder: Any, scene: Scene, state: int | None = None) -> Path:
    """Return the path in a checkpoint, to be examined, or continued by `trace(..., start=load("run", scene))`.

    Args:
        folder: folder written by `trace(..., checkpoint=folder)` or `Path.save(folder)`, on any number of ranks.
        scene: the same scene, made by the same script.
        state: number of the last state to be read (0: the start); None: all states.

    Returns:
        The path with its states.

    Raises:
        InputError: there is no checkpoint, it is damaged, or it is of another mesh or scene; the message names the
            difference.

    >>> path.save("run")
    >>> again = fx.load("run", scene)
    >>> len(again.states) == len(path.states)
    True
    """
    return Path(read(folder, scene, state))
