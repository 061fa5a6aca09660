"""Discs, spheres and parisons."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from mpi4py import MPI

from ..errors import InputError, count, finite, known, non_negative, positive
from .gmsh import from_gmsh
from .mesh import Mesh

ACCURACY = {"draft": (20, 1), "standard": (40, 2), "fine": (80, 4)}
"""Elements of a disc (along the radius, least number through each layer): see the README for what each promises."""
_TALLEST = 1.5
"""Height over width of such elements at most: the inf-sup constant of P2 + bubble / P1dg falls as triangles get slim,
and across a thick sheet, which bends, they lock (benchmarks/thickness.py)."""


def disc(*, radius: float, thickness: float | Mapping[str, float], accuracy: str = "standard",
         elements: tuple | None = None, grading: float = 1.0, concentrate: Mapping[float, float] | None = None,
         inner_radius: float = 0.0, comm: MPI.Comm = MPI.COMM_WORLD) -> Mesh:
    """A flat disc (or ring) in the (R, Z) plane, bottom face on Z = 0.

    Boundaries: `axis` (R = inner_radius; called `inner` if that is above 0), `rim`, `bottom`, `top`.

    Args:
        radius, inner_radius: lengths.
        thickness: a length (one layer, called `sheet`), or {layer name: its thickness} from bottom to top.
        accuracy: "draft", "standard" or "fine": how many elements; more of them through layers so thick that they would
            be more than 1.5 times taller than wide (as for `thickness` = `radius` in thicker ones).
        elements: (along the radius, through each layer), in place of `accuracy`; the latter may be a tuple, one count
            per layer. Each rectangle is two triangles.
        grading: size of the last element at the rim over that of the first at the axis.
        concentrate: in place of `grading`, {reference radius: size of the elements there over that of the largest}, for
            example around a plug's edge. Sizes grow linearly with the distance from these radii; nodes lie on them.

    Raises:
        InputError: a size that is not positive, a count that is not a whole number of at least 1, a radius to
            concentrate at that is not on the disc, or fewer elements than there are parts between such radii.
    """
    radius = positive("disc: radius", radius)
    grading = positive("disc: grading", grading)
    inner_radius = non_negative("disc: inner_radius", inner_radius)
    if inner_radius >= radius:
        raise InputError(f"disc: inner_radius = {inner_radius!r}: must be at least 0 and below radius = {radius!r}")
    sides = ("axis" if inner_radius == 0 else "inner", "rim", "bottom", "top")
    known("disc: accuracy", accuracy, ACCURACY)
    elements = _preset(accuracy, radius - inner_radius, thickness) if elements is None else elements
    sizes = None if concentrate is None else _sizes(concentrate, inner_radius, radius)
    if sizes and grading != 1:
        raise InputError(f"disc: grading = {grading!r} and concentrate = {concentrate!r}: give one of them")
    mesh = _layered("disc", (inner_radius, radius), 0.0, thickness, elements, grading, sides, comm)
    if sizes:
        x, along = mesh.domain.geometry.x, int(elements[0])
        half = np.rint(2 * along * (x[:, 0] - inner_radius) / (radius - inner_radius))      # gmsh has some 12 digits
        x[:, 0] = np.interp(half / 2, np.arange(along + 1), _concentrated(inner_radius, radius, along, sizes))
    return mesh


def _preset(accuracy: str, length: float, thickness: float | Mapping[str, float]) -> tuple[int, list[int]]:
    """(elements along, through each layer) of a disc: near squares in thick layers."""
    along, least = ACCURACY[accuracy]
    tallest = _TALLEST * length / along
    return along, [max(least, int(np.ceil(min(h, length) / tallest - 1e-9)))
                   for h in _heights("disc", thickness, "sheet").values()]


def _heights(kind: str, thickness: float | Mapping[str, float], layer: str) -> dict[str, float]:
    """{layer name: its thickness}, checked."""
    layers = dict(thickness) if isinstance(thickness, Mapping) else {layer: thickness}
    if not layers:
        raise InputError(f"{kind}: thickness = {{}}: must name at least one layer")
    return {name: positive(f"{kind}: thickness of {name!r}", h) for name, h in layers.items()}


def _sizes(concentrate: Mapping[float, float], low: float, high: float) -> dict[float, float]:
    """`concentrate` of a disc, checked, sorted by radius."""
    if not isinstance(concentrate, Mapping) or not concentrate:
        raise InputError(f"disc: concentrate = {concentrate!r}: must be {{reference radius: relative size}}")
    sizes = {}
    for radius, size in concentrate.items():
        radius, size = finite("disc: concentrate: radius", radius), positive(f"disc: concentrate at {radius!r}", size)
        if not low <= radius <= high:
            raise InputError(f"disc: concentrate: radius = {radius!r}: must be from {low!r} to {high!r}")
        if not 1e-6 <= size <= 1:
            raise InputError(f"disc: concentrate at {radius!r} = {size!r}: must be from 1e-6 to 1")
        sizes[radius] = size
    return dict(sorted(sizes.items()))


def _concentrated(low: float, high: float, along: int, sizes: dict[float, float]) -> np.ndarray:
    """Ends of `along` elements from low to high, shape (along + 1,), with relative `sizes` at some radii."""
    at, small = np.array(list(sizes)), np.array(list(sizes.values()))
    ends = np.unique([low, *at, high])
    if along < len(ends) - 1:
        raise InputError(f"disc: elements along the radius = {along}: must be at least {len(ends) - 1}, one between"
                         f" each two radii of concentrate = {sizes!r}")
    steps = np.geomspace(1e-9, 1, 4001) * (high - low)      # fine where elements are small
    R = np.unique(np.clip([*ends, *np.add.outer(at, steps).ravel(), *np.subtract.outer(at, steps).ravel()], low, high))
    away = np.abs(np.subtract.outer(R, at))
    size = (small + (1 - small) * away / away.min(1).max()).min(1)
    number = np.concatenate([[0.0], np.cumsum(np.diff(R) * (1 / size[1:] + 1 / size[:-1]) / 2)])
    at_ends = np.interp(ends, R, number)
    marks = np.round(along * at_ends / number[-1]).astype(int)
    spare = np.arange(len(ends))                             # at least one element between two ends
    marks = np.minimum(np.maximum.accumulate(marks - spare) + spare, along - spare[::-1])
    joints = np.interp(np.interp(np.arange(along + 1), marks, at_ends), number, R)
    joints[marks] = ends
    return joints


def sphere(*, inner_radius: float, thickness: float | Mapping[str, float], elements: tuple = (16, 8),
           grading: float = 1.0, comm: MPI.Comm = MPI.COMM_WORLD) -> Mesh:
    """The upper half of a hollow sphere about the origin of the (R, Z) plane: a quarter of an annulus.

    Boundaries: `axis` (R = 0), `equator` (Z = 0), `inner`, `outer`. All nodes, those on edges too, lie where polar
    coordinates put them: second-order geometry.

    Args:
        inner_radius: length.
        thickness: a length (one layer, called `wall`), or {layer name: its thickness} from the inside out.
        elements: (from the axis to the equator, through each layer), as in `disc`.
        grading: size of the last element at the equator over that of the first at the axis.

    Raises:
        InputError: as in `disc`.
    """
    inner_radius = positive("sphere: inner_radius", inner_radius)
    mesh = _layered("sphere", (0.0, np.pi / 2), inner_radius, thickness, elements, positive("sphere: grading", grading),
                    ("axis", "equator", "inner", "outer"), comm, layer="wall")
    x = mesh.domain.geometry.x
    angle, radius = x[:, 0].copy(), x[:, 1].copy()
    x[:, 0], x[:, 1] = radius * np.sin(angle), radius * np.sin(np.pi / 2 - angle)
    return mesh


def parison(*, inner_radius: float, thickness: float | Mapping[str, float], length: float, elements: tuple = (60, 2),
            grading: float = 1.0, comm: MPI.Comm = MPI.COMM_WORLD) -> Mesh:
    """A closed tube, open at the top: the lower half of a hollow sphere about the origin, and a tube from Z = 0 up.

    Boundaries: `axis` (R = 0), `inner`, `outer`, `neck` (Z = length). All nodes of the bottom, those on edges too, lie
    where polar coordinates put them: second-order geometry.

    Args:
        inner_radius, length: of the tube, lengths.
        thickness: a length (one layer, called `wall`), or {layer name: its thickness} from the inside out.
        elements: (from the axis to the neck, through each layer), as in `disc`.
        grading: size of the last element at the neck over that of the first at the axis.

    Raises:
        InputError: as in `disc`; fewer than two elements along the meridian.
    """
    inner_radius, length = positive("parison: inner_radius", inner_radius), positive("parison: length", length)
    grading = positive("parison: grading", grading)
    mesh = _layered("parison", (0.0, 1.0), inner_radius, thickness, elements, 1 / grading,
                    ("neck", "axis", "inner", "outer"), comm, layer="wall")
    along = int(elements[0])
    if along < 2:
        raise InputError(f"parison: elements along the meridian = {along}: must be at least 2, one in the bottom and"
                         f" one in the tube")
    x = mesh.domain.geometry.x
    from_neck, radius = x[:, 0].copy(), x[:, 1].copy()
    # the mesh has its elements along [0, 1] from the neck; the joint of tube and bottom becomes a node
    joints = np.concatenate([[0.0], np.cumsum(grading ** (-np.arange(along) / max(along - 1, 1)))])
    joints /= joints[-1]
    wall = thickness if not isinstance(thickness, Mapping) else sum(thickness.values())
    joint = length / (length + np.pi / 2 * (inner_radius + wall / 2))
    node = joints[1 + np.argmin(np.abs(joints[1:-1] - joint))]
    for place in (node, 1.0):                              # gmsh places nodes to some ten digits
        from_neck[np.abs(from_neck - place) < 1e-6] = place
    z = length * np.maximum(1 - from_neck / node, 0.0)
    angle = np.pi / 2 * np.maximum((from_neck - node) / (1 - node), 0.0)
    x[:, 0], x[:, 1] = radius * np.sin(np.pi / 2 - angle), z - radius * np.sin(angle)
    return mesh


def _layered(kind: str, ends: tuple, bottom: float, thickness: float | Mapping[str, float], elements: tuple,
             grading: float, sides: tuple, comm: MPI.Comm, layer: str = "sheet") -> Mesh:
    """Layers of triangles over the interval `ends`, from `bottom` up; `sides` names left, right, bottom and top."""
    layers = _heights(kind, thickness, layer)
    if not (hasattr(elements, "__len__") and len(elements) == 2):
        raise InputError(f"{kind}: elements = {elements!r}: must be (along the {_ALONG[kind]}, through each layer)")
    along = count(f"{kind}: elements along the {_ALONG[kind]}", elements[0])
    through = elements[1] if hasattr(elements[1], "__len__") else [elements[1]] * len(layers)
    if len(through) != len(layers):
        raise InputError(f"{kind}: elements through the layers = {through!r}: {len(layers)} layers need as many counts")
    through = [count(f"{kind}: elements through a layer", n) for n in through]
    ratio = grading ** (1 / (along - 1)) if along > 1 else 1.0

    def build(model):
        geo = model.geo
        levels = np.concatenate([[bottom], bottom + np.cumsum(list(layers.values()))])
        points = [[geo.addPoint(r, z, 0) for r in ends] for z in levels]
        across = [geo.addLine(*p) for p in points]
        left = [geo.addLine(a[0], b[0]) for a, b in zip(points, points[1:])]
        right = [geo.addLine(a[1], b[1]) for a, b in zip(points, points[1:])]
        for line in across:
            geo.mesh.setTransfiniteCurve(line, along + 1, "Progression", ratio)
        faces = []
        for k, n in enumerate(through):
            for line in (left[k], right[k]):
                geo.mesh.setTransfiniteCurve(line, n + 1)
            faces.append(geo.addPlaneSurface([geo.addCurveLoop([across[k], right[k], -across[k + 1], -left[k]])]))
            geo.mesh.setTransfiniteSurface(faces[-1], "AlternateLeft")
        geo.synchronize()
        for name, face in zip(layers, faces):
            model.addPhysicalGroup(2, [face], name=name)
        for name, lines in zip(sides, (left, right, across[:1], across[-1:])):
            model.addPhysicalGroup(1, lines, name=name)
        model.mesh.generate(2)
        model.mesh.setOrder(2)

    return from_gmsh(build, comm)


_ALONG = {"disc": "radius", "sphere": "meridian", "parison": "meridian"}
