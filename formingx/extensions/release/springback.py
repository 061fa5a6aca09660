"""Release of a formed part from its tools: springback, shrinkage and warpage, after trimming and cooling."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ...errors import ConvergenceError, InputError, finite, positive
from ...forms.carry import carry, take_fields
from ...forms.schedule import StepData
from ...mesh.mesh import Mesh
from ...physics.supports import Constrained, PinnedNode, Support, Symmetry
from ...problem.problem import Problem
from ...results.evaluate.part import strips_within
from ...results.evaluate.profile import FACES
from ...results.evaluate.wall import Wall
from ...results.extend import method_of
from ...results.numbers import KeyNumbers
from ...results.path import Path
from ...scene.scene import Scene
from ...solve.arc_length import Curve
from ...solve.newton import Tolerances
from ...solve.process import Execution
from ...solve.record import Record
from ...solve.stage import Stage, plan
from ...solve.state import State
from ...solve.stepping import allowed as allowed_error
from ...units import NONE, Units
from .part import part_along

_THROUGH = 1.0
"""Time that a wall is given to cool, over thickness^2/diffusivity: exp(-pi^2) of a difference is left."""


@dataclass(frozen=True, repr=False)
class Springback(KeyNumbers):
    """A part before and after it was released.

    Attributes:
        path: the run from the part in its tools to the released part (`Path`).
        before: `Wall` of the part in its tools.
        after: `Wall` of the released part.
        trimmed: radius of the middle line in the tools where it was cut off, length.
        units: units of the labels.
    """

    path: Path
    before: Wall
    after: Wall
    trimmed: float
    units: Units = field(repr=False, default=NONE)

    @property
    def height(self) -> float:
        """Largest distance along the axis from the pole, the part's base, length."""
        return _height(self.after)

    @property
    def springback(self) -> float:
        """Height of the part in its tools minus its height after the release, length."""
        return _height(self.before) - self.height

    @property
    def min_wall(self) -> float:
        """Minimum wall of the released part, length."""
        return float(self.after.wall.min())

    @property
    def diameter(self) -> float:
        """Largest outer diameter of the released part, length."""
        return _diameter(self.after)

    @property
    def shrinkage(self) -> float:
        """Decrease of the largest diameter by the release, over the diameter in the tools."""
        return 1 - self.diameter / _diameter(self.before)

    @property
    def flange_angle(self) -> float:
        """Rotation of the end of the middle line upward (along Z), degrees: the warpage."""
        turned = _end(self.after) - _end(self.before)
        return (turned + 180) % 360 - 180

    @property
    def rows(self) -> list[tuple[str, str]]:
        """Rows of the report: (label, value with unit)."""
        said, before = self._length, self.before
        return [("trimmed at the radius", said(self.trimmed)),
                ("height (in its tools)", f"{said(self.height)} ({said(_height(before))})"),
                ("springback of the height", said(self.springback)),
                ("largest diameter (in its tools)", f"{said(self.diameter)} ({said(_diameter(before))})"),
                ("shrinkage of the diameter", f"{100 * self.shrinkage:.3g} %"),
                ("minimum wall", said(self.min_wall)),
                ("flange has turned by", f"{self.flange_angle:.3g} degrees")]


def _height(wall: Wall) -> float:
    return float(wall.height.max())


def _diameter(wall: Wall) -> float:
    return 2 * float(max(wall.profile.bottom[:, 0].max(), wall.profile.top[:, 0].max()))


def _end(wall: Wall) -> float:
    """Return the direction of the last edge of the middle line, degrees from R."""
    (r, z) = wall.profile.middle[-1] - wall.profile.middle[-3]
    return float(np.degrees(np.arctan2(z, r)))


@method_of(Path)
def springback(path: Path, temperature: float | None = None, *, trim: Any = None, boundaries: Any = None,
               duration: float | None = None, state: State | None = None, accuracy: str | float = "standard",
               units: Any = None) -> Springback:
    """Release a formed part: compute its springback, shrinkage and warpage.

    Tools and loads are removed; the part is trimmed; of supports only `Symmetry` is left; then, where heat or materials
    take time, it cools. At first the forces that held the part keep it in equilibrium; then they fade.

    Args:
        path: the path of a solid.
        temperature: temperature of both faces of the part after the release, only for a scene with `heat=Cooling(...)`.
            It acts through a conductance of 1e4 conductivity/wall.
        trim: as in `Path.part`: the part is cut along the nearest line of nodes.
        boundaries: laws of the faces in place of a temperature, as for `Cooling`; they need a duration.
        duration: time of cooling or relaxation after the release; default wall^2/diffusivity with a temperature, else
            none.
        state: state of the part in its tools; default the last.
        accuracy: see `Process.run`.
        units: a `formingx.Units`, for the labels.

    Returns:
        The `Springback`, which prints a table; its own run is `Springback.path`.

    Raises:
        InputError: a membrane; arguments that do not fit the scene; the part does not reach the trim.
        ConvergenceError: no state of the free part was found; it carries the path so far.
    """
    path.section_only("springback")
    state = state or path.last
    source = path.segment(state).problem
    mesh, trimmed = source.scene.mesh, float(path.wall(state).r[-1])
    if source.forms.domain is not mesh.domain:
        raise InputError("Path.springback: a membrane has no bending stiffness to keep a shape: form a solid,"
                         " MixedPressure()")
    if trim is not None:
        if source.scene.preformed is not None:
            raise InputError("Path.springback: trim: is not available for a remeshed run: leave it out")
        mesh, trimmed = _trimmed(mesh, path.wall(state), trim)
    heat, cools = _heat(source.scene, mesh, temperature, boundaries, duration, path.wall(state))
    problem = Problem(_scene(source.scene, mesh, heat))
    x = _carried(source, state, problem)
    problem.enter(StepData([0.0] * len(problem.scene.items) + [state.time], [0.0] * (1 + len(problem.scene.items)),
                          [], fading=True), x, 0.0)
    return _run(problem, x, cools, allowed_error("Path.springback", accuracy), trimmed, units or NONE)


def _run(problem: Problem, x: np.ndarray, cools: float, accuracy: float, trimmed: float,
         units: Units) -> Springback:
    """Release the body, then follow it for the time `cools`; return the `Springback`."""
    stages = [Stage("let go"), *([Stage("cool", duration=cools)] if cools else [])]
    record = Record(problem, Curve(problem, Tolerances()))
    path = Path(record, True)
    record.stage = stages[0].name
    try:
        record.accept(record.curve.resume(x, 0.0))
        Execution(record, [plan(problem.scene, stage) for stage in stages], [], lambda *_: None, None,
                  Tolerances().residual, accuracy).run(None, False)
    except ConvergenceError as error:
        error.path = path if path.states else None
        raise
    return Springback(path, path.wall(path.states[0]), path.wall(), trimmed, units)


def _heat(scene: Scene, mesh: Mesh, temperature: Any, boundaries: Any, duration: Any, wall: Wall) -> tuple[Any, float]:
    """Return the cooling of the part or None, and its duration."""
    if scene.heat is None:
        if temperature is not None or boundaries is not None:
            raise InputError("Path.springback: temperature: the scene has no heat=Cooling(...) that could change it:"
                             " leave the temperature out, or give the scene one")
        return None, 0.0 if duration is None else positive("Path.springback: duration", duration)
    if (temperature is None) == (boundaries is None):
        raise InputError("Path.springback: give the temperature to which the part is cooled, or the boundaries= at"
                         " which"
                         " it loses heat, and not both")
    if boundaries is not None and duration is None:
        raise InputError("Path.springback: boundaries: for how long? give duration=...")
    faces = next(pair for pair in FACES if all(face in mesh.boundaries for face in pair))
    thickness = float(wall.wall.max())
    heat = scene.heat.without_tools(scene.mesh, thickness, boundaries if temperature is None else dict.fromkeys(
        faces, finite("Path.springback: temperature", temperature)))
    if duration is not None:
        return heat, positive("Path.springback: duration", duration)
    return heat, _THROUGH * heat.time_through(scene.mesh, thickness)


def _scene(scene: Scene, mesh: Mesh, heat: Any) -> Scene:
    """Return the scene of the part alone, constrained on its symmetry planes and against rigid motion."""
    symmetries = [s for s in scene.supports if isinstance(s, Symmetry) and len(mesh.nodes_of(str(s.on)))]
    supports: list[Support] = [*symmetries]
    held = {s.component for s in symmetries}
    anywhere = mesh.nodes_of(str(symmetries[0].on) if symmetries else next(iter(mesh.boundaries)))[0]
    if 1 not in held:
        supports.append(_Still(1, anywhere))
    if 0 not in held and not scene.kinematics.axisymmetric:
        supports.append(_Still(0, anywhere))
    return Scene(mesh=mesh, materials=scene.materials, supports=supports, model=scene.model, heat=heat,
                 kinematics=scene.kinematics, quadrature_degree=scene.quadrature_degree, preformed=scene.preformed,
                 temperature=None if scene.temperature is None else scene.temperature.T,
                 expansion=dict(scene.expansion) or None)


class _Still(PinnedNode):
    """Constraint of one displacement component of a node against rigid motion; a free body exerts no force on it."""

    def __init__(self, component: int, point: np.ndarray):
        super().__init__(*point)
        self._component = component

    def constraints(self):
        return [Constrained(self._component, point=self.point)]


def _trimmed(mesh: Mesh, wall: Wall, trim: Any) -> tuple[Mesh, float]:
    """Return (the mesh up to the line of nodes next to where it is trimmed, radius there now)."""
    kept = float(strips_within(wall, trim).sum())                                 # edges have two parts
    last = int(np.clip(round(kept / 2), 1, (len(wall.r) - 1) // 2))
    middle = (wall.profile.reference_bottom + wall.profile.reference_top)[::2] / 2
    return part_along(mesh, middle, last), float(wall.r[2 * last])


def _carried(source: Any, state: Any, problem: Problem) -> np.ndarray:
    """Return the unknowns of the part, locally owned entries, and transfer the history variables of the whole body."""
    take_fields(source, state, problem)
    x = np.zeros(problem.x.getLocalSize())
    x[: problem.n_owned] = problem.forms.w.x.array[: problem.n_owned]
    carry(source, state, problem, x, 0.0)
    return x
