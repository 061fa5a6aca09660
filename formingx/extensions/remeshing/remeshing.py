"""Runs with remeshing: the deformed body becomes the reference configuration of a new mesh, F = grad x . F_old.

Remeshing serves strongly compressed blocks. If the volume ratio J at a quadrature point leaves its range, the interior
of the present outline is meshed again. The new mesh receives the deformation, the pressures, and the contact tractions.
The first state on it has the same control (such as a travel) and the kind "remesh".
"""

from __future__ import annotations

import functools
import logging
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ...errors import ConvergenceError, InputError, pair, positive
from ...forms.outline import Outline
from ...forms.transfer import transfer_histories
from ...materials.constants import OfMesh
from ...measures.targets import Amplitude, Target
from ...physics.contact import Contact
from ...physics.supports import Support
from ...problem.problem import Problem
from ...run_hooks import RunExtension
from ...solve.arc_length import Curve
from ...solve.newton import Failure, Tolerances, fixed
from ...solve.path_following import Run
from ...solve.record import Record, Segment
from ...solve.state import State
from ...solve.stepping import StepControl
from .contact_transfer import ContactState, transfer_contact
from .earlier_meshes import scene_on_new_mesh
from .outline_mesh import enclosed_volume, mesh_of_outline, refined_points, without_pockets
from .state_transfer import StateTransfer

log = logging.getLogger("formingx")

_SIZE_STEP = 0.1  # relative change of the element size from one try to the next
_SIZE_FACTORS = [1 + k * _SIZE_STEP for k in (0, -1, 1, -2)]
"""Element sizes to try, relative to the requested size."""

_GOOD_MARGIN = 0.4
"""Distance of J from its limits, over the distance of 1, above which a new mesh is good at once."""

_MIN_STATES = 3
"""Number of states on a mesh from which its quality may be the cause of a failed step."""

_VOLUME_CHANGE = 0.1
"""Volume change |J - 1| above which the mesh may be the cause of a failed step."""

_MAX_FAILURES = 4
"""Maximum number of successive states without a new mesh."""

_MIN_VOLUME_MARGIN = 0.5
"""Smallest J over its lower limit, below which the run ends if no new mesh is found."""

_POCKET_DEPTH = 0.25
"""Depth over the element size up to which a gap between body and tool is closed."""

_OWN_ENTRIES = "step", "counts", "until", "column"
"""Entries of `State.stepping` that `Record.complete_step` writes itself."""

_POOR_MESH = "the mesh needs renewal"
"""Reason for the end of a run that needs a new mesh."""


@dataclass(frozen=True)
class Remesh(RunExtension):
    """Criterion of remeshing and element sizes, for `formingx.trace(remesh=...)`.

    Args:
        size: edge length of the elements on the deformed body, length.
        corner: edge length where faces under tools meet and where contact ends, length; default a third of `size`.
        volume_ratio: (smallest, largest) volume ratio J since the mesh was made, at the quadrature points. Outside this
            range the body is remeshed. J of an incompressible material is 1 on a good mesh.

    Raises:
        InputError: a size that is not positive, `corner` above `size`, or a range without 1.

    >>> fx.Remesh(size=0.5, corner=0.1)
    Remesh(size=0.5, corner=0.1, volume_ratio=(0.6, 1.5))
    """

    size: float
    corner: float | None = None
    volume_ratio: tuple[float, float] = (0.6, 1.5)
    argument = "remesh"

    def __post_init__(self) -> None:
        positive("Remesh: size", self.size)
        if self.corner is not None and positive("Remesh: corner", self.corner) > self.size:
            raise InputError(f"Remesh: corner = {self.corner!r}: must be at most size = {self.size!r}")
        low, high = pair("Remesh: volume_ratio", self.volume_ratio)
        if not 0 < low < 1 < high:
            raise InputError(f"Remesh: volume_ratio = {self.volume_ratio!r}: must be a number between 0 and 1, and one"
                             f" above 1")

    def check(self, caller: str, scene: Any, targets: Sequence[Target]) -> None:
        """Raise an InputError if the scene or a target cannot be transferred to another mesh.

        Args:
            caller: name of the calling function, for messages.
            scene: the `Scene`.
            targets: targets of the run.

        Raises:
            InputError: the scene has a part that is not transferred, or a target is not a travel, pressure or time.
        """
        _check(caller, scene, targets)

    def attach(self, path: Any) -> None:
        """Let a run check its mesh at each state and continue on new meshes."""
        record = path.record
        record.hooks.renew = functools.partial(_run_with_remeshing, path, self, record.curve.newton.tolerances)


def _check(caller: str, scene: Any, targets: Sequence[Target]) -> None:
    """Raise an InputError if the scene or a target of a run cannot be transferred to another mesh."""
    reason = ""
    if scene.mesh.comm.size > 1:
        reason = "several ranks (gmsh makes a mesh on one): run without mpirun"
    elif not scene.model.solid:
        reason = "a membrane"
    elif scene.kinematics.components > 2:
        reason = "a sheet in three dimensions"
    elif len(scene.mesh.layers) > 1:
        reason = "several layers"
    elif any(isinstance(constant, OfMesh) for material in scene.materials.values()
             for constant in material.constants().values()):
        reason = "a constant that is a Function on the mesh: give a function of (R, Z)"
    elif scene.expansion:
        reason = "thermal expansion"
    elif any(type(support).stored_energy is not Support.stored_energy or any(
            constraint.point is not None for constraint in support.all_constraints()) for support in scene.supports):
        reason = "a support at a node, or an elastic one"
    elif any(not contact.separates or contact.points != "nodes" for contact in scene.contacts):
        reason = "a contact with separates=False, or at Gauss points"
    elif any(type(contact).law is not Contact.law for contact in scene.contacts):
        reason = "a law of contact of one's own"
    if reason:
        raise InputError(f"{caller}: remesh: is not available with {reason}")
    for target in targets:
        if not target.name.endswith(("travel", "pressure", "process_time")):
            raise InputError(f"{caller}: remesh: target {target}: must be a travel, a pressure or a process_time: other"
                             f" measures change a little at each remeshing, and may jump over their target")


def _run_with_remeshing(path: Any, remesh: Remesh, tolerances: Tolerances, part: Callable[[], None],
                        done: Callable[[], bool]) -> None:
    """Continue a run to its end, with a new mesh whenever the elements are too distorted; path in place.

    `part` runs on the last mesh until its end; `done` is True for a complete path. Otherwise a ConvergenceError is
    raised.
    """
    record = path.record
    record.hooks.on_state.append(lambda state: _check_mesh(record, state, remesh))
    poor = bool(record.states) and _needs_remeshing(record, record.last, remesh)
    failed: list[State] = []
    while not (poor and done()):
        record.problem.contact.limit.predictor = None            # check the mesh at each gap closure
        if poor:
            try:
                _start_new_mesh(path, remesh, tolerances)
                failed = []
            except ConvergenceError as error:                # a mesh may succeed at the next state
                crushed = _volume_ratios(record, record.last)[0] < _MIN_VOLUME_MARGIN * remesh.volume_ratio[0]
                if crushed or len(failed) == _MAX_FAILURES or any(record.last is state for state in failed):
                    raise _not_reached(record, error) from None
                failed.append(record.last)
                log.info("the old mesh is kept for a state: %s", error)
        record.ended = ""
        try:
            part()
        except ConvergenceError as error:
            low, high = _volume_ratios(record, record.last) if record.states else (1.0, 1.0)
            if len(record.segments[-1].states) < _MIN_STATES or low > 1 - _VOLUME_CHANGE and high < 1 + _VOLUME_CHANGE:
                raise                                        # the mesh is not the cause
            log.info("a new mesh, as no state was found: %s", error)
            record.ended = _POOR_MESH
        poor = record.ended == _POOR_MESH
        if not poor:
            return
    record.ended = ""


def _not_reached(record: Record, error: ConvergenceError) -> ConvergenceError:
    """Return the error of a run that ends before its target since no new mesh has an equilibrium, for that reason."""
    name, value = next(s.stepping for s in reversed(record.segments[-1].states) if s.stepping)["until"]
    stage = f"Stage {record.stage!r}: " * bool(record.stage)
    return ConvergenceError(f"{stage}{Target(name, value, None)} was not reached: {error}. The last good state is"
                            f" {record.describe(record.last)}; it is kept in the error's `path`.")


def _start_new_mesh(path: Any, remesh: Remesh, tolerances: Tolerances) -> None:
    """Remesh the body, and add the first state on the new mesh, in equilibrium, to the path, else ConvergenceError."""
    record, last = path.record, path.last
    stepping = next(s.stepping for s in reversed(record.segments[-1].states) if s.stepping)
    step = stepping["step"]
    first = record.segments[-1].states[0].stepping.get("step", step)
    segment, start = _best_mesh(path, remesh, tolerances)
    record.segments.append(segment)
    try:
        path._view(segment)
        record.stage = last.stage
        record.accept(start)
    except BaseException:
        record.segments.pop()                                # no state on the new mesh: the path ends before it
        raise
    if segment.problem.contact.faces:
        segment.curve.update_path_tangent(start)
    record.counts.iterations += segment.curve.spent()
    name, value = stepping["until"]
    record.complete_step(StepControl(**step | {"length": min(step["length"], 4 * first["length"])}),
                         Target(name, value, None), **{k: v for k, v in stepping.items() if k not in _OWN_ENTRIES})


def _best_mesh(path: Any, remesh: Remesh, tolerances: Tolerances) -> tuple[Segment, State]:
    """Return a new segment of a path: a new mesh of the body in its last state, and the equilibrium on it.

    Of several element sizes, the first, else the best, mesh with J far from the limits `Remesh.volume_ratio` is taken.
    None in equilibrium raises a ConvergenceError.
    """
    low, high = remesh.volume_ratio
    found, reason = [], ""
    for share in _SIZE_FACTORS:
        try:
            segment, start = _new_mesh(path, remesh, tolerances, share)
        except (ConvergenceError, Failure, InputError) as error:
            reason = reason or str(getattr(error, "reason", error))
            continue
        segment.problem.x.array_w[:] = start.x
        segment.problem.set_fields(start.x, start.control)
        smallest, largest = segment.problem.admissible.volume_ratios()
        found.append((min((smallest - low) / (1 - low), (high - largest) / (high - 1)), segment, start))
        if found[-1][0] > _GOOD_MARGIN:
            break
    if not found:
        raise ConvergenceError(f"remesh: no equilibrium was found on a new mesh ({len(_SIZE_FACTORS)} sizes were"
                               f" tried): {reason}")
    _, segment, start = max(found, key=lambda entry: entry[0])
    return segment, start


def _volume_ratios(record: Record, state: State) -> tuple[float, float]:
    """Return the smallest and largest volume ratio J since the mesh was made, at the quadrature points in a state."""
    with record.problem.state_context(state) as problem:
        return problem.admissible.volume_ratios()


def _check_mesh(record: Record, state: State, remesh: Remesh) -> None:
    """End the run on the present mesh if J, the volume ratio since it was made, leaves `Remesh.volume_ratio`.

    `State.jump` of a "remesh" state gets the relative changes of force and strain energy.
    """
    if state.kind == "remesh":
        before = record.segments[-2].states[-1].measures
        force = next((name for name in before if name.endswith("force")), None)
        for quantity, name in (("force", force), ("energy", "strain_energy")):
            if name and before.get(name):
                state.jump[quantity] = state.measures[name] / before[name] - 1
        log.info("a new mesh: %s", state.jump)
    elif _needs_remeshing(record, state, remesh):
        record.ended = _POOR_MESH


def _needs_remeshing(record: Record, state: State, remesh: Remesh) -> bool:
    """Return True if J since the mesh was made leaves `Remesh.volume_ratio` in a state after the first on this mesh."""
    if state.kind in ("start", "remesh"):
        return False
    low, high = _volume_ratios(record, state)
    return not (remesh.volume_ratio[0] <= low and high <= remesh.volume_ratio[1])


def _new_mesh(path: Any, remesh: Remesh, tolerances: Tolerances, share: float) -> tuple[Segment, State]:
    """Return a new segment of a path: a new mesh of the body in its last state, and the equilibrium on it.

    `share` is the element size over the requested size.
    """
    record, old, state = path.record, path.problem, path.last
    scene = old.scene
    outline = Outline(old.forms)
    with old.state_context(state):
        edges = outline.edges()
        masks = {name: outline.mask(name) for name in scene.mesh.boundaries}
        x_old = old.x.array_r[: old.n_owned].copy()
        contacts = [(c, ContactState.of(c, x_old, state.control), c.tool_displacement(state.control))
                    for c in old.contacts]
    touched = [(c.contact.on, before.position[before.touches] + travel) for c, before, travel in contacts]
    order = outline.ordered("remesh")
    names = [frozenset(name for name, mask in masks.items() if mask[k]) for k in order]
    sizes = share * remesh.size, share * (remesh.corner or remesh.size / 3)
    volume = enclosed_volume(edges[order], scene.kinematics.axisymmetric)
    on_tools = np.concatenate([edges[:0, 0], *(points for _, points in touched)])
    edges = without_pockets(edges[order], on_tools, _POCKET_DEPTH * sizes[1])
    corners = refined_points(edges, names, touched)
    layer, = scene.mesh.layers
    mesh = mesh_of_outline(edges, names, corners, *sizes, layer, scene.kinematics.axisymmetric, scene.mesh.comm, volume,
                    lambda x, names: _moved_out_of_tools(x, names, contacts))
    new_scene = scene_on_new_mesh(mesh, StateTransfer.of(old, state))
    problem = Problem(new_scene)
    problem.contact.limit.predictor = None
    setting, control = old.setting.transferred(old.description.scales, problem.description.scales, state.control)
    curve = Curve(problem, tolerances)
    x = new_scene.state_transfer.unknowns(problem)
    problem.enter(setting, x, control)
    if not setting.rate[-1]:
        problem.history.clock = state.time
    transfer_histories(old, state, problem, x, control, moved=True)
    for new, (_, before, _) in zip(problem.contacts, contacts, strict=True):
        transfer_contact(new, before, x[: problem.n_owned], control)
    volume = problem.forms.volume / old.forms.volume / (1 + state.measures["mass_error"]) - 1
    x = x if setting.fading else _balanced(problem, curve, x, control)      # a fading stage fades the residual, too
    start = curve.resume(x, control)
    if start.slope * state.slope < 0:
        start.direction, start.slope, start.orientation = -start.direction, -start.slope, -start.orientation
    start.kind, start.jump, start.target = "remesh", {"volume": volume}, state.target
    record.counts.iterations += curve.spent()
    return Segment(problem, curve), start


def _balanced(problem: Problem, curve: Curve, x: np.ndarray, control: float) -> np.ndarray:
    """Return unknowns x (n,) in equilibrium on a new mesh, by Newton or fading forces, else a ConvergenceError."""
    first = problem.setting
    problem.x.array_w[:] = x
    try:
        curve.newton.correct(problem.x, control, fixed(control))
        if not problem.has_inverted_element(problem.x, control):
            return problem.x.array_r.copy()
        reason = "an element turned inside out"
    except Failure as failure:
        reason = failure.reason
    log.info("the forces that a new mesh leaves without balance are taken away gradually: %s", reason)
    time = problem.history.time_at(control)
    constant = replace(first, base=[*first.amplitudes(control)[:-1], time], rate=[0.0] * len(first.rate), fading=True)
    record, target = Record(problem, curve), Target("change", 1.0, None)
    try:
        problem.enter(constant, x, 0.0)
        Run(record, [(target, Amplitude(problem, None))]).follow(200, False, curve.resume(x, 0.0))
    except (ConvergenceError, Failure) as error:
        raise ConvergenceError(f"remesh: no equilibrium was found on a new mesh: {error}; give Remesh another size, or"
                               f" a range of volume_ratio nearer to 1") from None
    problem.enter(first, record.last.x, control)
    problem.history.clock += time - problem.history.time_at(control)         # the step data of a flow stage exclude it
    return record.last.x


def _moved_out_of_tools(x: np.ndarray, names: frozenset[str],
                        contacts: list[tuple[Any, ContactState, np.ndarray]]) -> np.ndarray:
    """Return outline points x, shape (n, 2), moved out of tools to the depth of the old points beside them.

    Contacts are (contact, contact state, travel of the tool (2,), length) of the boundaries `names`.
    """
    for contact, before, travel in contacts:
        if contact.contact.on in names:
            near = contact.contact.tool.nearest(x - travel)
            x = x - before.outward_motion(x - travel, near.distance)[:, None] * near.normal
    return x
