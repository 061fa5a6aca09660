"""Release of a formed part from its tools: springback, shrinkage and warpage, after trimming and cooling."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ...errors import ConvergenceError, InputError, finite, positive
from ...forms.schedule import StepData
from ...forms.transfer import restrict_fields, transfer_histories
from ...mesh.mesh import Mesh
from ...physics.supports import Constrained, PinnedNode, Support, Symmetry
from ...problem.problem import Problem
from ...results.evaluate.part import strips_within
from ...results.evaluate.profile import FACES
from ...results.evaluate.wall import Wall
from ...results.extend import method_of
from ...results.numbers import KeyNumbers
from ...results.path import Path
from ...results.reader import section_only
from ...scene.scene import Scene
from ...solve.arc_length import Curve
from ...solve.newton import Tolerances
from ...solve.process import Execution
from ...solve.record import Record
from ...solve.stage import Stage, plan
from ...solve.state import State
from ...solve.stepping import allowed as allowed_error
from ...units import NONE, Units
from .part import trimmed_mesh


@dataclass(frozen=True, repr=False)
class Springback(KeyNumbers):
    """Shape of a part in its tools and after its release; `print` shows a table.

    Attributes:
        path: the run from the part in its tools to the released part (`Path`).
        before: `Wall` of the part in its tools.
        after: `Wall` of the released part.
        trim_radius: radius r of the cut before the release, or of the rim of a part that is not cut, length.
        units: units of the labels.
    """

    path: Path
    before: Wall
    after: Wall
    trim_radius: float
    units: Units = field(repr=False, default=NONE)

    @property
    def height(self) -> float:
        """Height of the released part: largest axial distance of its middle line from the pole, length.

        Without a pole it is measured from the lowest point.
        """
        return _height(self.after)

    @property
    def springback(self) -> float:
        """Height of the part in its tools minus its height after the release, length."""
        return _height(self.before) - self.height

    @property
    def min_wall(self) -> float:
        """Minimum wall thickness of the released part, length."""
        return float(self.after.wall.min())

    @property
    def diameter(self) -> float:
        """Largest outer diameter of the released part, length."""
        return _diameter(self.after)

    @property
    def shrinkage(self) -> float:
        """Decrease of the largest outer diameter by the release, over this diameter in the tools."""
        return 1 - self.diameter / _diameter(self.before)

    @property
    def flange_angle(self) -> float:
        """Rotation of the end of the middle line by the release, positive upward (along Z), degrees: the warpage."""
        angle = _end_direction(self.after) - _end_direction(self.before)
        return (angle + 180) % 360 - 180

    @property
    def rows(self) -> list[tuple[str, str]]:
        """Rows of the printed table: (label, value with unit)."""
        text, before = self._length, self.before
        return [("trimmed at the radius", text(self.trim_radius)),
                ("height (in its tools)", f"{text(self.height)} ({text(_height(before))})"),
                ("springback of the height", text(self.springback)),
                ("largest diameter (in its tools)", f"{text(self.diameter)} ({text(_diameter(before))})"),
                ("shrinkage of the diameter", f"{100 * self.shrinkage:.3g} %"),
                ("minimum wall", text(self.min_wall)),
                ("flange has turned by", f"{self.flange_angle:.3g} degrees")]


def _height(wall: Wall) -> float:
    """Return the largest axial distance of the middle line from the pole, or from its lowest point without one."""
    return float(wall.height.max())


def _diameter(wall: Wall) -> float:
    """Return the largest outer diameter, length."""
    return 2 * float(max(wall.profile.bottom[:, 0].max(), wall.profile.top[:, 0].max()))


def _end_direction(wall: Wall) -> float:
    """Return the angle of the last edge of the deformed middle line, degrees from the R axis, positive along Z."""
    (r, z) = wall.profile.middle[-1] - wall.profile.middle[-3]
    return float(np.degrees(np.arctan2(z, r)))


@method_of(Path)
def springback(path: Path, temperature: float | None = None, *, trim: Any = None, boundaries: Any = None,
               duration: float | None = None, state: State | None = None, accuracy: str | float = "standard",
               units: Any = None) -> Springback:
    """Release a formed part from its tools: compute its springback, shrinkage and warpage.

    Tools and loads are removed, and the part is trimmed. Of the supports only `Symmetry` remains. The forces that kept
    the part in equilibrium then fade. With heat, or with a duration, the part cools or relaxes afterwards.

    Args:
        path: the path of a solid.
        temperature: temperature of both faces of the part after the release, only for a scene with `heat=Cooling(...)`.
            It acts through a conductance of 1e4 conductivity/wall.
        trim: radius r, or ("height", h), at which the part ends, length; None: not cut. The part is cut along the
            nearest line of nodes.
        boundaries: list of laws of the faces such as `Convection`, or {boundary: temperature}, in place of
            `temperature`. They need a duration.
        duration: time of cooling or relaxation after the release; default wall^2/diffusivity with a temperature, else
            0.
        state: state of the part in its tools; default the last.
        accuracy: accuracy in time as in `Process.run`: its name, such as "standard", or the relative error of a step.
        units: a `formingx.Units`, for the labels.

    Returns:
        Shape before and after the release; its own run is `Springback.path`.

    Raises:
        InputError: a membrane; arguments that do not fit the scene; the part does not reach the trim.
        ConvergenceError: no state of the free part was found; it carries the path so far.
    """
    section_only(path.scene, "springback", "it needs bending stiffness, which a membrane has not: write the part as"
                 " shells with path.shell_model(...) for a structural code")
    state = state or path.last
    source = path.record.segment(state).problem
    mesh, trimmed = source.scene.mesh, float(path.wall(state).r[-1])
    if source.forms.domain is not mesh.domain:
        raise InputError("Path.springback: a membrane has no bending stiffness to keep a shape: form a solid,"
                         " MixedPressure()")
    if trim is not None:
        if source.scene.state_transfer is not None:
            raise InputError("Path.springback: trim: is not available for a remeshed run: leave it out")
        mesh, trimmed = _trimmed(mesh, path.wall(state), trim)
    heat, cooling_time = _heat(source.scene, mesh, temperature, boundaries, duration, path.wall(state))
    problem = Problem(_scene(source.scene, mesh, heat))
    x = _transferred_unknowns(source, state, problem)
    problem.enter(StepData([0.0] * len(problem.scene.items) + [state.time], [0.0] * (1 + len(problem.scene.items)),
                          [], fading=True), x, 0.0)
    return _run(problem, x, cooling_time, allowed_error("Path.springback", accuracy), trimmed, units or NONE)


def _run(problem: Problem, x: np.ndarray, cooling_time: float, accuracy: float, trimmed: float,
         units: Units) -> Springback:
    """Release a part, then let it cool or relax for `cooling_time`, and return its shape before and after.

    The owned unknowns x are those of the part in its tools. Its end there has the radius `trimmed`, length.
    """
    stages = [Stage("release"), *([Stage("cool", duration=cooling_time)] if cooling_time else [])]
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
    """Return the `Cooling` of the released part (or None without heat), and the duration of its cooling or relaxation.

    Faces get a temperature or laws {boundary: temperature}. Arguments unfit for the scene are an InputError.
    """
    if scene.heat is None:
        if temperature is not None or boundaries is not None:
            raise InputError("Path.springback: temperature: the scene has no heat=Cooling(...) that could change it:"
                             " leave the temperature out, or give the scene one")
        return None, 0.0 if duration is None else positive("Path.springback: duration", duration)
    if (temperature is None) == (boundaries is None):
        raise InputError("Path.springback: give the temperature to which the part is cooled, or the boundaries= at"
                         " which it loses heat, and not both")
    if boundaries is not None and duration is None:
        raise InputError("Path.springback: boundaries: for how long? give duration=...")
    faces = next(pair for pair in FACES if all(face in mesh.boundaries for face in pair))
    thickness = float(wall.wall.max())
    heat = scene.heat.without_tools(scene.mesh, thickness, boundaries if temperature is None else dict.fromkeys(
        faces, finite("Path.springback: temperature", temperature)))
    if duration is not None:
        return heat, positive("Path.springback: duration", duration)
    return heat, heat.time_through(scene.mesh, thickness)      # differences of temperature decrease by exp(-pi^2)


def _scene(scene: Scene, mesh: Mesh, heat: Any) -> Scene:
    """Return the scene of the part alone, held at symmetry planes and against rigid motion, with `heat` or None."""
    symmetries = [s for s in scene.supports if isinstance(s, Symmetry) and len(mesh.nodes_of(str(s.on)))]
    supports: list[Support] = [*symmetries]
    constrained = {s.component for s in symmetries}
    point = mesh.nodes_of(str(symmetries[0].on) if symmetries else next(iter(mesh.boundaries)))[0]
    if 1 not in constrained:
        supports.append(_FixedComponent(1, point))
    if 0 not in constrained and not scene.kinematics.axisymmetric:
        supports.append(_FixedComponent(0, point))
    return Scene(mesh=mesh, materials=scene.materials, supports=supports, model=scene.model, heat=heat,
                 kinematics=scene.kinematics, quadrature_degree=scene.quadrature_degree,
                 state_transfer=scene.state_transfer,
                 temperature=None if scene.temperature is None else scene.temperature.T,
                 expansion=dict(scene.expansion) or None)


class _FixedComponent(PinnedNode):
    """Constraint of a node, radial (0) or axial (1), against rigid motion; a free body exerts no force on it."""

    def __init__(self, component: int, point: np.ndarray):
        super().__init__(*point)
        self._component = component

    def constraints(self):
        return [Constrained(self._component, point=self.point)]


def _trimmed(mesh: Mesh, wall: Wall, trim: Any) -> tuple[Mesh, float]:
    """Return the mesh up to the nodes nearest to a trim, radius r or ("height", h), and their deformed radius."""
    strips = float(strips_within(wall, trim).sum())                               # an edge has two strips
    last = int(np.clip(round(strips / 2), 1, (len(wall.r) - 1) // 2))
    middle = (wall.profile.reference_bottom + wall.profile.reference_top)[::2] / 2
    return trimmed_mesh(mesh, middle, last), float(wall.r[2 * last])


def _transferred_unknowns(source: Any, state: Any, problem: Problem) -> np.ndarray:
    """Return the owned unknowns of a part in a state of the whole body, and set its fields and history variables."""
    restrict_fields(source, state, problem)
    x = np.zeros(problem.x.getLocalSize())
    x[: problem.n_owned] = problem.forms.w.x.array[: problem.n_owned]
    transfer_histories(source, state, problem, x, 0.0)
    return x
