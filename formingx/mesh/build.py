"""Meshes of discs, spheres, parisons, and bodies between two lines."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from mpi4py import MPI

from ..errors import InputError, as_points, check_name, count, finite, non_negative, positive
from .divisions import (
    Thickness,
    checked_grading,
    divisions,
    graded_ends,
    is_sequence,
    layer_thicknesses,
    levels,
    with_middles,
)
from .grid import Grid, to_mesh
from .mesh import Columns, Mesh, Preset

ACCURACY = {"draft": (20, 1), "standard": (40, 2), "fine": (80, 4)}
"""Elements of a disc (along the radius, usual number through each layer): see docs/accuracy.md."""
_ASPECT_RATIO = 1.5
"""Largest height over width of elements. The inf-sup constant of P2 + bubble / P1dg decreases for slim triangles, and
in a thick sheet, which bends, they lock (benchmarks/thickness.py)."""
_BENDING_THICKNESS = 1 / 40
"""Thickness over length above which the bending of a hinged sheet near its rim matters."""
_BENDING_ELEMENTS = {"draft": 1, "standard": 4, "fine": 6}
"""Smallest number of elements through such a sheet. (Narrower elements at the rim would need fewer, but there a clamped
sheet creases.)"""
_FILM_THICKNESS = 1 / 400
"""Thickness over length below which one element through each layer is enough. More elements increase the round-off;
below 1/1e5 a run would not start."""


def disc(*, radius: float, thickness: Thickness | Mapping[str, Thickness], accuracy: str = "standard",
         elements: tuple | None = None, grading: float = 1.0, concentrate: Mapping[float, float] | None = None,
         inner_radius: float = 0.0, comm: MPI.Comm = MPI.COMM_WORLD) -> Mesh:
    """Return the mesh of a disc or ring in the (R, Z) plane, with its bottom face on Z = 0.

    Boundaries: `axis` (R = inner_radius; called `inner` for a ring), `rim`, `bottom`, `top`.

    Args:
        radius: outer radius, length.
        inner_radius: radius of the hole of a ring, length.
        thickness: a length (one layer, called `sheet`), or {layer name: its thickness} from bottom to top. It may vary:
            a function of R, or a table {R: thickness}, interpolated linearly. All nodes lie on this shape, mid-edge
            nodes too.
        accuracy: "draft", "standard" or "fine", for the number of elements. Sheets that bend near the rim get more
            elements through the thickness. Thick layers get more, too, so that no element is taller than 1.5 times its
            width. Films thinner than 1/400 of their radial extent get one element a layer. Where a tool touches the
            sheet, the `Scene` chooses other elements: short ones where the sheet reaches a fillet of the tool,
            and fewer through the thickness (docs/accuracy.md). A given `grading` or `concentrate` is kept.
        elements: (number along the radius, division of the layers), in place of `accuracy`. The division is a number of
            elements through each layer, or a list with an entry for each layer. An entry is a number, or relative sizes
            of elements from the bottom up, as in (60, [[1, 2, 4], 2]). A single layer needs no outer list: (60, [1, 2,
            4]). Each rectangle is divided into two triangles.
        grading: size of the element at the rim over the element at the axis, 1e-6 to 1e6.
        concentrate: in place of `grading`, {reference radius: element size there over the largest}, for example around
            the edge of a plug. A node is placed at each of these radii. Sizes grow linearly with the distance from it.
        comm: MPI communicator.

    Returns:
        The mesh, of quadratic triangles.

    Raises:
        InputError: a size is not positive, or a count is not a positive integer. A radius in `concentrate` is not on
            the disc. There are fewer elements than intervals between these radii. The thickness is not given at every
            radius.

    >>> print(fx.mesh.disc(radius=40.0, thickness={"core": 1.0, "skin": 0.2}, elements=(30, (2, 1))))
    180 six-node triangles, R from 0 to 40, Z from 0 to 1.2
    layers: core, skin
    boundaries: axis (3 edges), rim (3 edges), bottom (30 edges), top (30 edges)
    """
    radius = positive("disc: radius", radius)
    grading = checked_grading("disc", grading)
    inner_radius = non_negative("disc: inner_radius", inner_radius)
    if inner_radius >= radius:
        raise InputError(f"disc: inner_radius = {inner_radius!r}: must be at least 0 and below radius = {radius!r}")
    sides = ("axis" if inner_radius == 0 else "inner", "rim", "bottom", "top")
    check_name("disc: accuracy", accuracy, ACCURACY)
    layers = layer_thicknesses("disc", thickness, "sheet", "R")
    chosen = elements is None and concentrate is None and grading == 1
    if elements is None:
        elements = _preset(accuracy, inner_radius, radius, layers)
    along, through = divisions("disc", "radius", elements, len(layers))
    sizes = None if concentrate is None else _checked_sizes(concentrate, inner_radius, radius)
    if sizes and grading != 1:
        raise InputError(f"disc: grading = {grading!r} and concentrate = {concentrate!r}: give one of them")
    joints = (_concentrated(inner_radius, radius, along, sizes) if sizes
              else inner_radius + (radius - inner_radius) * graded_ends(along, grading))

    def body(ends: np.ndarray, through: list[np.ndarray]) -> Mesh:
        def points(R: np.ndarray) -> np.ndarray:
            Z = levels(layers, through, R)
            return np.stack([np.broadcast_to(R, Z.shape), Z], axis=-1)
        return _mesh("disc", points, ends, list(sizes or ()), list(layers), through, sides, comm)
    made = body(joints, through)
    return _with_preset(made, accuracy, layers, joints, through, body) if chosen else made


def _preset(accuracy: str, low: float, high: float, layers: Mapping[str, Any]) -> tuple[int, list[int]]:
    """Return the number of elements along the radius of a disc for an accuracy, and the numbers through its layers.

    Layers are {name: function of radii (n,), that returns the thickness (n,), length}, from radius `low` to `high`.
    """
    along, usual = ACCURACY[accuracy]
    R = np.linspace(low, high, along + 1)
    thick = np.array([min(float(thickness_at(R).max()) / (high - low), 1.0) for thickness_at in layers.values()])
    total = thick.sum()
    if total < _FILM_THICKNESS:
        return along, [1] * len(layers)
    bending = _BENDING_ELEMENTS[accuracy] * thick / total if total >= _BENDING_THICKNESS else 0.0
    needed = np.ceil(np.maximum(bending, thick * along / _ASPECT_RATIO) - 1e-9)
    return along, np.maximum(usual, needed).astype(int).tolist()


def _with_preset(mesh: Mesh, accuracy: str, layers: Mapping[str, Callable], coordinates: np.ndarray,
                 through: list[np.ndarray], body: Callable[[np.ndarray, list[np.ndarray]], Mesh]) -> Mesh:
    """Return the mesh with a `Preset`, from which `body` makes the same body with other column and layer ends."""
    thickness = np.array([thickness_at(coordinates).max() for thickness_at in layers.values()])
    return replace(mesh, preset=Preset(accuracy, thickness, tuple(len(ends) - 1 for ends in through), lambda ends, n:
                                       body(ends, [np.linspace(0.0, 1.0, m + 1) for m in n])))


def _checked_sizes(concentrate: Mapping[float, float], low: float, high: float) -> dict[float, float]:
    """Return {radius: relative size} sorted; radii off the disc, or sizes not from 1e-6 to 1: InputError."""
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
    r"""Return the radii at the ends of elements that are small near given radii, shape (along + 1,), length.

    With relative sizes s_i at radii R_i, and D the largest distance of a radius from the nearest R_i, the relative size
    is

    .. math:: s(R) = \min_i \left[s_i + (1 - s_i) \frac{|R - R_i|}{D}\right]

    Each R_i is the end of an element; fewer elements than intervals between the R_i are an InputError.
    """
    radii, small = np.array(list(sizes)), np.array(list(sizes.values()))
    ends = np.unique([low, *radii, high])
    if along < len(ends) - 1:
        raise InputError(f"disc: elements along the radius = {along}: must be at least {len(ends) - 1}, one between"
                         f" each two radii of concentrate = {sizes!r}")
    steps = np.geomspace(1e-9, 1, 4001) * (high - low)      # fine near small elements
    beside = [*np.add.outer(radii, steps).ravel(), *np.subtract.outer(radii, steps).ravel()]
    R = np.unique(np.clip([*ends, *beside], low, high))
    distance = np.abs(np.subtract.outer(R, radii))
    size = (small + (1 - small) * distance / distance.min(1).max()).min(1)
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
    """Return the mesh of the upper half of a hollow sphere about the origin: a quarter of an annulus in (R, Z).

    Boundaries: `axis` (R = 0), `equator` (Z = 0), `inner`, `outer`. All nodes lie on circles, mid-edge nodes too
    (second-order geometry).

    Args:
        inner_radius: inner radius, length.
        thickness: a length (one layer, called `wall`), or {layer name: its thickness} from the inside out.
        elements: (number from the axis to the equator, division of the layers). The division is a number of elements
            through each layer, or a list with an entry for each layer: a number, or relative sizes from the inside out.
        grading: size of the element at the equator over the size of the element at the axis, along the meridian.
        comm: MPI communicator.

    Returns:
        The mesh, of quadratic triangles.

    Raises:
        InputError: a size is not positive, or a count is not a positive integer.

    >>> list(fx.mesh.sphere(inner_radius=1.0, thickness=0.2, elements=(8, 2)).boundaries)
    ['axis', 'equator', 'inner', 'outer']
    """
    inner_radius = positive("sphere: inner_radius", inner_radius)
    layers = layer_thicknesses("sphere", thickness, "wall", "")
    along, through = divisions("sphere", "meridian", elements, len(layers))

    def points(angle: np.ndarray) -> np.ndarray:
        radius = inner_radius + levels(layers, through, angle)
        return np.stack([radius * np.sin(angle), radius * np.sin(np.pi / 2 - angle)], axis=-1)
    ends = np.pi / 2 * graded_ends(along, checked_grading("sphere", grading))
    return _mesh("sphere", points, ends, [], list(layers), through, ("axis", "equator", "inner", "outer"), comm)


def parison(*, inner_radius: float, thickness: Thickness | Mapping[str, Thickness], length: float,
            accuracy: str | None = None, elements: tuple | None = None, grading: float = 1.0,
            comm: MPI.Comm = MPI.COMM_WORLD) -> Mesh:
    """Return the mesh of a tube that is closed by a half sphere at the bottom and open at the top.

    The half sphere has its centre in the origin. Boundaries: `axis` (R = 0), `inner`, `outer`, `neck` (Z = length). All
    nodes of the half sphere lie on circles, mid-edge nodes too (second-order geometry).

    Args:
        inner_radius: inner radius, length.
        thickness: a length (one layer, called `wall`), or {layer name: its thickness} from the inside out. It may vary:
            a function of Z, or a table {Z: thickness}, interpolated linearly. Z is the height on the inner face, from
            -inner_radius to `length`. The thickness is measured along the normal.
        length: length of the tube above the half sphere, length.
        accuracy: "draft", "standard" or "fine": a `Scene` chooses the elements where a tool touches the wall, short
            ones at its fillets. A given `elements` or `grading` is kept.
        elements: (number from the axis to the neck, division of the layers), in place of `accuracy`; default (60, 2).
            The division is a number of elements through each layer, or a list with an entry for each layer: a number,
            or relative sizes from the inside out.
        grading: size of the element at the neck over the element at the axis.
        comm: MPI communicator.

    Returns:
        The mesh, of quadratic triangles.

    Raises:
        InputError: a size is not positive, or a count is not a positive integer. There are fewer than two elements
            along the meridian. The thickness is not given at every height.

    >>> wall = {-10.0: 2.0, 60.0: 3.0}                                         # at heights of the inner face
    >>> tube = fx.mesh.parison(inner_radius=10.0, thickness=wall, length=60.0, elements=(20, 1))
    >>> float(tube.nodes_of("neck")[-1, 0])
    13.0
    """
    inner_radius, length = positive("parison: inner_radius", inner_radius), positive("parison: length", length)
    grading = checked_grading("parison", grading)
    layers = layer_thicknesses("parison", thickness, "wall", "Z")
    if accuracy is not None:
        check_name("parison: accuracy", accuracy, ACCURACY)
    chosen = accuracy is not None and elements is None and grading == 1
    along, through = divisions("parison", "meridian", (60, 2) if elements is None else elements, len(layers))
    if along < 2:
        raise InputError(f"parison: elements along the meridian = {along}: must be at least 2, one in the bottom and"
                         f" one in the tube")
    # elements lie along [0, 1] from the neck; the joint of tube and bottom is a node
    joints = graded_ends(along, 1 / grading)
    wall = float(sum(thickness_at(np.zeros(1))[0] for thickness_at in layers.values()))
    joint = length / (length + np.pi / 2 * (inner_radius + wall / 2))
    node = joints[1 + np.argmin(np.abs(joints[1:-1] - joint))]

    def height_and_angle(from_neck: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return height (length) and angle below the equator (radians) at coordinates (n,), 0 (neck) to 1 (axis).
        """
        return (length * np.maximum(1 - from_neck / node, 0.0),
                np.pi / 2 * np.maximum((from_neck - node) / (1 - node), 0.0))

    def body(ends: np.ndarray, through: list[np.ndarray]) -> Mesh:
        def points(from_neck: np.ndarray) -> np.ndarray:
            z, angle = height_and_angle(from_neck)
            radius = inner_radius + levels(layers, through, z - inner_radius * np.sin(angle))
            return np.stack([radius * np.sin(np.pi / 2 - angle), z - radius * np.sin(angle)], axis=-1)
        return _mesh("parison", points, ends, [node], list(layers), through, ("neck", "axis", "inner", "outer"), comm)
    made = body(joints, through)
    if accuracy is None or not chosen:
        return made
    z, angle = height_and_angle(joints)
    return _with_preset(made, accuracy, layers, z - inner_radius * np.sin(angle), through, body)


def from_lines(inner: Any, outer: Any, *, elements: tuple = (1, 2), layers: Mapping[str, float] | None = None,
               comm: MPI.Comm = MPI.COMM_WORLD) -> Mesh:
    """Return the mesh of a body between two polylines, whose points are opposite each other.

    Boundaries: `inner`, `outer`, and `start` and `end`, which join the first or the last points. `start` or `end` is
    called `axis` if both points have R = 0.

    Args:
        inner: corners (R, Z) of the inner face, shape (n, 2), n > 1, length.
        outer: corners (R, Z) of the outer face, shape (n, 2), length.
        elements: (number between successive corners, division of the layers). The first entry may be a list of n - 1
            numbers, one for each interval. The division is a number of elements through each layer, or a list with an
            entry for each layer: a number, or relative sizes from `inner` to `outer`.
        layers: {layer name: thickness of the layer relative to the other layers} from `inner` to `outer`; default one
            layer, `wall`.
        comm: MPI communicator.

    Returns:
        The mesh, of quadratic triangles.

    Raises:
        InputError: points are not finite, are fewer than 2, or differ in number between the lines. The lines cross or
            meet. A count is not a positive integer.

    >>> cone = fx.mesh.from_lines([(0, 0), (20, 0), (30, 40)], [(0, -2), (21, -2), (32, 40)], elements=([8, 16], 2))
    >>> print(cone)
    96 six-node triangles, R from 0 to 32, Z from -2 to 40
    layers: wall
    boundaries: end (2 edges), axis (2 edges), inner (24 edges), outer (24 edges)
    """
    lines = [_checked_points(f"from_lines: {name}", points) for name, points in (("inner", inner), ("outer", outer))]
    if len(lines[0]) != len(lines[1]):
        raise InputError(f"from_lines: inner has {len(lines[0])} points, outer {len(lines[1])}: they must be as many")
    parts = layer_thicknesses("from_lines", {"wall": 1.0} if layers is None else layers, "wall", "")
    if not is_sequence(elements) or len(elements) != 2:
        raise InputError(f"from_lines: elements = {elements!r}: must be (between two points, through each layer)")
    pieces, given = len(lines[0]) - 1, elements[0]
    along = [count("from_lines: elements between two points", n)
             for n in (given if is_sequence(given) else [given] * pieces)]
    if len(along) != pieces:
        raise InputError(f"from_lines: elements between points = {given!r}: {pieces} pieces need as many counts")
    _, through = divisions("from_lines", "lines", (sum(along), elements[1]), len(parts))
    ends = np.concatenate([[0.0], *(k + np.arange(1, n + 1) / n for k, n in enumerate(along))])
    level = levels(parts, through, np.zeros(1))
    outline = np.concatenate([lines[0], lines[1][::-1]])
    names = ["axis" if all(line[k, 0] == 0 for line in lines) else name for k, name in ((0, "start"), (-1, "end"))]
    if names[0] == names[1]:
        names = ["start", "end"]
    if np.sum(outline[:, 0] * np.roll(outline[:, 1], -1) - np.roll(outline[:, 0], -1) * outline[:, 1]) < 0:
        # reverse the lines, so that the body lies to the left of `inner`
        lines, names, ends = [line[::-1] for line in lines], names[::-1], pieces - ends[::-1]

    def between(coordinate: np.ndarray) -> np.ndarray:
        first, second = (np.stack([np.interp(coordinate, np.arange(pieces + 1), line[:, i]) for i in (0, 1)], axis=-1)
                         for line in lines)
        return first + (level / level[-1])[:, :, None] * (second - first)
    return _mesh("from_lines", between, ends, np.arange(1, pieces), list(parts), through, (*names, "inner", "outer"),
                 comm)


def _checked_points(name: str, points: Any) -> np.ndarray:
    """Return at least two finite points (R, Z) as an array, (n, 2), length; otherwise an InputError by name."""
    found = np.array(as_points(name, points))
    if len(found) < 2 or not np.all(np.isfinite(found)):
        raise InputError(f"{name} = {points!r}: must be at least two points (R, Z) of finite numbers")
    return found


def _mesh(kind: str, place: Callable[[np.ndarray], np.ndarray], ends: np.ndarray, fixed: Any, layers: list[str],
          through: list[np.ndarray], sides: tuple, comm: MPI.Comm) -> Mesh:
    """Return the mesh of quadratic triangles on rows and columns of nodes, with diagonals as on a chessboard.

    `place` maps coordinates (k,) to nodes of all rows, (rows, k, 2), length; `ends` of columns (n + 1,) and `fixed`
    ones (m,) are coordinates. `sides` name first column, last column, first row, last row.
    """
    points = place(with_middles(ends))
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
