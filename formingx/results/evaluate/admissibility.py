"""Check of a state before the run accepts it: can the body have this shape, with these contact forces?"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from ...contact import resultants
from ...findings import Finding, coordinates, percent
from ...forms.outline import Outline, edge_points
from ...mesh.nodes import without_round_off
from ...ranks import gathered
from ...scene.tool_width import CUT
from ...solve.state import State
from ...values.tolerances import DIFFERENCE_STEP, FAR, LARGE_ERROR, NEGLIGIBLE, WARNED_ERROR


@dataclass(frozen=True)
class AdmissibilityLimits:
    """Limits of volumes, depths and forces beyond which a state is inadmissible, all dimensionless.

    Attributes:
        volume: largest root mean square of J - 1 over the body, J = det F. Creases at clamped rims and at corners of
            coarse blocks stay below 0.17.
        inverted_elements: largest fraction of the elements that have a point with J <= 0.
        allowed_elements: number of elements with J <= 0 that is allowed on any mesh, because corners are singular.
        depth: largest depth of the boundary in a tool, divided by the sheet thickness or, if it is larger, by the
            length of the element edge.
        penetration: largest penetration of a contact point, over the deformed wall there. Beyond it the body did not
            follow the tool. Williams' plug on coarse elements reaches 0.051.
        largest_energy_ratio: factor c of the bound c E/W of the estimated relative error of a tool force. Penetration
            stores the energy E, the body the strain energy W. The bound matters for a body that is pressed flat.
    """

    volume: float = 0.25
    inverted_elements: float = 0.05
    allowed_elements: int = 4
    depth: float = 0.25
    penetration: float = 0.15
    largest_energy_ratio: float = 3.0


_LIMITS = AdmissibilityLimits()


class Depth(NamedTuple):
    """Deepest point of a body in a tool.

    Attributes:
        ratio: `depth` over the allowed depth, above 1.
        depth: distance of the point inside the tool from the tool's surface, positive, length.
        place: deformed position of the point, shape (2,) or (3,), length.
        contact: the `FaceContact` with the tool.
        name: name of the `Contact` with the tool, or of its boundary if it has no name.
        held: True for a point that supports constrain in all directions.
    """

    ratio: float
    depth: float
    place: np.ndarray
    contact: Any
    name: str
    held: bool = False

    @property
    def words(self) -> str:
        """Depth, tool and position of a contact point in three dimensions, as a sentence without a full stop."""
        position = coordinates(without_round_off(self.place, self.place), 5)
        return f"A contact point is {self.depth:.4g} deep in the tool of {self.name!r} at (x, y, z) = {position}"


class AdmissibilityCheck:
    """Check of the states of one problem; an inadmissible state satisfies the equations, but no real body can have it.

    Examples are inverted elements, a face inside a tool, or tool forces of points that penetrate the tool too far.
    """

    def __init__(self, problem: Any):
        self._problem, self._solid = problem, problem.scene.model.solid
        self._images = problem.scene.symmetry_factor
        if self._solid:
            self._outline = Outline(problem.forms)
            self._faces = [self._outline.mask(contact.contact.on) for contact in problem.contacts]
            self._reference_lengths = _lengths(self._outline.reference_edges)

    def findings(self, state: State) -> list[Finding]:
        """Return findings on penetration of the tools in an admissible state, empty if all are small; collective.

        A warning in a section: penetration changes a tool force by more than 0.2 % (`WARNED_ERROR`), or the face is
        deeper than a tenth of the thickness (`CUT`). "serious" in three dimensions: a point deeper than a tenth of
        `FaceContact.reference_length`.
        """
        if not self._solid:
            deepest = self._deepest_points(state, lambda contact: CUT * contact.reference_length)
            return [Finding("serious", deep.name, f"{deep.words}: shorter steps (StepControl(length=...)), or a larger"
                                                  " penalty.") for deep in deepest]
        with self._problem.state_context(state):
            edges, found = self._outline.edges(), list[Finding]()
            lengths = _lengths(edges)
            for contact in self._problem.contact.faces:
                error = _force_error(contact, state, self._images)
                if error > WARNED_ERROR:
                    name = contact.contact.label
                    found.append(Finding("warning", name, f"Penetration changes the force on the tool of {name!r} by"
                                         f" about {percent(error)}: {_penalty_advice(contact, error)}."))
            for cut in self._deepest(edges, lengths, state, on_face=True):
                found.append(Finding("warning", cut.name, f"Between contact points the face is {cut.depth:.3g} deep in"
                                     f" the tool of {cut.name!r} at (r, z) = {coordinates(cut.place, 5)}:"
                                     f" smaller elements there, or a larger fillet."))
        return found

    def reasons(self, state: State) -> Iterator[str]:
        """Yield each reason why a state with output quantities (`State.measures`) is inadmissible, as text; collective.
        """
        measures = state.measures
        for name, value in measures.items():
            if not np.isfinite(value):
                yield f"the {name.replace('_', ' ')} is {value}"
        if measures.get("pole_stretch", 1.0) > FAR:        # 1e150 stands for a stretch of 0
            yield "the two faces cross at the pole"
        if not self._solid:
            for deep in self._deepest_points(state, _allowed_penetration):
                yield f"{deep.words}: " + (
                    "the sheet is held there and cannot give way: use a smaller tool, a shorter travel or a wider sheet"
                    if deep.held else "the step was too long, or smaller triangles are needed there")
            if self._problem.scene.kinematics.components == 3:
                yield from self._problem.forms.self_penetration.reasons(state.x)
            return
        if measures["volume_error"] > _LIMITS.volume:
            yield (f"the elements do not keep their volumes: the root mean square of J - 1 is"
                   f" {measures['volume_error']:.2g}")
        with self._problem.state_context(state) as problem:
            bad, cells, (R, Z) = problem.admissible.inverted_elements()
            if bad > max(_LIMITS.allowed_elements, _LIMITS.inverted_elements * cells):
                yield (f"{bad} of {cells} elements are inside out, the worst at (R, Z) = {coordinates((R, Z), 5)}:"
                       " remesh on the way (trace(remesh=Remesh(size=...)), for a crushed block), or adapt the mesh"
                       f" by a pilot run (trace(adapt_mesh=True), for a sheet over an edge)")
            edges = self._outline.edges()
            lengths = _lengths(edges)
            for deep in self._deepest(edges, lengths, state, on_face=False):
                yield (f"the body is {deep.depth:.4g} deep in the tool of {deep.name!r} at (r, z) ="
                       f" {coordinates(deep.place, 5)}: a face without a Contact is there, or the"
                       f" elements are too large for the tool")
            for deep in self._excess_penetration(edges, lengths, state):
                yield (f"the body did not follow the tool of {deep.name!r}: contact points are {deep.depth:.4g} deep in"
                       f" it, {percent(deep.ratio * _LIMITS.penetration)} of the remaining wall: give Contact a"
                       f" penalty of {50 * deep.ratio * deep.contact.contact.penalty:.1g}")
            for contact in problem.contact.faces:
                error = _force_error(contact, state, self._images)
                if error > LARGE_ERROR and resultants.penetration(
                        contact, state.x, state.control) > NEGLIGIBLE * contact.thickness:
                    yield (f"the body did not follow the tool of {contact.contact.label!r}: penetration changes"
                           f" the force by about {percent(error)}: {_penalty_advice(contact, error)}")
                if _pulled(contact, state):
                    yield (f"the body pulls at the tool of {contact.contact.label!r}, which has no friction and cannot"
                           f" hold it: it is behind the tool")
        place = self._outline.self_intersection(edges)
        if place is not None:
            yield f"the body folds: its boundary goes through itself near (r, z) = {coordinates(place, 5)}"

    def _deepest(self, edges: np.ndarray, lengths: np.ndarray, state: State, on_face: bool) -> Iterator[Depth]:
        """Yield for each active tool of a section the deepest point of the boundary in it, if deeper than allowed.

        Edges (m, 3, 2) have first end, last end and middle, lengths (m,); no point is farther from these than max
        |dx/ds| / 4, so most edges are skipped. `on_face` takes only the face towards the tool, with the limit `CUT`.
        """
        a, b, middle = edges.transpose(1, 0, 2)
        slopes = np.linalg.norm([4 * middle - 3 * a - b, a - 4 * middle + 3 * b], axis=-1)
        for contact, face in zip(self._problem.contacts, self._faces):
            if not contact.active:
                continue
            allowed = _LIMITS.depth * np.maximum(contact.thickness, lengths)
            if on_face:
                allowed = np.where(face, CUT * contact.thickness, np.inf)
            near = np.flatnonzero(_depths(contact, edges, state).max(1) + slopes.max(0) / 4 > allowed)
            if not len(near):
                continue
            points = edge_points(edges[near])
            depth = _depths(contact, points, state)
            share = depth.max(1) / allowed[near]
            k = int(np.argmax(share))
            if share[k] > 1:
                yield Depth(share[k], depth[k].max(), points[k, np.argmax(depth[k])], contact, contact.contact.label)

    def _deepest_points(self, state: State, allowed: Callable[[Any], Any]) -> Iterator[Depth]:
        """Yield for each tool in three dimensions the deepest contact point, if it is deeper than allowed; collective.

        `allowed` returns the limit of a `FaceContact` for its n contact points, shape (n,) or a number, length.
        """
        if self._problem.scene.kinematics.components < 3:
            return
        with self._problem.state_context(state) as problem:
            for contact in problem.contact.faces:
                x = contact.positions(state.x, state.control)
                depth, place = contact.law.distance(x), x + contact.tool_displacement(state.control)
                held = np.isin(contact.rule.dofs, problem.constrained).all(1)
                rows = gathered(contact.comm, np.column_stack([depth / allowed(contact), depth, held, place]))
                k = int(np.argmax(rows[:, 0]))
                if rows[k, 0] > 1:
                    yield Depth(rows[k, 0], rows[k, 1], rows[k, 3:], contact, contact.contact.label, bool(rows[k, 2]))

    def _excess_penetration(self, edges: np.ndarray, lengths: np.ndarray, state: State) -> Iterator[Depth]:
        """Yield for each tool the edge with the largest penetration over wall, if it exceeds the limit.

        Edges: (m, 3, 2), lengths: (m,). The largest of three nodes counts; contact points must be nodes.
        """
        weight, reference = self._problem.scene.kinematics.weight, self._outline.reference_edges
        for contact, face in zip(self._problem.contacts, self._faces):
            if not contact.active or contact.contact.points != "nodes" or not face.any():
                continue
            depth = _depths(contact, edges[face], state).max(1)
            grown = lengths[face] / self._reference_lengths[face]
            grown = grown * weight(edges[face, 2].T) / weight(reference[face, 2].T)
            share = depth * grown / (_LIMITS.penetration * contact.thickness)
            k = int(np.argmax(share))
            if share[k] > 1:
                yield Depth(share[k], depth[k], edges[face][k, 2], contact, contact.contact.label)


def _depths(contact: Any, points: np.ndarray, state: State) -> np.ndarray:
    """Return the depths of points (m, n, components) in the tool of a contact, shape (m, n); negative outside."""
    positions = points - contact.tool_displacement(state.control)
    return contact.contact.tool.signed_distance(positions.reshape(-1, positions.shape[-1])).reshape(positions.shape[:2])


def _allowed_penetration(contact: Any) -> np.ndarray:
    """Return the limits of depth of contact points in space, (n,), length; inf for those new in the last step."""
    allowed = _LIMITS.depth * np.maximum(contact.thickness, contact.rule.lengths)
    return np.where(contact.area < contact.rule.area, np.inf, allowed)


def _force_error(contact: Any, state: State, images: int) -> float:
    r"""Return the estimated relative error of the force F on a moving tool due to penetration; collective.

    Penetration stores the energy E. It adds about 2 E/F to the travel t of the tool at this force. With the strain
    energy W of the body and c = `AdmissibilityLimits.largest_energy_ratio`, the estimate is

    .. math:: \min\left(\frac{2 E}{F^2} \left|\frac{dF}{dt}\right|, \; c \, \frac{E}{W}\right)

    E/W is returned if it is below 0.02 %, a tenth of `WARNED_ERROR`, or if F or the change of t is 0. For a fixed tool
    0 is returned. `state` has the column "strain_energy" of the whole part, which is `images` modelled bodies.
    """
    if not contact.contact.driven:
        return 0.0
    energy = resultants.energy(contact, state.x, state.control)
    share = images * energy / (state.measures.get("strain_energy") or np.inf)
    if share < 0.1 * WARNED_ERROR:
        return share
    direction = contact.contact.travel_vector / np.hypot(*contact.contact.travel_vector)
    states = [(state.x + s * state.direction, state.control + s * state.slope)
              for s in (-DIFFERENCE_STEP, 0.0, DIFFERENCE_STEP)]
    backward, force, forward = (resultants.force(contact, *point) @ direction for point in states)
    travel = (contact.tool_displacement(states[2][1]) - contact.tool_displacement(states[0][1])) @ direction
    if not force or not travel:
        return share
    return min(2 * energy * abs((forward - backward) / travel) / force**2, _LIMITS.largest_energy_ratio * share)


def _penalty_advice(contact: Any, error: float) -> str:
    """Return advice on a larger penalty as text, from the relative error of the tool force."""
    return f"give Contact a penalty of {contact.contact.penalty * error / WARNED_ERROR * 10:.1g}"


def _pulled(contact: Any, state: State) -> bool:
    """Return True if the body pulls a frictionless moving tool forward along its travel; collective."""
    law = contact.contact
    if not law.driven or not law.separates or law.friction_by_temperature or law.mu > 0:
        return False
    force = resultants.force(contact, state.x, state.control) @ law.travel_vector / np.hypot(*law.travel_vector)
    return bool(force > NEGLIGIBLE * resultants.normal_force(contact, state.x, state.control))


def _lengths(edges: np.ndarray) -> np.ndarray:
    """Return the lengths of curved edges, shape (m,), from (first end, last end, middle), shape (m, 3, 2)."""
    return np.linalg.norm(np.diff(edge_points(edges, 4), axis=1), axis=-1).sum(1)
