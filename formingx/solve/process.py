"""Processes in stages: plug, then vacuum, plug out, release. One problem and one path, another thing driven in each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from ..errors import InputError, count, instance, several
from ..problem import Problem
from ..results import measures
from ..results.path import Path
from ..scene import Scene
from .bordered import Tolerances
from .continuation import Run
from .stepping import StepControl


@dataclass(frozen=True, eq=False)
class Stage:
    """One thing of a scene is driven, from where it stands, until a target is reached; all else stays where it is.

    Args:
        name: of the stage, in the record.
        drive: a load, support or contact of the scene that can be driven.
        until: the target that ends the stage, hit exactly, e.g. `travel(6.0)` (from the reference, not from here).
        through: more targets to hit exactly on the way; those that are not met are left out.
        without: contacts of the scene that are not there during the stage: they give no forces.
    """

    name: str
    drive: Any
    until: measures.Target | None = None
    through: Sequence[measures.Target] = ()
    without: Sequence[Any] = ()


class Process:
    """Stages on one scene, run in order. Each starts from the last state of the one before.

    A pressure, support or tool of the scene that can be driven (`Pressure` without value, `Displaced`, `Contact` with
    `moves`) starts at 0. Its value is scale (base + rate control): base 0 and rate 1 in a stage that drives it, else
    rate 0 and base where it stands.

    Args:
        scene: with one or several things that can be driven.
    """

    def __init__(self, scene: Scene):
        instance("Process: scene", scene, Scene, "a formingx.Scene")
        self.scene = scene

    def run(self, stages: Sequence[Stage], *, step: StepControl | None = None, tolerances: Tolerances | None = None,
            max_steps: int = 200, progress: bool = True) -> Path:
        """Run the stages; the path has the states of all, the first of each stage being of kind "start".

        Args:
            stages: in order.
            step: step control at the start of every stage; default `StepControl()`.
            tolerances: when a state counts as converged; default `Tolerances()`.
            max_steps: accepted states of a stage before the run gives up.
            progress: show a progress bar for stages of more than two seconds (rank 0).

        Raises:
            InputError: a stage without a target, with one that is not of what it drives, or one that drives or leaves
                out something that the scene does not have.
            ConvergenceError: a target was not reached. It carries the path so far.
        """
        stages = several("Process: stages", stages, "stages, such as Stage('vacuum', drive=vacuum, until=pressure(1))")
        if not stages:
            raise InputError("Process: stages = []: must have at least one Stage")
        for stage in stages:
            instance("Process: stage", stage, Stage, "a Stage")
            self._check(stage)
        instance("Process: step", step, StepControl | None, "a StepControl or None")
        instance("Process: tolerances", tolerances, Tolerances | None, "a Tolerances or None")
        max_steps = count("Process: max_steps", max_steps)
        run = Run(Problem(self.scene), tolerances or Tolerances())
        for stage in stages:
            run.stage(stage.name, self.scene.drivable[stage.drive], stage.without, stage.until, stage.through,
                      step or StepControl())
            run.trace(max_steps, progress)
        return run.path

    def _check(self, stage: Stage) -> None:
        name, drivable = f"Stage({stage.name!r})", list(self.scene.drivable)
        if not isinstance(stage.name, str) or not stage.name:
            raise InputError(f"{name}: name: must be a word or more")
        if not any(stage.drive is thing for thing in drivable):
            raise InputError(f"{name}: drive = {stage.drive!r}: must be something of the scene that can be driven;"
                             f" these are: {', '.join(map(repr, drivable)) or 'none'}")
        if stage.until is None:
            raise InputError(f"{name}: until: a stage needs a target, such as {measures.kind_of(stage.drive)}(1.0)")
        for target in (stage.until, *several(f"{name}: through", stage.through, "targets, such as pole_stretch(3)")):
            instance(f"{name}: target", target, measures.Target, "a target, such as pole_stretch(3)")
            kind = measures.kind_of(stage.drive)
            if target.bind is measures.bind_control and target.name != kind:
                raise InputError(f"{name}: {target}: the stage drives {stage.drive!r}, which has a {kind}")
        for thing in several(f"{name}: without", stage.without, "contacts of the scene"):
            if not any(thing is contact for contact in self.scene.contacts):
                raise InputError(f"{name}: without = {thing!r}: must be a contact of the scene; these are:"
                                 f" {', '.join(map(repr, self.scene.contacts)) or 'none'}")
