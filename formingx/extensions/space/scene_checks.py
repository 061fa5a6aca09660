"""Checks of a scene in three dimensions. Combinations that no test has verified are refused."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import numpy as np
from mpi4py import MPI

from ...errors import InputError, call_on_all_ranks, check_name, finite, positive, values
from ...findings import coordinates
from ...mesh.nodes import SAME_PLACE, arguments
from ...physics.loads import CentrifugalLoad, Pressure
from ...physics.supports import PinnedNode, Symmetry
from ...ranks import combined, gathered
from ...values.tolerances import NEGLIGIBLE
from .surface_mesh import SurfaceMesh, closest_points

EXTENT_RATIO = 9.0
"""Ratio of the largest extents of tool and sheet, either way, from which their units of length probably differ.

The sheet may be a quarter of the whole.
"""

_MOST_COMPARED = 200       # of points of a tool, with the triangles of the sheet

_PUSHER_RATIO = 100.0
"""The same ratio for a smaller tool that moves, such as a ball or a pin that is pushed into the sheet."""


_SAME_SHARE = 1e-9
"""Largest difference between two shares of a layer in the thickness of a sheet that count as equal."""


def thicknesses(scene: Any, given: Any) -> dict[str, Callable]:
    """Return {layer: reference thickness as a function of arrays (x, y, z)}, positive at all nodes; collective.

    given: a length, a function of arrays (x, y) or (x, y, z), or {layer: one of these}. Raise `InputError` if the mesh
    is no `SurfaceMesh`, a layer has no thickness, or a thickness is not positive.
    """
    mesh = scene.mesh
    if not isinstance(mesh, SurfaceMesh):
        raise InputError("Scene: mesh: a mesh in three dimensions must come from fx.mesh.sheet, tube, revolved, surface"
                         " or read")
    if given is None:
        raise InputError("Scene: a sheet in three dimensions needs a thickness=...: a length, a function of (x, y) or"
                         " (x, y, z), or {layer: ...}")
    each = given if isinstance(given, Mapping) else dict.fromkeys(mesh.layers, given)
    for name in each:
        check_name("Scene: thickness: layer", name, mesh.layers)
    for name in mesh.layers:
        if name not in each:
            raise InputError(f"Scene: thickness: layer {name!r} has none")
    if not isinstance(given, Mapping) and len(mesh.layers) > 1:
        raise InputError(f"Scene: thickness = {given!r}: the sheet has several layers, {', '.join(mesh.layers)}: must "
                         f"be {{layer: its thickness}}")
    X = mesh.domain.geometry.x
    found: dict[str, Callable] = {}
    for name, h in each.items():
        if callable(h):
            found[name] = function = h if isinstance(h, _OfPosition) else _OfPosition(h)
            call_on_all_ranks(mesh.comm, [partial(_check, name, function, X)])
        else:
            found[name] = _Constant(positive(f"Scene: thickness of {name!r}", h))
    return found


class _Constant:
    """Constant thickness as a function of arrays (x, y, z)."""

    def __init__(self, value: float):
        self.value = value

    def __call__(self, x: Any, y: Any, z: Any = 0.0) -> Any:
        return self.value + 0 * x


class _OfPosition:
    """Thickness as a function of arrays (x, y, z), made from a user's function of (x, y) or (x, y, z)."""

    def __init__(self, function: Callable):
        self.function = function

    def __call__(self, x: Any, y: Any, z: Any = 0.0) -> Any:
        return self.function(*arguments(self.function, {"x": x, "y": y, "z": z}).values())


def _check(name: str, function: _OfPosition, X: np.ndarray) -> None:
    """Raise an `InputError` unless the thickness of a layer is positive at all nodes X, shape (n, 3), length."""
    places = arguments(function.function, dict(zip("xyz", X.T)))
    found = values(f"Scene: thickness of {name!r}", function.function, places)
    if len(found) and found.min() <= 0:
        k = int(np.argmin(found))
        at = ", ".join(f"{x[k]:.6g}" for x in places.values())
        raise InputError(f"Scene: thickness of {name!r} = {found[k]:.6g} at ({at}): must be greater than 0")


def refuse(scene: Any, heat: Any) -> None:
    """Raise an `InputError` for parts of a scene that are not available in three dimensions.

    They are a model other than a membrane, a centrifugal load, a pressure on an edge, a pinned node, a `Symmetry` of an
    edge that does not lie in a plane normal to its axis, and thermal expansion together with heat conduction.
    """
    if scene.model.solid:
        raise InputError(f"Scene: model = {scene.model!r}: a sheet in three dimensions is a Membrane(): solids in three"
                         f" dimensions are not available yet")
    if heat is not None and scene.expansion:
        raise InputError("Scene: expansion: a sheet in three dimensions with heat=... keeps its volume: leave expansion"
                         " out")
    for load in scene.loads:
        if isinstance(load, CentrifugalLoad):
            raise InputError(f"Scene: {load!r}: it spins about the axis of an axisymmetric body, which a sheet in"
                             " three dimensions has not")
        if isinstance(load, Pressure) and load.on not in scene.mesh.faces:
            raise InputError(f"Scene: {load!r}: a surface in three dimensions takes a pressure on its"
                             f" {' or its '.join(map(repr, scene.mesh.faces))}")
    for support in scene.supports:
        if isinstance(support, PinnedNode):
            raise InputError(f"Scene: {support!r}: a sheet in three dimensions is supported at its boundaries, not at"
                             " nodes")
        if isinstance(support, Symmetry) and support.on in scene.mesh.boundaries:
            _check_plane(scene, support)


def depends_on_direction(scene: Any, layer: str) -> bool:
    """Return True if the energy of a layer depends on the direction, as with fibres; collective."""
    material = scene.materials[layer]
    isotropic = material.is_isotropic(scene.sample(layer) if material.varies else None)
    return not combined(scene.mesh.comm, isotropic, MPI.LAND)


def check_laws(scene: Any) -> None:
    """Raise an `InputError` for an energy that depends on the direction in a membrane that wrinkles; collective.

    Tension-field theory knows the relaxed energy of isotropic laws alone.
    """
    if scene.model.wrinkles is None:
        return
    for name in scene.mesh.layers:
        if depends_on_direction(scene, name):
            raise InputError(f"Scene: materials: the energy of {scene.materials[name]} depends on the direction, and"
                             f" Membrane(wrinkles={scene.model.wrinkles:g}) knows the energy in wrinkles of isotropic"
                             f" materials alone: must be Membrane()")


def check_heat(scene: Any, cooling: Any) -> None:
    """Raise an `InputError` for heat conduction (`Cooling`) that a sheet in three dimensions does not have; collective.

    Heat flows through its thickness only, so a law belongs to one of its two faces. A prescribed temperature of a face,
    heating by work, and layers whose shares of the thickness vary from place to place are not available.
    """
    faces = " or ".join(map(repr, scene.mesh.faces))
    for law in cooling.boundaries:
        on = getattr(law, "on", None)
        if on in scene.mesh.boundaries and on not in scene.mesh.faces:
            raise InputError(f"Cooling: {law!r}: {on!r} is an edge, and heat flows through the thickness of a sheet in"
                             f" three dimensions only: must be on {faces}, or left out")
        if type(law).__name__ == "FixedTemperature":
            raise InputError(f"Cooling: {law!r}: a face of a sheet in three dimensions has no prescribed temperature:"
                             f" use ContactWithTool({on!r}, conductance=..., tool=...)")
    if cooling.work_to_heat is not None:
        raise InputError(f"Cooling: work_to_heat = {cooling.work_to_heat:g}: a sheet in three dimensions is not heated"
                         f" by its work: leave it out")
    x = scene.mesh.domain.geometry.x.T
    h = np.array([np.broadcast_to(given(*x), x.shape[1]) for given in scene.thickness.values()])
    shares = gathered(scene.mesh.comm, (h / h.sum(0)).T)
    if np.ptp(shares, axis=0).max() > _SAME_SHARE:
        name = list(scene.thickness)[int(np.argmax(np.ptp(shares, axis=0)))]
        k = list(scene.thickness).index(name)
        raise InputError(f"Scene: thickness of {name!r}: is from {shares[:, k].min():.4g} to"
                         f" {shares[:, k].max():.4g} of the sheet: with heat=... each layer must be the same share of"
                         f" the thickness everywhere")


def _check_plane(scene: Any, support: Symmetry) -> None:
    """Raise an InputError unless the edge of a `Symmetry` lies in a plane normal to its axis; collective."""
    nodes = scene.mesh.nodes_of(support.on)
    flat = np.ptp(nodes, axis=0) < SAME_PLACE * float(max(scene.extent))
    (constraint,) = scene.kinematics.in_axes(support, support.constraints())
    if flat[constraint.component]:
        return
    axis, along = "xyz"[constraint.component], nodes[:, constraint.component]
    fitting = [f"Symmetry({support.on!r}, {name!r})" for name, constant in zip("xy" if scene.mesh.flat else "xyz", flat)
               if constant]
    raise InputError(f"Scene: {support!r}: its plane of symmetry is normal to {axis}, but along the edge"
                     f" {support.on!r} {axis} goes from {along.min():.6g} to {along.max():.6g}: must be"
                     f" {fitting[0] if fitting else 'a straight edge along x or y; another edge can be Clamped'}")


def check_contact(scene: Any, contact: Any) -> None:
    """Check a contact of a sheet: its options, the size of its tool, and that the sheet starts outside it; collective.

    Raise `InputError` for options that three dimensions do not have, for sizes in different units of length, and for a
    sheet inside the tool.
    """
    mesh, tool = scene.mesh, contact.tool
    if contact.on not in mesh.faces:
        raise InputError(f"{contact!r}: a surface in three dimensions touches with its"
                         f" {' or its '.join(map(repr, mesh.faces))}")
    if not contact.sticks and not contact.separates:
        raise InputError(f"{contact!r}: separates = False: a sheet in three dimensions that slides separates where it"
                         f" is in tension: must be 'stick', or without separates=False")
    relaxes = any(material.internal or material.integral for material in scene.materials.values())
    if contact.sticks and contact.separates and relaxes:
        raise InputError(f"{contact!r}: separates = True: a sheet in three dimensions that relaxes sticks where it"
                         f" touches, until a stage leaves the tool out (inactive=[...]): must be 'stick', with"
                         f" separates left out")
    if contact.present_area:
        raise InputError(f"{contact!r}: present_area = True: is for sections: in three dimensions the penalty is per"
                         f" reference area: leave it out")
    if contact.points != "nodes":
        raise InputError(f"{contact!r}: points = {contact.points!r}: in three dimensions contact acts at 'nodes'")
    size, length = float(np.ptp(tool.bounds, axis=0).max()), float(max(scene.extent))
    whole = (2 if any(isinstance(support, Symmetry) for support in scene.supports) else 1) * length
    most = EXTENT_RATIO if contact.direction is None else _PUSHER_RATIO
    if tool.sized and np.isfinite(size) and not 1 / EXTENT_RATIO < whole / size < most:
        raise InputError(f"{contact!r}: the tool is {size:.4g} large, the sheet {whole:.4g}: are the units of length"
                         f" the same (mm, cm, inches)?")
    points = gathered(mesh.comm, mesh.domain.geometry.x)
    depth = tool.signed_distance(points)
    k = int(np.argmax(depth))
    finite(f"{contact!r}: distance to the tool", float(depth[k]))
    h = sum(float(thickness(*points[k:k + 1].T)[0]) for thickness in scene.thickness.values())
    if depth[k] > max(1e-6 * length, NEGLIGIBLE * h):
        place = coordinates(points[k], 6)
        raise InputError(f"{contact!r}: the sheet starts inside the tool: {depth[k]:.6g} deep at (x, y, z) = {place}:"
                         f" move the tool (moved), or is the solid of its profile on the other side (Tool.reversed())?")
    _check_between_nodes(contact, mesh, max(1e-6 * length, NEGLIGIBLE * h))


def _check_between_nodes(contact: Any, mesh: SurfaceMesh, near: float) -> None:
    """Check that no corner of the tool's triangles lies behind a flat sheet, between its nodes; collective.

    Raise `InputError` if one does. near: distance that is allowed, length.
    """
    if not mesh.flat or not contact.tool.sized:
        return
    points, triangles = mesh.whole()
    corners = contact.tool.surface()[0]
    behind = corners[-mesh.faces[contact.on] * _upward(points, triangles) * corners[:, 2] > near]
    inside = ((behind[:, :2] > points[:, :2].min(0)) & (behind[:, :2] < points[:, :2].max(0))).all(1)
    behind = behind[inside] * (1, 1, 0)
    behind = behind[:: max(len(behind) // _MOST_COMPARED, 1)]
    on = behind[closest_points(behind, points[triangles])[2] < near]
    if len(on):
        raise InputError(f"{contact!r}: the sheet starts inside the tool: a part of it, at (x, y) ="
                         f" {coordinates(on[0, :2], 6)}, is behind the sheet between its nodes: move the tool (moved)")


def _upward(points: np.ndarray, triangles: np.ndarray) -> float:
    """Return 1 if the triangles of a flat sheet are counter-clockwise from above, else -1."""
    a, b, c = points[triangles[0]]
    return float(np.sign(np.cross(b - a, c - a)[2]))
