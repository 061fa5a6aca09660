"""Checks for targets that a run cannot reach, before anything is solved."""

from collections.abc import Collection, Iterable
from typing import Any

import numpy as np

from ..errors import InputError
from ..mesh.nodes import SAME_PLACE
from ..mesh.triangles import Triangles
from ..physics.supports import Constrained
from ..values.tolerances import ROUND_OFF
from .scene import Scene

_GRID_SQUARES = 200         # number of squares along a mould's larger side


def check(scene: Scene, targets: Iterable[Any], inactive: Collection[int] | None = None,
          continues: bool = False) -> None:
    """Raise an InputError if a target of a run contradicts the scene (`unreachable`), before anything is solved."""
    for target in targets:
        why = unreachable(scene, target, inactive, continues)
        if why is not None:
            raise InputError(f"{target}: {why}")


def unreachable(scene: Scene, target: Any, inactive: Collection[int] | None = None,
                continues: bool = False) -> str | None:
    """Return the reason why no run of a scene can reach a target, or None.

    inactive: numbers in `Scene.items`, None: a run of `trace`; a run that `continues` may withdraw a tool.
    """
    name, value, driven = target.name, target.value, scene.driven
    active = [item for i, item in enumerate(scene.items) if i not in (inactive or ())]
    moulds = [item for item in active if item in scene.contacts and not item.driven]
    if name in ("pole_height", "pole_stretch") and "axis" not in scene.first.mesh.boundaries:
        return (f"the pole needs a boundary named 'axis'; the mesh has {list(scene.first.mesh.boundaries)}: elsewhere"
                f" take displacement(..., at=..., component=...)")
    if name == "temperature" and scene.heat is None:
        return "the temperature of the scene does not change: give Scene heat=fx.Cooling(...)"
    if name == "pole_stretch" and scene.kinematics.axisymmetric:
        largest, material = max(((m.largest_stretch("equibiaxial"), m) for m in scene.materials.values()),
                                key=lambda found: found[0])
        if value >= largest:
            return f"must be less than {largest:.6g}, where I1 reaches the limit {material.largest_I1:g} of {material}"
    if inactive is None and driven is not None and name in ("pressure", "travel"):
        if name != driven.quantity:
            return f"the run drives {driven!r}, which has no {name}"
        if value < 0 and driven in scene.contacts and driven.separates:
            return f"the travel is negative: {driven!r} would move away from the body"
    if inactive is None and value < 0 and driven in scene.contacts and driven.separates \
            and name in ("force", f"{driven.name}_force"):
        if not driven.friction_by_temperature and driven.mu == 0 or _is_plate(driven):
            return f"{driven!r} can only push: the force must not be negative"
        if not continues and _meets_flat_sheet_alone(scene, driven):
            return (f"{driven!r} comes from outside and nothing else loads the flat body, which pushes it back all the"
                    f" way: the force must not be negative. It pulls only where it is withdrawn: in a stage"
                    f" of a Process, or with start=path")
    if name.startswith("u_") and "_at_" in name and name.partition("_at_")[2].count("_") == 2:
        mesh: Any = scene.mesh
        section = scene.kinematics.components == 2
        if section or mesh.flat:
            right = "(R, Z)" if section else "(x, y) on a flat sheet"
            return f"the position `at` has three coordinates: must be {right}"
    if name.startswith("u_") and "_at_" in name and value != 0:
        found = _constraining_support(scene, name, [t for t in active if t in scene.supports])
        if found is not None:
            return f"{found!r} holds that displacement"
    if name.endswith(("pressure", "travel")):
        return implausible(scene, name.split("_")[-1], value)
    if name == "pole_height":
        for contact in moulds:
            if _pole_in_tool(scene, contact, value):
                return f"it lies inside the tool of {contact!r}"
    if name == "enclosed_volume" and driven is not None and driven.quantity == "pressure":
        for contact in moulds if scene.kinematics.components == 2 else ():
            room, margin = _mould_volume(scene, contact)
            room *= scene.symmetry_factor
            if value > margin * room:
                return f"the tool of {contact!r} has room for {room:.4g}"
    return None


def implausible(scene: Scene, quantity: str | None, value: float) -> str | None:
    """Return why a "pressure" or "travel" is over 1e9 shear moduli or extents of a scene, or None."""
    if quantity == "pressure":
        what, unit = "the shear modulus", max([scene.shear_modulus(name) for name in scene.mesh.layers])
    elif quantity == "travel":
        what, unit = "the length of the body", float(max(scene.extent))
    else:
        return None
    if ROUND_OFF * abs(value) <= unit:                       # beyond it the unit is round-off of the value
        return None
    return f"it is {abs(value) / unit:.2g} times {what}, {unit:.4g} (are the units right?)"


def _is_plate(contact: Any) -> bool:
    """Return True if a tool is a plane normal to its direction: friction on it has no component along the direction."""
    profile: Any = getattr(contact.tool, "profile", contact.tool)
    if getattr(profile, "sized", True):
        return False
    a, b = profile.pieces[0].ends
    return bool(a[1] == b[1]) and not any(contact.direction[:-1])


def _meets_flat_sheet_alone(scene: Scene, contact: Any) -> bool:
    """Return True if a tool along Z alone loads a flat sheet without a hole, which resists at each travel."""
    tool = scene.same_tool(scene.items.index(contact))
    others = [item for i, item in enumerate(scene.items) if item.driven and i not in tool]
    if scene.loads or others or scene.heat is not None or scene.expansion or scene.state_transfer is not None:
        return False
    face = scene.mesh.nodes_of(contact.on)
    near = SAME_PLACE * max(scene.extent)
    hole = scene.kinematics.components == 2 and face[:, 0].min() > near
    return np.ptp(face[:, -1]) < near and not hole and not any(contact.direction[:-1])


def _constraining_support(scene: Scene, name: str, supports: list[Any]) -> Any:
    """Return the support that holds the displacement of a target, such as "u_r_at_1_0.5", or None."""
    component, place = name.removeprefix("u_").split("_at_")
    point, near = np.array([float(x) for x in place.split("_")]), SAME_PLACE * max(scene.extent)
    for support in supports:
        for constraint in scene.kinematics.in_axes(support, support.constraints()):
            if isinstance(constraint, Constrained) and not constraint.driven \
                    and scene.kinematics.axes[constraint.component] == component:
                nodes = np.array([constraint.point]) if constraint.on is None else scene.mesh.nodes_of(constraint.on)
                if np.hypot(*(nodes[:, : len(point)] - point).T).min() < near:
                    return support
    return None


def _pole_in_tool(scene: Scene, contact: Any, height: float) -> bool:
    """Return True if the pole of the contact face would lie deeper inside the tool than the body is thick.

    `height` is the axial displacement of the pole, length. The result is False for a face without a pole.
    """
    nodes = scene.mesh.nodes_of(contact.on)
    pole = nodes[np.argmin(nodes[:, 0])]
    if contact.tool.components == 3 or pole[0] > 1e-9 * max(scene.extent):
        return False
    depth = contact.tool.signed_distance((pole + [0.0, height])[None])[0]
    return float(depth) > Triangles(scene.mesh).thickness


def _mould_volume(scene: Scene, contact: Any) -> tuple[float, float]:
    """Return the volume between a body and its mould by squares of a grid, and an upper bound over it.

    Both, length^3 or length^2, are infinite in an open mould. Squares next to a flat body, outside the tool, count.
    """
    from scipy.ndimage import binary_dilation, label
    face = scene.mesh.nodes_of(contact.on)
    if scene.mesh.columns is not None and np.ptp(face[:, 1]) > np.ptp(face[:, 0]):
        return _mould_volume_of_tube(scene, contact, scene.mesh.line_of(contact.on)), 1 + 1 / _GRID_SQUARES
    low = scene.mesh.nodes_of(scene.driven.on)[:, 1].min()
    edge, top = face.max(0)
    outline = contact.tool.bounds[1]
    if np.ptp(face[:, 1]) > SAME_PLACE * edge or face[:, 0].min() > 0 or outline[1] <= top:
        return np.inf, 1.0
    corner = np.maximum(outline, face.max(0))
    size = max(corner[0], corner[1] - low) / _GRID_SQUARES
    r, z = (start + (np.arange(np.ceil((end - start) / size) + 1) + 0.5) * size
            for start, end in ((0.0, corner[0]), (low, corner[1])))
    points = np.stack(np.meshgrid(r, z, indexing="ij"), -1)
    free = contact.tool.signed_distance(points.reshape(-1, points.shape[-1])).reshape(points.shape[:2]) < 0
    free &= (points[..., 1] > top) | (points[..., 0] < edge)
    regions, _ = label(free)
    inside = (regions == regions[0, 0]) & free
    if inside[-1].any() or inside[:, -1].any():
        return np.inf, 1.0
    weight = size**2 * np.array([scene.kinematics.weight((R, 0.0)) for R in r])
    volume, bound = (float(weight @ squares.sum(1)) for squares in (inside, binary_dilation(inside)))
    return volume, bound / volume


def _mould_volume_of_tube(scene: Scene, contact: Any, line: np.ndarray) -> float:
    """Return the volume between a closed tube's outer face (n, 2) and its mould, length^3; inf if that is open."""
    from scipy.ndimage import label
    line = line if line[0, 1] < line[-1, 1] else line[::-1]
    (r, top), (low, width) = line[-1], (contact.tool.bounds[0, 1], contact.tool.bounds[1, 0])
    if line[0, 0] > SAME_PLACE * width or width < r or low > line[0, 1]:
        return np.inf
    n = int(np.ceil(_GRID_SQUARES * (top - low) / max(width, top - low)))
    size = (top - low) / n
    R, Z = (np.arange(np.ceil(width / size) + 2) + 0.5) * size, low + (np.arange(-2, n) + 0.5) * size
    points = np.stack(np.meshgrid(R, Z, indexing="ij"), -1)
    part = np.clip(0.5 - contact.tool.signed_distance(points.reshape(-1, 2)) / size, 0, 1).reshape(points.shape[:2])
    regions, _ = label(part > 0)
    part[regions != regions[0, np.argmin(np.abs(Z - line[0, 1]))]] = 0
    if part[-1].any() or part[:, 0].any():
        return np.inf
    weight = np.array([scene.kinematics.weight((r, 0.0)) for r in R])
    disc = lambda r: r * scene.kinematics.weight((r / 2, 0.0))             # noqa: E731  volume per height inside r
    within = sum((b[1] - a[1]) / 6 * (disc(a[0]) + 4 * disc((a[0] + b[0]) / 2) + disc(b[0]))
                 for a, b in zip(line, line[1:]))
    return float(size**2 * (weight * part.sum(1)).sum() - within)
