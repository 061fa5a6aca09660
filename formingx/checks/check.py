"""Check of a scene before a run, or of a run; a good scene has no findings."""

from collections.abc import Sequence

from ..errors import instance, several
from ..findings import Finding, alarming, found_at, worst_first
from ..measures.targets import Target
from ..results.path import Path
from ..scene.scene import Scene
from ..solve.branches import ANOTHER_PATH
from ..solve.stage import Stage
from ..units import NONE, Units
from . import ended, ranges, scenes, touched
from .sizes import Body

# modules that register checks are named here, as they are not called by name
__all__ = ["Report", "before_run", "check", "ended", "ranges", "scenes", "touched"]


class Report:
    """Findings of `check`, the worst first; prints as text.

    Attributes:
        findings: list of `Finding`; empty for a good scene.
    """

    def __init__(self, findings: Sequence[Finding]):
        self.findings = worst_first(dict.fromkeys(findings))

    @property
    def healthy(self) -> bool:
        """True if nothing was found."""
        return not self.findings

    def __str__(self) -> str:
        return "\n".join(map(str, self.findings)) or "no fault was found in this scene"

    __repr__ = __str__


def check(scene: Scene | Path, *, targets: Sequence[Target] = (), stages: Sequence[Stage] = (),
           units: Units = NONE) -> Report:
    """Look a scene over before the run; collective, no form is compiled and nothing is solved.

    Elements (shape, number through a thick layer), the mesh against the edges of the tools, penalties against the
    precision that they leave, sizes that look like mixed units, pressures and blow ratios that the material does not
    bear, tools that move away or leave a way past them, a modulus that rises as the body cools. What makes every run
    impossible or wrong, such as a body that is free to move, elements that lie over each other or lock, is an
    `InputError` of `Scene` already; "serious" here is a target that `trace` refuses.

    Args:
        scene: the scene, or the `Path` of a run. The findings of a run, without notes, and its branch points are
            added to the findings on its scene.
        targets: targets of the run, which are checked, too.
        stages: stages of the process, whose targets and tables are checked, too.
        units: units of the numbers in the findings.

    Raises:
        InputError: `scene` is not a Scene or a Path, a target not a target, a stage not a stage or of another scene.

    >>> print(fx.check(scene, targets=[fx.pole_height(12.0)]))
    no fault was found in this scene
    """
    if isinstance(scene, Path):
        branches = [Finding("warning", "branch point", ANOTHER_PATH % (scene.describe(left), scene.describe(right)))
                    for left, right in scene.branch_points]
        before = check(scene.problem.scene, targets=targets, stages=stages, units=units).findings
        return Report([*alarming(scene.findings()), *branches, *before])
    instance("check: scene", scene, Scene, "a formingx.Scene, or the Path of a run")
    instance("check: units", units, Units, "a formingx.Units")
    targets = several("check: targets", targets, "targets, such as [pole_stretch(3)]")
    stages = several("check: stages", stages, "stages, such as [Stage('blow', control='air', until=pressure(1))]")
    for target in targets:
        instance("check: targets: target", target, Target, "a target, such as pole_stretch(3)")
    for stage in stages:
        instance("check: stages: stage", stage, Stage, "a formingx.Stage")
    body = Body(scene, targets, stages, units)
    return Report([*found_at("scene", body), *found_at("start", body)])


def before_run(scene: Scene, targets: Sequence[Target] = (), stages: Sequence[Stage] = ()) -> list[Finding]:
    """Return the findings with which every run begins: units and ranges, tools on their way; collective."""
    return found_at("start", Body(scene, targets, stages, NONE))
