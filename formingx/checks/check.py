"""Check of a scene before its run, or of a finished run; a sound scene has no findings."""

from collections.abc import Sequence
from typing import Any

from ..errors import InputError, as_list, check_type
from ..findings import Finding, findings_at, without_notes, worst_first
from ..measures.targets import Target
from ..results.path import Path
from ..scene import clearance
from ..scene.scene import Scene
from ..solve.branches import ANOTHER_PATH
from ..solve.stage import Plan, Stage, plan
from ..units import NONE, Units
from . import end_of_run, failed_run, parallel, promised_walls, ranges, scenes, tool_contact, vents
from .sizes import SizedBody

# the imported modules register their checks
__all__ = ["Report", "before_run", "check", "end_of_run", "failed_run", "parallel", "promised_walls", "ranges",
           "scenes", "tool_contact", "vents"]


class Report:
    """Findings of `check`. As text, it has one finding per line.

    Args:
        findings: findings in any order; of equal ones only one is kept.

    Attributes:
        findings: list of `Finding`, the worst first; empty for a sound scene.
    """

    def __init__(self, findings: Sequence[Finding]):
        self.findings = worst_first(dict.fromkeys(findings))

    @property
    def healthy(self) -> bool:
        """True if there are no findings."""
        return not self.findings

    def __str__(self) -> str:
        return "\n".join(map(str, self.findings)) or "no fault was found in this scene"

    __repr__ = __str__


def check(scene: Scene | Path, *, targets: Sequence[Target] = (), stages: Sequence[Stage] = (),
          units: Units = NONE) -> Report:
    """Check a scene before its run, or a finished run; no form is compiled and nothing is solved; collective.

    The check covers:

    * Elements: their shape, their number through a thick layer, their size at fillets of tools.
    * Contact and volume penalties, and the accuracy that they allow.
    * Quantities whose magnitudes suggest mixed units.
    * Pressures and blow ratios that the material cannot bear.
    * Tools that move away from the body, and open moulds.
    * A modulus that rises on cooling.

    A "serious" finding is a target that `trace` refuses, or a stage that `Process` refuses. Faults that make every run
    impossible raise an `InputError` in `Scene` already. Examples are a body that is free to move, overlapping elements,
    and locking.

    Args:
        scene: the scene, or the `Path` of a finished run. The findings of the run at its end, and its branch points,
            are then added.
        targets: targets of the run. The check also covers whether the body can reach them.
        stages: stages of the process. The check also covers their targets and tables, and whether tools overlap.
        units: units of the script, for the numbers in the findings; default none.

    Returns:
        A `Report`: the findings, the worst first.

    Raises:
        InputError: an argument is of the wrong type, or a stage belongs to another scene.

    >>> print(fx.check(scene, targets=[fx.pole_height(12.0)]))
    no fault was found in this scene
    """
    if isinstance(scene, Path):
        describe = scene.record.describe
        branches = [Finding("warning", "branch point", ANOTHER_PATH % (describe(left), describe(right)))
                    for left, right in scene.branch_points]
        before = check(scene.problem.scene, targets=targets, stages=stages, units=units).findings
        return Report([*without_notes(scene.findings()), *branches, *before])
    check_type("check: scene", scene, Scene, "a formingx.Scene, or the Path of a run")
    check_type("check: units", units, Units, "a formingx.Units")
    targets = as_list("check: targets", targets, "targets, such as [pole_stretch(3)]")
    stages = as_list("check: stages", stages, "stages, such as [Stage('blow', control='air', until=pressure(1))]")
    for target in targets:
        check_type("check: targets: target", target, Target, "a target, such as pole_stretch(3)")
    for stage in stages:
        check_type("check: stages: stage", stage, Stage, "a formingx.Stage")
    body = SizedBody(scene, targets, stages, units)
    return Report([*findings_at("scene", body), *findings_at("start", body), *_refusals(scene, targets, stages)])


def _refusals(scene: Scene, targets: Sequence[Target], stages: Sequence[Stage]) -> list[Finding]:
    """Return serious findings: two tools overlap on the way to a target or in a stage, or a stage is refused."""
    try:
        for target in targets:
            clearance.check_target(scene, target)
        plans = [plan(scene, stage) for stage in stages]
        clearance.check(scene, plans)
    except InputError as error:
        return [Finding("serious", "tools", str(error))]
    return [Finding("serious", "stages", f"{step.stage.label}: target {target}: this stage does not drive that")
            for step in plans for target in _not_driven(scene, step)]


def _not_driven(scene: Scene, step: Plan) -> list[Target]:
    """Return the targets of a stage that are pressures or travels which it does not drive."""
    def names(items: Sequence[Any]) -> set[str]:
        return {name for item in items for name in (item.quantity, f"{item.name}_{item.quantity}")}
    moving = names([scene.items[i] for i in (*step.numbers, *(i for i, _ in step.tables))])
    wanted = [*step.stage.intermediate, *([step.stage.until] if step.stage.until is not None else [])]
    return [target for target in wanted if target.name in names(scene.drivable) - moving]


def before_run(scene: Scene, targets: Sequence[Target] = (), stages: Sequence[Stage] = ()) -> list[Finding]:
    """Return the findings, worst first, of the checks that precede every run (magnitudes, tools); collective."""
    return findings_at("start", SizedBody(scene, targets, stages, NONE))
