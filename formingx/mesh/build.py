"""Discs, spheres, parisons, and bodies between two lines."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from mpi4py import MPI

from ..errors import InputError, as_points, count, finite, known, non_negative, positive
from .grid import Grid, to_mesh
from .mesh import Columns, Mesh

ACCURACY = {"draft": (20, 1), "standard": (40, 2), "fine": (80, 4)}
"""Elements of a disc (along the radius, usual number through each layer): docs/accuracy.md says what each promises."""
_TALLEST = 1.5
"""Height over width of such elements at most: the inf-sup constant of P2 + bubble / P1dg falls as triangles get slim,
and across a thick sheet, which bends, they lock (benchmarks/thickness.py)."""
_BENDS = 1 / 40
"""A hinged sheet bends within a few thicknesses of its rim: thickness over length from which on that is seen."""
_BENDING = {"draft": 1, "standard": 4, "fine": 6}
"""Least number of elements through it then. (Narrower ones at the rim would do with fewer, but there a clamped one
creases.)"""
_FILM = 1 / 400
"""Thickness over length below which none of that is seen: one element through each layer; more cost accuracy, by
round-off, and from 1/1e5 on the start."""
_MOST = 250_000            # rectangles of a mesh

Thickness = float | Callable[[float], float] | Mapping[float, float]
"""Of a layer: a length; or, where it varies along the sheet, a function of the coordinate, or a table {coordinate:
length}, linear between its points."""


def disc(*, radius: float, thickness: Thickness | Mapping[str, Thickness], accuracy: str = "standard",
         elements: tuple | None = None, grading: float = 1.0, concentrate: Mapping[float, float] | None = None,
         inner_radius: float = 0.0, comm: MPI.Comm = MPI.COMM_WORLD) -> Mesh:
    """Return a disc (or ring) in the (R, Z) plane, bottom face on Z = 0.

    Boundaries: `axis` (R = inner_radius; called `inner` if that is above 0), `rim`, `bottom`, `top`.

    Args:
        radius, inner_radius: lengths.
        thickness: a length (one layer, called `sheet`), or {layer name: its thickness} from bottom to top. Each may
            vary with the radius: a function of R, or a table {R: thickness}, linear between its radii (all nodes lie
            on it, those on edges too).
        accuracy: "draft", "standard" or "fine": how many elements; more of them through sheets that bend near the rim,
            and through layers so thick that they would be more than 1.5 times taller than wide (as for `thickness` =
            `radius` in thicker ones); one through each layer of films, thinner than 1/400 of the radius.
        elements: (along the radius, through each layer), in place of `accuracy`. The second entry may be a row with an
            entry for each layer: a count, or the relative sizes of its elements from the bottom up, as in
            (60, [[1, 2, 4], 2]). A single layer needs no outer row, (60, [1, 2, 4]). Each rectangle is two triangles.
        grading: size of the last element at the rim over the first at the axis, 1e-6 to 1e6.
        concentrate: in place of `grading`, {reference radius: size of the elements there over the largest}, for
            example around a plug's edge. Sizes grow linearly with the distance from these radii; nodes lie on them.

    Raises:
        InputError: a size is not positive, or a count is not a positive whole number. A radius in `concentrate` is
            not on the disc. There are fewer elements than intervals between these radii. The thickness is not given
            at every radius of the disc.

    >>> print(fx.mesh.disc(radius=40.0, thickness={"core": 1.0, "skin": 0.2}, elements=(30, (2, 1))))
    180 six-node triangles, R from 0 to 40, Z from 0 to 1.2
    layers: core, skin
    boundaries: axis (3 edges), rim (3 edges), bottom (30 edges), top (30 edges)
    """
    radius = positive("disc: radius", radius)
    grading = _grading("disc", grading)
    inner_radius = non_negative("disc: inner_radius", inner_radius)
    if inner_radius >= radius:
        raise InputError(f"disc: inner_radius = {inner_radius!r}: must be at least 0 and below radius = {radius!r}")
    sides = ("axis" if inner_radius == 0 else "inner", "rim", "bottom", "top")
    known("disc: accuracy", accuracy, ACCURACY)
    layers = _layers("disc", thickness, "sheet", "R")
    if elements is None:
        elements = _preset(accuracy, inner_radius, radius, layers)
    along, through = _counts("disc", "radius", elements, len(layers))
    sizes = None if concentrate is None else _sizes(concentrate, inner_radius, radius)
    if sizes and grading != 1:
        raise InputError(f"disc: grading = {grading!r} and concentrate = {concentrate!r}: give one of them")
    joints = (_concentrated(inner_radius, radius, along, sizes) if sizes
              else inner_radius + (radius - inner_radius) * _graded(along, grading))

    def points(R: np.ndarray) -> np.ndarray:
        Z = _levels(layers, through, R)
        return np.stack([np.broadcast_to(R, Z.shape), Z], axis=-1)
    return _mesh("disc", points, joints, list(sizes or ()), list(layers), through, sides, comm)


def _preset(accuracy: str, low: float, high: float, layers: Mapping[str, Any]) -> tuple[int, list[int]]:
    """(elements along, through each layer) of a disc: near squares in thick layers."""
    along, usual = ACCURACY[accuracy]
    R = np.linspace(low, high, along + 1)
    thick = np.array([min(float(thickness_at(R).max()) / (high - low), 1.0) for thickness_at in layers.values()])
    whole = thick.sum()
    if whole < _FILM:
        return along, [1] * len(layers)
    bending = _BENDING[accuracy] * thick / whole if whole >= _BENDS else 0.0
    return along, np.maximum(usual, np.ceil(np.maximum(bending, thick * along / _TALLEST) - 1e-9)).astype(int).tolist()


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
    """Return the ends of `along` elements from low to high, shape (along + 1,), with relative `sizes` at some radii."""
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
    """Return the upper half of a hollow sphere about the origin of the (R, Z) plane: a quarter of an annulus.

    Boundaries: `axis` (R = 0), `equator` (Z = 0), `inner`, `outer`. All nodes, those on edges too, lie where polar
    coordinates put them: second-order geometry.

    Args:
        inner_radius: length.
        thickness: a length (one layer, called `wall`), or {layer name: its thickness} from the inside out.
        elements: (from the axis to the equator, through each layer), as in `disc`.
        grading: size of the last element at the equator over the first at the axis.

    Raises:
        InputError: as in `disc`.

    >>> list(fx.mesh.sphere(inner_radius=1.0, thickness=0.2, elements=(8, 2)).boundaries)
    ['axis', 'equator', 'inner', 'outer']
    """
    inner_radius = positive("sphere: inner_radius", inner_radius)
    layers = _layers("sphere", thickness, "wall", "")
    along, through = _counts("sphere", "meridian", elements, len(layers))

    def points(angle: np.ndarray) -> np.ndarray:
        radius = inner_radius + _levels(layers, through, angle)
        return np.stack([radius * np.sin(angle), radius * np.sin(np.pi / 2 - angle)], axis=-1)
    ends = np.pi / 2 * _graded(along, _grading("sphere", grading))
    return _mesh("sphere", points, ends, [], list(layers), through, ("axis", "equator", "inner", "outer"), comm)


def parison(*, inner_radius: float, thickness: Thickness | Mapping[str, Thickness], length: float,
            elements: tuple = (60, 2), grading: float = 1.0, comm: MPI.Comm = MPI.COMM_WORLD) -> Mesh:
    """Return a closed tube, open at the top: the lower half of a hollow sphere about the origin, and a tube above.

    Boundaries: `axis` (R = 0), `inner`, `outer`, `neck` (Z = length). All nodes of the bottom, those on edges too, lie
    where polar coordinates put them: second-order geometry.

    Args:
        inner_radius, length: of the tube, lengths.
        thickness: a length (one layer, called `wall`), or {layer name: its thickness} from the inside out. Each may
            vary (a programmed wall): a function of Z, or a table {Z: thickness}, linear between its heights. Z
            belongs to the inner face, from -inner_radius at the bottom to `length`; thickness is measured along its
            normal.
        elements: (from the axis to the neck, through each layer), as in `disc`.
        grading: size of the last element at the neck over the first at the axis.

    Raises:
        InputError: as in `disc`; fewer than two elements along the meridian.

    >>> wall = {-10.0: 2.0, 60.0: 3.0}                                         # at heights of the inner face
    >>> tube = fx.mesh.parison(inner_radius=10.0, thickness=wall, length=60.0, elements=(20, 1))
    >>> float(tube.nodes_of("neck")[-1, 0])
    13.0
    """
    inner_radius, length = positive("parison: inner_radius", inner_radius), positive("parison: length", length)
    grading = _grading("parison", grading)
    layers = _layers("parison", thickness, "wall", "Z")
    along, through = _counts("parison", "meridian", elements, len(layers))
    if along < 2:
        raise InputError(f"parison: elements along the meridian = {along}: must be at least 2, one in the bottom and"
                         f" one in the tube")
    # elements lie along [0, 1] from the neck; the joint of tube and bottom is a node
    joints = _graded(along, 1 / grading)
    wall = float(sum(thickness_at(np.zeros(1))[0] for thickness_at in layers.values()))
    joint = length / (length + np.pi / 2 * (inner_radius + wall / 2))
    node = joints[1 + np.argmin(np.abs(joints[1:-1] - joint))]

    def points(from_neck: np.ndarray) -> np.ndarray:
        z = length * np.maximum(1 - from_neck / node, 0.0)
        angle = np.pi / 2 * np.maximum((from_neck - node) / (1 - node), 0.0)
        radius = inner_radius + _levels(layers, through, z - inner_radius * np.sin(angle))
        return np.stack([radius * np.sin(np.pi / 2 - angle), z - radius * np.sin(angle)], axis=-1)
    sides = ("neck", "axis", "inner", "outer")
    return _mesh("parison", points, joints, [node], list(layers), through, sides, comm)


def from_lines(inner: Any, outer: Any, *, elements: tuple = (1, 2), layers: Mapping[str, float] | None = None,
               comm: MPI.Comm = MPI.COMM_WORLD) -> Mesh:
    """Return a body between two lines through points, point k of the one opposite point k of the other.

    Between points k and k + 1 the faces are straight: a curve takes as many points as it needs.

    Boundaries: `inner`, `outer`, `start` and `end` (from the first or last point of one line to the other; called
    `axis` where both points have R = 0).

    Args:
        inner, outer: (R, Z) of their points, shape (n, 2), length; n is at least 2, and the same.
        elements: (between each two points and the next, through each layer): counts, or a row of n - 1 counts, and
            the second entry of `elements` in `disc`.
        layers: {layer name: its part of the way from `inner` to `outer`, in any unit}; default one, called `wall`.

    Raises:
        InputError: points are not finite, are fewer than 2, or differ in number between the lines. The lines cross or
            meet. A count is not a positive whole number.

    >>> cone = fx.mesh.from_lines([(0, 0), (20, 0), (30, 40)], [(0, -2), (21, -2), (32, 40)], elements=([8, 16], 2))
    >>> print(cone)
    96 six-node triangles, R from 0 to 32, Z from -2 to 40
    layers: wall
    boundaries: end (2 edges), axis (2 edges), inner (24 edges), outer (24 edges)
    """
    lines = [_points(f"from_lines: {name}", points) for name, points in (("inner", inner), ("outer", outer))]
    if len(lines[0]) != len(lines[1]):
        raise InputError(f"from_lines: inner has {len(lines[0])} points, outer {len(lines[1])}: they must be as many")
    parts = _layers("from_lines", {"wall": 1.0} if layers is None else layers, "wall", "")
    if not _is_row(elements) or len(elements) != 2:
        raise InputError(f"from_lines: elements = {elements!r}: must be (between two points, through each layer)")
    pieces, given = len(lines[0]) - 1, elements[0]
    along = [count("from_lines: elements between two points", n)
             for n in (given if _is_row(given) else [given] * pieces)]
    if len(along) != pieces:
        raise InputError(f"from_lines: elements between points = {given!r}: {pieces} pieces need as many counts")
    _, through = _counts("from_lines", "lines", (sum(along), elements[1]), len(parts))
    ends = np.concatenate([[0.0], *(k + np.arange(1, n + 1) / n for k, n in enumerate(along))])
    level = _levels(parts, through, np.zeros(1))
    around = np.concatenate([lines[0], lines[1][::-1]])
    names = ["axis" if all(line[k, 0] == 0 for line in lines) else name for k, name in ((0, "start"), (-1, "end"))]
    if names[0] == names[1]:
        names = ["start", "end"]
    if np.sum(around[:, 0] * np.roll(around[:, 1], -1) - np.roll(around[:, 0], -1) * around[:, 1]) < 0:
        # the body lies to the left of `inner`
        lines, names, ends = [line[::-1] for line in lines], names[::-1], pieces - ends[::-1]

    def between(at: np.ndarray) -> np.ndarray:
        first, second = (np.stack([np.interp(at, np.arange(pieces + 1), line[:, i]) for i in (0, 1)], axis=-1)
                         for line in lines)
        return first + (level / level[-1])[:, :, None] * (second - first)
    return _mesh("from_lines", between, ends, np.arange(1, pieces), list(parts), through, (*names, "inner", "outer"),
                 comm)


def _points(name: str, points: Any) -> np.ndarray:
    found = np.array(as_points(name, points))
    if len(found) < 2 or not np.all(np.isfinite(found)):
        raise InputError(f"{name} = {points!r}: must be at least two points (R, Z) of finite numbers")
    return found


def _layers(kind: str, thickness: Any, alone: str, coordinate: str) -> dict[str, Callable]:
    """{name of a layer: its thickness at coordinates, shape (n,)}; `coordinate` is "" where it cannot vary."""
    named = isinstance(thickness, Mapping) and all(isinstance(name, str) for name in thickness)
    layers = dict(thickness) if named else {alone: thickness}
    if not layers:
        raise InputError(f"{kind}: thickness = {{}}: must name at least one layer")
    return {name: _thickness(f"{kind}: thickness of {name!r}", given, coordinate) for name, given in layers.items()}


def _thickness(caller: str, given: Any, coordinate: str) -> Callable[[np.ndarray], np.ndarray]:
    if not coordinate or not (callable(given) or isinstance(given, Mapping)):
        value = positive(caller, given)
        return lambda x: np.full(len(x), value)
    if callable(given):
        return lambda x: np.array([positive(f"{caller} at {coordinate} = {v:.6g}",
                                            _called(given, v, caller, coordinate))
                                   for v in map(float, x)])
    points = sorted((finite(f"{caller}: {coordinate}", at), positive(f"{caller} at {coordinate} = {at!r}", h))
                    for at, h in given.items())
    ends, values = np.array(points).reshape(-1, 2).T

    def between(x):
        near = 1e-9 * max(np.abs(x).max(), 1e-300)
        if len(ends) < 2 or x.min() < ends[0] - near or x.max() > ends[-1] + near:
            raise InputError(f"{caller} = {given!r}: must cover {coordinate} from {x.min():.6g} to {x.max():.6g}")
        return np.interp(x, ends, values)
    return between


def _called(function: Callable, v: float, caller: str, coordinate: str) -> Any:
    try:
        return function(v)
    except Exception as error:
        raise InputError(f"{caller} at {coordinate} = {v:.6g}: the function raised {type(error).__name__}:"
                         f" {error}") from error


def _grading(kind: str, grading: Any) -> float:
    grading = positive(f"{kind}: grading", grading)
    if not 1e-6 <= grading <= 1e6:
        raise InputError(f"{kind}: grading = {grading!r}: must be from 1e-6 to 1e6")
    return grading


def _counts(kind: str, along_what: str, elements: Any, layers: int) -> tuple[int, list[np.ndarray]]:
    """Return the number of elements along the sheet, and the ends of those through each layer, on [0, 1]."""
    if not _is_row(elements) or len(elements) != 2:
        raise InputError(f"{kind}: elements = {elements!r}: must be (along the {along_what}, through each layer)")
    along = count(f"{kind}: elements along the {along_what}", elements[0])
    through = list(elements[1]) if _is_row(elements[1]) else [elements[1]] * layers
    if layers == 1 and len(through) > 1:
        through = [through]
    if len(through) != layers:
        raise InputError(f"{kind}: elements through the layers = {through!r}: {layers} layers need as many counts")
    ends = [_ends(kind, given) for given in through]
    rectangles = along * sum(len(found) - 1 for found in ends)
    if rectangles > _MOST:
        raise InputError(f"{kind}: elements = {elements!r}: {rectangles} rectangles: at most {_MOST}")
    return along, ends


def _ends(kind: str, given: Any) -> np.ndarray:
    """Return the ends of the elements through a layer on [0, 1], of their number or their relative sizes."""
    if not _is_row(given):
        n = count(f"{kind}: elements through a layer", given)
        if n > _MOST:
            raise InputError(f"{kind}: elements through a layer = {given!r}: must be at most {_MOST}")
        return np.linspace(0.0, 1.0, n + 1)
    sizes = np.array([positive(f"{kind}: relative size of an element through a layer", size) for size in given])
    if not len(sizes) or sizes.max() > 1e6 * sizes.min():
        raise InputError(f"{kind}: relative sizes of elements through a layer = {given!r}: must be at least one, the"
                         f" largest at most 1e6 times the smallest")
    ends = np.concatenate([[0.0], np.cumsum(sizes / sizes.max())])
    return ends / ends[-1]


def _is_row(values: Any) -> bool:
    return isinstance(values, tuple | list) or isinstance(values, np.ndarray) and values.ndim == 1


def _graded(along: int, grading: float) -> np.ndarray:
    """Return the ends of `along` elements on [0, 1] whose sizes grow by one ratio, the last `grading` times the
    first."""
    sizes = grading ** (np.arange(along) / max(along - 1, 1))
    ends = np.concatenate([[0.0], np.cumsum(sizes)])
    return ends / ends[-1]


def _with_middles(joints: np.ndarray) -> np.ndarray:
    """Return the ends of elements and the middles between them, shape (2 n + 1,)."""
    both = np.empty(2 * len(joints) - 1)
    both[::2], both[1::2] = joints, (joints[1:] + joints[:-1]) / 2
    return both


def _levels(layers: Mapping[str, Callable], through: list[np.ndarray], coordinates: np.ndarray) -> np.ndarray:
    """Distance of all rows of nodes from the first face, shape (number of rows, number of coordinates)."""
    rows = [np.zeros(len(coordinates))]
    for thickness_at, ends in zip(layers.values(), through):
        h, base = thickness_at(coordinates), rows[-1]
        rows += [base + h * at for at in _with_middles(ends)[1:]]
    return np.array(rows)


def _mesh(kind: str, place: Callable[[np.ndarray], np.ndarray], ends: np.ndarray, fixed: Any, layers: list[str],
          through: list[np.ndarray], sides: tuple, comm: MPI.Comm) -> Mesh:
    """Triangles on rows and columns of nodes; `sides`: names of left, right, bottom, top.

    Diagonals alternate, as a chessboard's fields in each layer. place, ends, fixed: see `Columns`.
    """
    points = place(_with_middles(ends))
    number = np.arange(points.shape[0] * points.shape[1]).reshape(points.shape[:2])
    triangles, first = {}, 0
    halves = np.array([[[(0, 0), (1, 0), (1, 1)], [(1, 1), (0, 1), (0, 0)]],          # (column, row) of corners
                       [[(0, 0), (1, 0), (0, 1)], [(0, 1), (1, 0), (1, 1)]]])
    for name, n in zip(layers, (len(ends) - 1 for ends in through)):
        i, j = np.meshgrid(np.arange(points.shape[1] // 2), np.arange(n), indexing="ij")
        corners = 2 * (halves[(i + j) % 2] + np.stack([i, j], axis=-1)[..., None, None, :]).reshape(-1, 3, 2)
        nodes = np.concatenate([corners, (corners + np.roll(corners, -1, axis=1)) // 2], axis=1)
        triangles[name] = number[first + nodes[..., 1], nodes[..., 0]]
        first += 2 * n
    lines = (number[:, 0][::-1], number[:, -1], number[0], number[-1][::-1])
    boundaries = {name: np.stack([line[:-2:2], line[2::2], line[1::2]], axis=1) for name, line in zip(sides, lines)}
    flat = points.reshape(-1, 2)
    made = to_mesh(lambda: Grid(flat, np.arange(1, len(flat) + 1), triangles, boundaries), comm, kind)
    return replace(made, columns=Columns(ends, np.asarray(fixed, dtype=float), sides[2:], place, lambda ends: _mesh(
        kind, place, ends, fixed, layers, through, sides, comm)))
