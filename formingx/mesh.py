"""Meshes of six-node triangles with named layers (cells) and named boundaries (facets)."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from mpi4py import MPI

from . import _compat, grid
from .errors import InputError, count, finite, known, non_negative, pair, positive


@dataclass(frozen=True)
class Mesh:
    """A distributed mesh and the names of its parts.

    Attributes:
        domain: the `dolfinx.mesh.Mesh`; coordinates (R, Z) in the user's unit of length.
        cells, facets: its `MeshTags`.
        layers: name to tag.
        boundaries: name to the tags of its facets: one, or several where a part has a name of its own (`with_part`).
        comm: the communicator that it was made on. (What mpi4py hangs on `domain.comm`, a copy, when objects are
            passed there is freed with it; inside an exception that would lock up Python's end.)
    """

    domain: Any
    cells: Any
    facets: Any
    layers: dict[str, int]
    boundaries: dict[str, tuple[int, ...]]
    comm: MPI.Comm

    def facets_of(self, boundary: str) -> np.ndarray:
        """Local facet indices of a boundary, sorted, shape (n,), ghosts included."""
        return np.sort(np.concatenate([self.facets.find(tag) for tag in self.boundaries[boundary]]))

    def with_part(self, name: str, of: str, within: tuple[float, float], along: str = "r") -> Mesh:
        """The mesh with one more boundary: the facets of a boundary between two coordinates.

        They belong to both boundaries from then on: a load or contact on the whole acts on the part too.

        Args:
            name: of the part, a new one.
            of: the boundary that it is a part of.
            within: (lowest, highest) reference coordinate, length; nodes must lie there (`disc`: `concentrate`), unless
                the boundary ends before.
            along: the coordinate, "r" or "z".

        Raises:
            InputError: a name that is not known or not new, no facet within, or one that is within in part only.
        """
        from dolfinx.mesh import entities_to_geometry, meshtags
        who = f"with_part({name!r}, {of!r})"
        if not isinstance(name, str) or not name or name in self.boundaries:
            raise InputError(f"{who}: name = {name!r}: must be a word that no boundary has yet; there are"
                             f" {', '.join(map(repr, self.boundaries))}")
        known(f"{who}: boundary", of, self.boundaries)
        known(f"{who}: along", along, ("r", "z"))
        low, high = pair(f"{who}: within", within)
        if not low < high:
            raise InputError(f"{who}: within = {within!r}: the first must be below the second")
        domain, axis = self.domain, "rz".index(along)
        comm, facets = self.comm, self.facets_of(of)
        domain.topology.create_connectivity(1, 2)
        nodes = entities_to_geometry(domain, 1, facets) if len(facets) else np.zeros((0, 2), dtype=np.int32)
        ends = domain.geometry.x[nodes[:, :2], axis]
        near = 1e-8 * comm.allreduce(np.abs(domain.geometry.x).max(initial=0.0), MPI.MAX)
        lowest, highest = ends.min(1), ends.max(1)
        inside = (lowest > low - near) & (highest < high + near)
        cut = ~inside & (lowest < high - near) & (highest > low + near)
        cuts = np.concatenate(comm.allgather(np.column_stack([lowest, highest])[cut]))
        if len(cuts):
            raise InputError(f"{who}: within = {within!r} cuts the element edge from {along} = {cuts[0, 0]:.6g} to"
                             f" {cuts[0, 1]:.6g}: both must be {along} of nodes; a disc has nodes where it is told to"
                             f" concentrate")
        if not comm.allreduce(int(inside.sum()), MPI.SUM):
            raise InputError(f"{who}: within = {within!r}: {of!r} has nothing there; its {along} is from"
                             f" {comm.allreduce(lowest.min(initial=np.inf), MPI.MIN):.6g} to"
                             f" {comm.allreduce(highest.max(initial=-np.inf), MPI.MAX):.6g}")
        # a facet has one tag: those of the part get new ones, which belong to all that the old ones belonged to
        first, old = 1 + max(tag for tags in self.boundaries.values() for tag in tags), self.boundaries[of]
        values, places = self.facets.values.copy(), np.searchsorted(self.facets.indices, facets[inside])
        values[places] = first + np.searchsorted(old, values[places])
        new = {tag: first + k for k, tag in enumerate(old)}
        boundaries = {key: (*tags, *(new[tag] for tag in tags if tag in new)) for key, tags in self.boundaries.items()}
        return replace(self, facets=meshtags(domain, 1, self.facets.indices, values),
                       boundaries=boundaries | {name: tuple(new.values())})

    def nodes_of(self, boundary: str) -> np.ndarray:
        """Coordinates of all geometry nodes of a boundary, sorted by R, then Z, shape (n, 2); same on all ranks."""
        from dolfinx.mesh import entities_to_geometry
        domain = self.domain
        facets = self.facets_of(boundary)
        domain.topology.create_connectivity(1, 2)
        nodes = np.unique(entities_to_geometry(domain, 1, facets)) if len(facets) else []
        local = domain.geometry.x[nodes, :2].reshape(-1, 2)
        points = np.concatenate(self.comm.allgather(local))
        scale = np.ptp(points, axis=0).max() if len(points) else 1.0
        keys = np.round(points / (scale or 1.0), 12)
        _, first = np.unique(keys, axis=0, return_index=True)
        points = points[first]
        return points[np.lexsort((points[:, 1], points[:, 0]))]

    def line_of(self, boundary: str) -> np.ndarray:
        """Ends and middles of the edges of a boundary one after the other, from its end of smaller R (of smaller Z).

        Shape (2 n + 1, 2) for n edges, the ends at even rows; same on all ranks.

        Raises:
            InputError: the boundary is not one line with two ends.
        """
        from dolfinx.mesh import entities_to_geometry
        domain = self.domain
        domain.topology.create_connectivity(1, 2)
        domain.topology.create_connectivity(2, 1)
        mid_edge = _compat.coordinate_map(domain).degree == 2
        # of an edge: its two ends and, on second-order geometry, its middle
        nodes = entities_to_geometry(domain, 1, self.facets_of(boundary)).reshape(-1, 3 if mid_edge else 2)
        edges = np.concatenate(self.comm.allgather(domain.geometry.x[nodes][..., :2]))
        corners, ends = np.unique(np.round(edges[:, :2].reshape(-1, 2) / max(np.ptp(edges, axis=(0, 1)).max(), 1e-300),
                                           12), axis=0, return_inverse=True)
        ends = ends.reshape(-1, 2)
        _, first = np.unique(np.sort(ends, axis=1), axis=0, return_index=True)       # a ghost is there twice
        at: dict[int, list[int]] = {}
        for edge in first.tolist():
            for corner in ends[edge].tolist():
                at.setdefault(corner, []).append(edge)
        tips = sorted(corner for corner, there in at.items() if len(there) == 1)     # corners are sorted by R, then Z
        if len(tips) != 2 or max(map(len, at.values())) > 2:
            raise InputError(f"boundary {boundary!r} must be one line with two ends; {len(tips)} ends were found")
        corner, line, here = tips[0], [], -1
        for _ in first:
            here = next(e for e in at[corner] if e != here)
            forward = ends[here, 0] == corner
            a, b = edges[here, [0, 1] if forward else [1, 0]]
            line += [a, edges[here, 2] if mid_edge else (a + b) / 2]
            corner = ends[here, 1 if forward else 0]
        if len(line) != 2 * len(first) or corner != tips[1]:
            raise InputError(f"boundary {boundary!r} must be one line with two ends, but is in several parts")
        return np.array([*line, b])


ACCURACY = {"draft": (20, 1), "standard": (40, 2), "fine": (80, 4)}
"""Elements (along the radius, through each layer) of a disc: see the README for the error that each promises."""


def disc(*, radius: float, thickness: float | Mapping[str, float], accuracy: str = "standard",
         elements: tuple | None = None, grading: float = 1.0, concentrate: Mapping[float, float] | None = None,
         inner_radius: float = 0.0, comm: MPI.Comm = MPI.COMM_WORLD) -> Mesh:
    """A flat disc (or ring) in the (R, Z) plane, bottom face on Z = 0.

    Boundaries: `axis` (R = inner_radius; called `inner` if that is above 0), `rim`, `bottom`, `top`.

    Args:
        radius, inner_radius: lengths.
        thickness: a length (one layer, called `sheet`), or {layer name: its thickness} from bottom to top.
        accuracy: "draft", "standard" or "fine": how many elements.
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
    elements = ACCURACY[accuracy] if elements is None else elements
    sizes = None if concentrate is None else _sizes(concentrate, inner_radius, radius)
    if sizes and grading != 1:
        raise InputError(f"disc: grading = {grading!r} and concentrate = {concentrate!r}: give one of them")
    mesh = _layered("disc", (inner_radius, radius), 0.0, thickness, elements, grading, sides, comm)
    if sizes:
        x, along = mesh.domain.geometry.x, int(elements[0])
        half = np.rint(2 * along * (x[:, 0] - inner_radius) / (radius - inner_radius))      # gmsh has some 12 digits
        x[:, 0] = np.interp(half / 2, np.arange(along + 1), _concentrated(inner_radius, radius, along, sizes))
    return mesh


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
    layers = dict(thickness) if isinstance(thickness, Mapping) else {layer: thickness}
    if not layers:
        raise InputError(f"{kind}: thickness = {{}}: must name at least one layer")
    heights = [positive(f"{kind}: thickness of {name!r}", h) for name, h in layers.items()]
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
        levels = np.concatenate([[bottom], bottom + np.cumsum(heights)])
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

    return _from_gmsh(build, comm)


_ALONG = {"disc": "radius", "sphere": "meridian", "parison": "meridian"}


def read(file: str | os.PathLike, comm: MPI.Comm = MPI.COMM_WORLD) -> Mesh:
    """A mesh of triangles from a file.

    A gmsh file: physical groups name the layers (2-D) and the boundaries (1-D). A name that ends in .txt: the text
    format of `formingx.grid`.

    Raises:
        InputError: the file is not there, cannot be read, or has no named 2-D group.
    """
    if not isinstance(file, str | os.PathLike):
        raise InputError(f"mesh.read: file = {file!r}: must be the name of a file")
    file = os.fspath(file)

    def build(model):
        import gmsh
        if not os.path.isfile(file):
            raise InputError(f"mesh file {file!r} is not there")
        if _is_text(file):
            _fill(model, grid.read(file))
            return
        try:
            gmsh.merge(file)
        except Exception as error:
            raise InputError(f"mesh file {file!r} cannot be read: {error}") from None
        if not model.getPhysicalGroups(2):
            raise InputError(f"mesh file {file!r} has no physical group of dimension 2: name its layers")

    return _from_gmsh(build, comm)


def write(mesh: Mesh, file: str | os.PathLike, shift: tuple[float, float] = (0.0, 0.0),
          numbering: str = "corners") -> None:
    """Write a mesh with its names as a file for `read` and for other solvers.

    A name that ends in .txt: the text format of `formingx.grid`, with its `numbering` ("corners" or "around"). Else a
    gmsh file (MSH 2.2, text). Serial only. Nodes are numbered as in the mesh; `shift` is added to their coordinates.

    Raises:
        InputError: an unknown numbering, more than one rank, or a boundary that is a part of another (`with_part`).
    """
    for name, tags in mesh.boundaries.items():
        if len(tags) > 1:
            raise InputError(f"mesh.write: boundary {name!r} has a part with a name of its own, which files cannot"
                             f" hold: write the mesh without it, and call with_part on what is read")
    plain = to_grid(mesh)
    plain = plain._replace(points=plain.points + np.array(shift))
    if _is_text(file):
        grid.write(plain, file, numbering)
        return
    if numbering != "corners":
        raise InputError(f"mesh.write: numbering = {numbering!r}: gmsh files have their own, 'corners'; the text format"
                         f" (.txt) has a choice")
    import gmsh
    with _gmsh_model(mesh.comm) as model:
        _fill(model, plain, mesh.layers | {name: tags[0] for name, tags in mesh.boundaries.items()})
        gmsh.option.setNumber("Mesh.MshFileVersion", 2.2)
        gmsh.write(os.fspath(file))


def to_grid(mesh: Mesh) -> grid.Grid:
    """The mesh as plain arrays (serial only); node i of the mesh has the number i + 1."""
    from dolfinx.mesh import entities_to_geometry
    domain = mesh.domain
    if mesh.comm.size > 1:
        raise InputError("the nodes of a mesh are numbered and written on one rank only: run this on one")
    domain.topology.create_connectivity(1, 2)
    points = domain.geometry.x[:, :2].copy()
    triangles = np.asarray(_compat.cell_nodes(domain))
    # DOLFINx numbers a mid-edge node like the opposite corner; here edges are 01, 12, 20
    triangles = grid.counter_clockwise(points, triangles[:, [0, 1, 2, 5, 3, 4][: triangles.shape[1]]])
    corners = ((0, 1, 3), (1, 2, 4), (2, 0, 5))
    edges = {frozenset(row[[i, j]].tolist()): row[[n for n in (i, j, k) if n < len(row)]]
             for row in triangles for i, j, k in corners}
    layers = {name: triangles[mesh.cells.find(tag)] for name, tag in mesh.layers.items()}
    boundaries = {}
    for name in mesh.boundaries:
        ends = entities_to_geometry(domain, 1, mesh.facets_of(name))[:, :2]
        rows = [edges[frozenset(pair)] for pair in ends.tolist()]
        boundaries[name] = np.array(rows, dtype=np.int64).reshape(len(rows), triangles.shape[1] // 2)
    return grid.Grid(points, np.arange(1, len(points) + 1), layers, boundaries)


def _is_text(file: str | os.PathLike) -> bool:
    return os.fspath(file).lower().endswith(".txt")


def _fill(model: Any, plain: grid.Grid, tags: Mapping[str, int] | None = None) -> None:
    """Put a grid into an empty gmsh model; `tags` of the named parts (default: counted)."""
    names = [(2, name, rows) for name, rows in plain.layers.items()]
    names += [(1, name, rows) for name, rows in plain.boundaries.items()]
    # gmsh's readers want 1, 2, 3, ... and no node that belongs to nothing
    used = np.unique(np.concatenate([rows.ravel() for rows in plain.layers.values()]))
    number = np.zeros(len(plain.points), dtype=np.int64)
    number[used] = np.arange(1, len(used) + 1)
    nodes = np.column_stack([plain.points[used], np.zeros(len(used))])
    kinds = {(2, 6): 9, (2, 3): 2, (1, 3): 8, (1, 2): 1}
    model.addDiscreteEntity(2, 1)
    model.mesh.addNodes(2, 1, np.arange(1, len(used) + 1), nodes.ravel())
    for k, (dim, name, rows) in enumerate(names, 1):
        tag = tags[name] if tags else k
        entity = model.addDiscreteEntity(dim, tag + 100)
        if len(rows):
            model.mesh.addElementsByType(entity, kinds[dim, rows.shape[1]], [], number[rows].ravel())
        model.addPhysicalGroup(dim, [entity], tag, name)


def _from_gmsh(build: Any, comm: MPI.Comm) -> Mesh:
    """Run `build(model)` on rank 0 and distribute the model; an InputError there is raised on all ranks."""
    with _gmsh_model(comm) as model:
        error, names = None, None
        if comm.rank == 0:
            try:
                build(model)
                names = [{model.getPhysicalName(d, t) or str(t): t for d, t in model.getPhysicalGroups(d)}
                         for d in (2, 1)]
            except InputError as e:
                error = e
        error, names = comm.bcast((error, names), root=0)
        if error is not None:
            raise error
        domain, cells, facets = _compat.gmsh_to_mesh(model, comm)
    if domain.topology.cell_name() != "triangle":
        raise InputError(f"the mesh is made of {domain.topology.cell_name()}s: formingx needs triangles")
    layers, boundaries = names
    return Mesh(domain, cells, facets, layers, {name: (tag,) for name, tag in boundaries.items()}, comm)


@contextlib.contextmanager
def _gmsh_model(comm: MPI.Comm) -> Iterator[Any]:
    import gmsh
    if comm.rank != 0:
        yield None
        return
    ours = not gmsh.isInitialized()
    if ours:
        gmsh.initialize(interruptible=False)
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.model.add("formingx")
    try:
        yield gmsh.model
    finally:
        gmsh.model.remove()
        if ours:
            gmsh.finalize()
