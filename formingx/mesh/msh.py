"""gmsh mesh files, MSH 2.2 and 4.1, text and binary, read as data.

gmsh itself treats a file as a script unless it begins as a mesh, and scripts can run commands. This reader accepts only
numbers and names. Nothing in a file is executed.
"""

import os
import re
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from ..errors import InputError
from ..io.output import replace
from .grid import Grid, counter_clockwise
from .msh_section import Section, checked_count, checked_dimension

_KINDS = {1: (1, 2), 2: (2, 3), 3: (2, 4), 4: (3, 4), 5: (3, 8), 6: (3, 6), 7: (3, 5), 8: (1, 3), 9: (2, 6),
          10: (2, 9), 11: (3, 10), 12: (3, 27), 13: (3, 18), 14: (3, 14), 15: (0, 1), 16: (2, 8), 17: (3, 20),
          18: (3, 15), 19: (3, 13), 20: (2, 9), 21: (2, 10), 22: (2, 12), 23: (2, 15), 24: (2, 15), 25: (2, 21),
          26: (1, 4), 27: (1, 5), 28: (1, 6), 29: (3, 20), 36: (2, 16), 37: (2, 25)}
"""gmsh's number of an element type: (dimension, nodes)."""
_ONCE = ("MeshFormat", "PhysicalNames", "Entities", "PartitionedEntities", "Nodes", "Elements")
_LINES, _TRIANGLES = {1: 2, 8: 3}, {2: 3, 9: 6}


class Block(NamedTuple):
    """Elements of one type on one geometric entity of a gmsh file.

    Attributes:
        dim: dimension of the entity.
        entity: number of the entity.
        kind: element type, a number of gmsh.
        groups: numbers of the physical groups that contain the entity.
        nodes: node numbers, shape (n, nodes per element).
    """

    dim: int
    entity: int
    kind: int
    groups: tuple[int, ...]
    nodes: np.ndarray


class Content(NamedTuple):
    """Content of a mesh file.

    Attributes:
        numbers: node numbers, shape (n,).
        points: coordinates (x, y, z) of the nodes, shape (n, 3), length.
        blocks: elements, by type and entity.
        names: {(dimension, number of a physical group): name}.
    """

    numbers: np.ndarray
    points: np.ndarray
    blocks: list[Block]
    names: dict[tuple[int, int], str]


def content(file: str | os.PathLike) -> Content:
    """Return nodes, elements and names of MSH 2.2 or 4.1, text or binary; InputError: unreadable section."""
    file = os.fspath(file)
    try:
        with open(file, "rb") as stream:
            data = stream.read()
    except OSError as error:
        raise InputError(f"mesh file {file!r} cannot be read: {error}") from None
    if not data.lstrip().startswith(b"$MeshFormat"):
        raise InputError(f"mesh file {file!r} cannot be read: it does not begin with $MeshFormat, so it is no gmsh mesh"
                         f" (only a mesh is read, no script: a .geo file is meshed in gmsh first)")
    sections: dict[str, bytes] = {}
    for name, body in _sections(data, file):
        if name in sections and name in _ONCE:
            raise InputError(f"mesh file {file!r}: a second section ${name}")
        sections[name] = body
    version, binary, order, width = _format(sections["MeshFormat"], file)
    names = _names(sections.get("PhysicalNames", b""), file)
    for name in ("Nodes", "Elements"):
        if name not in sections:
            raise InputError(f"mesh file {file!r} has no section ${name}: was it meshed?")

    def numbers(name: str) -> Section:
        return Section(sections[name], binary, order, width, f"mesh file {file!r}, section ${name}")
    if version == "2.2":
        tags, points = _nodes_2(numbers("Nodes"))
        blocks = _elements_2(numbers("Elements"))
    else:
        groups = _groups(numbers("Entities")) if "Entities" in sections else {}
        if "PartitionedEntities" in sections:
            groups |= _groups(numbers("PartitionedEntities"), groups)
        tags, points = _nodes_4(numbers("Nodes"))
        blocks = _elements_4(numbers("Elements"), groups)
    if len(np.unique(tags)) < len(tags):
        raise InputError(f"mesh file {file!r}: a node number stands twice")
    return Content(tags, points, blocks, names)


def read(file: str | os.PathLike) -> Grid:
    """Return the grid in a gmsh file; physical groups name the layers (dimension 2) and the boundaries (dimension 1).

    Damage, no group of dimension 2, elements other than triangles or out of the plane are an InputError.
    """
    file = os.fspath(file)
    found = content(file)
    if not any(b.dim > 0 for b in found.blocks):
        raise InputError(f"mesh file {file!r} has no elements: was it meshed?")
    if any(b.dim == 3 for b in found.blocks):
        raise InputError(f"mesh file {file!r} is three-dimensional: it must be a section, x for R and y for Z")
    if not any(b.dim == 2 and b.groups for b in found.blocks):
        raise InputError(f"mesh file {file!r} has no physical group of dimension 2: name its layers")
    sort = np.argsort(found.numbers)
    points = found.points[sort]
    layers = _parts(found, 2, _TRIANGLES, found.numbers[sort], file)
    boundaries = _parts(found, 1, _LINES, found.numbers[sort], file)
    size = np.ptp(points[:, :2], axis=0).max(initial=0.0)
    body = points[np.concatenate([rows.ravel() for rows in layers.values()])]
    in_space = np.ptp(body[:, 2]) > 1e-9 * size
    if in_space and any(rows.shape[1] > 3 for rows in layers.values()):
        raise InputError(f"mesh file {file!r} is not a plane section: z goes from {body[:, 2].min():.6g} to"
                         f" {body[:, 2].max():.6g}; x must be R, y Z, and z the same everywhere; a surface in three"
                         f" dimensions must have triangles of three nodes")
    used = np.unique(np.concatenate([found.numbers[sort][rows].ravel() for rows in layers.values()]))
    for block in found.blocks:
        if block.dim == 2 and not block.groups and np.isin(block.nodes, used).any():
            raise InputError(f"mesh file {file!r}: {len(block.nodes)} elements of surface {block.entity} are of no"
                             f" physical group, and part of the body: name their layer, or leave them out")
    if not in_space:
        layers = {name: counter_clockwise(points[:, :2], rows) for name, rows in layers.items()}
    orders = {rows.shape[1] for rows in layers.values()}
    if len(orders) > 1:
        raise InputError(f"mesh file {file!r} has triangles of three and of six nodes: all must have the same number")
    return Grid(points if in_space else points[:, :2].copy(), found.numbers[sort], layers, boundaries)


def write(grid: Grid, file: str | os.PathLike) -> None:
    """Write a grid as a gmsh file (MSH 2.2, text). Layers, then boundaries are physical groups 1, 2, and so on."""
    parts = [(2, name, rows) for name, rows in grid.layers.items()]
    parts += [(1, name, rows) for name, rows in grid.boundaries.items()]
    named = [f'{dim} {tag} "{name}"' for tag, (dim, name, _) in enumerate(parts, 1)]
    kinds = {(2, 6): 9, (2, 3): 2, (1, 3): 8, (1, 2): 1}
    elements = [f"{kinds[dim, rows.shape[1]]} 2 {tag} {tag} {' '.join(map(str, row))}"
                for tag, (dim, _, rows) in sorted(enumerate(parts, 1), key=lambda part: part[1][0])
                for row in grid.numbers[rows].tolist()]
    nodes = [" ".join([str(n), *(repr(float(v)) for v in x), "0"][:4])
             for n, x in zip(grid.numbers.tolist(), grid.points, strict=True)]
    lines = ["$MeshFormat", "2.2 0 8", "$EndMeshFormat",
             "$PhysicalNames", str(len(named)), *sorted(named, key=lambda line: line[0]), "$EndPhysicalNames",
             "$Nodes", str(len(nodes)), *nodes, "$EndNodes",
             "$Elements", str(len(elements)), *(f"{k} {row}" for k, row in enumerate(elements, 1)), "$EndElements"]
    replace(file, lambda stream: stream.write("\n".join(lines) + "\n"))


def _parts(found: Content, dim: int, kinds: dict[int, int], numbers: np.ndarray, file: str) -> dict[str, np.ndarray]:
    """Return {group: elements of its dimension, (m, nodes), indices into `numbers`}; others are an InputError."""
    parts: dict[str, list[np.ndarray]] = {}
    what = "triangles" if dim == 2 else "edges"
    tags = {group for b in found.blocks if b.dim == dim for group in b.groups}
    called = {tag: found.names.get((dim, tag), str(tag)) for tag in sorted(tags)}
    if len(set(called.values())) < len(called):
        raise InputError(f"mesh file {file!r}: two physical groups of dimension {dim} have the same name:"
                         f" {', '.join(map(repr, called.values()))}")
    for tag, name in called.items():
        rows = parts.setdefault(name, [])
        for block in (b for b in found.blocks if b.dim == dim and tag in b.groups):
            if block.kind not in kinds:
                raise InputError(f"mesh file {file!r}: group {name!r} has elements of {block.nodes.shape[1]} nodes"
                                 f" (gmsh's type {block.kind}): formingx needs {what} of"
                                 f" {' or '.join(map(str, kinds.values()))} nodes")
            indices = np.minimum(np.searchsorted(numbers, block.nodes), max(len(numbers) - 1, 0))
            if not len(numbers) or np.any(numbers[indices] != block.nodes):
                raise InputError(f"mesh file {file!r}: an element of group {name!r} has a node that is not in $Nodes")
            rows.append(indices)
        if len({r.shape[1] for r in rows}) > 1:
            raise InputError(f"mesh file {file!r}: group {name!r} mixes {what} of"
                             f" {' and '.join(map(str, kinds.values()))} nodes: all must have the same number")
    return {name: np.concatenate(rows) for name, rows in parts.items()}


def _sections(data: bytes, file: str) -> Iterator[tuple[str, bytes]]:
    """Yield names and contents of a file's sections; one without end, or content outside, is an InputError."""
    begin, offset = re.compile(rb"\s*\$(\w{1,40})[ \t]*\r?\n"), 0
    while match := begin.match(data, offset):
        end = data.find(b"$End" + match[1], match.end())
        if end < 0:
            raise InputError(f"mesh file {file!r} ends within its section ${match[1].decode()}")
        yield match[1].decode(), data[match.end():end]
        offset = end + len(match[1]) + 4
    remainder = data[offset:].strip()
    if remainder:
        raise InputError(f"mesh file {file!r}: {remainder[:40].decode('utf-8', 'replace')!r} is no section of a mesh")


def _format(body: bytes, file: str) -> tuple[str, bool, str, int]:
    """Return (version, True if binary, "<" or ">", bytes of a count) from $MeshFormat; others are an InputError."""
    words = body.split(b"\n")[0].decode("ascii", "replace").split()
    if len(words) != 3 or words[0] not in ("2.2", "4.1") or words[1] not in ("0", "1") or words[2] not in ("4", "8"):
        raise InputError(f"mesh file {file!r}: format {' '.join(words)[:40]!r}: must be MSH 2.2 or 4.1 (gmsh:"
                         f" Mesh.MshFileVersion)")
    order = "<"
    if words[1] == "1":
        number_one = body.partition(b"\n")[2][:4]
        order = {b"\1\0\0\0": "<", b"\0\0\0\1": ">"}.get(number_one, "")
        if not order:
            raise InputError(f"mesh file {file!r}: a binary mesh must hold the number one after its format")
    return words[0], words[1] == "1", order, int(words[2])


def _names(body: bytes, file: str) -> dict[tuple[int, int], str]:
    """Return {(dimension, group): name} from $PhysicalNames; another form or a second name is an InputError."""
    lines = [line for line in body.decode("utf-8", "replace").splitlines() if line.strip()]
    names: dict[tuple[int, int], str] = {}
    if lines and lines[0].strip() != str(len(lines) - 1):
        raise InputError(f"mesh file {file!r}, section $PhysicalNames: {len(lines) - 1} names follow the count"
                         f" {lines[0].strip()[:20]!r}")
    for line in lines[1:]:
        match = re.fullmatch(r'\s*([0-3])\s+(\d{1,9})\s+"([^"]*)"\s*', line)
        if not match:
            raise InputError(f'mesh file {file!r}, section $PhysicalNames: {line[:60]!r}: must be DIMENSION NUMBER'
                             f' "NAME"')
        if (group := (int(match[1]), int(match[2]))) in names:
            raise InputError(f"mesh file {file!r}, section $PhysicalNames: a second name for group {group[1]}")
        names[group] = match[3]
    return names


def _nodes_2(section: Section) -> tuple[np.ndarray, np.ndarray]:
    """Return node numbers, shape (n,), and points, shape (n, 3), from the section $Nodes of an MSH 2.2 file."""
    if section.binary:
        rows = section.records(section.line(), [("number", "i4", ()), ("x", "f8", (3,))])
        section.end()
        return rows["number"].astype(np.int64), rows["x"].astype(float)
    n = checked_count(section.ints(1), section)
    rows = section.reals(4 * n).reshape(n, 4)
    section.end()
    return section.whole(rows[:, 0]), rows[:, 1:].copy()


def _elements_2(section: Section) -> list[Block]:
    """Return a block for each (type, group, entity) of MSH 2.2's $Elements; an unknown type is an InputError."""
    found: dict[tuple[int, int, int], list] = {}
    n, done = section.line() if section.binary else checked_count(section.ints(1), section), 0
    while done < n:
        # binary: type, number of such elements, number of tags, then elements; text: number, type, number of tags
        head = section.int_list(3)
        kind, number, tags = head if section.binary else (head[1], 1, head[2])
        if kind not in _KINDS or number < 1 or not 2 <= tags <= 1000:
            raise InputError(f"{section.where}: element {done + 1}: type {kind} with {tags} tags is not known")
        width = section.binary + tags + _KINDS[kind][1]
        rows = section.ints(number * width).reshape(number, width)[:, int(section.binary):]
        for row in rows:
            found.setdefault((kind, int(row[0]), int(row[1])), []).append(row[tags:])
        done += number
    section.end()
    return [Block(_KINDS[kind][0], entity, kind, (abs(group),) if group else (), np.array(rows))
            for (kind, group, entity), rows in found.items()]


def _groups(section: Section, whole: dict | None = None) -> dict[tuple[int, int], tuple[int, ...]]:
    """Return {(dimension, entity): numbers of its physical groups} from a section of an MSH 4.1 file.

    A part of an entity, in $PartitionedEntities, is in the groups of the `whole`, the result of $Entities.
    """
    found = {}
    if whole is not None:
        section.sizes(1)                                    # number of partitions
        section.ints(2 * checked_count(section.sizes(1), section))         # ghost entities
    counts = section.sizes(4)
    for dim in range(4):
        for _ in range(checked_count(counts[dim:], section)):
            tag, = section.int_list(1)
            if whole is not None:
                parent = tuple(section.int_list(2))
                section.ints(checked_count(section.sizes(1), section))     # partitions
            section.reals(3 if dim == 0 else 6)
            groups = section.int_list(checked_count(section.sizes(1), section))
            if dim:
                section.ints(checked_count(section.sizes(1), section))
            if whole is not None:
                groups += whole.get(parent, ()) if parent[0] == dim else ()
            found[dim, tag] = tuple(dict.fromkeys(map(abs, groups)))
    section.end()
    return found


def _nodes_4(section: Section) -> tuple[np.ndarray, np.ndarray]:
    """Return node numbers, shape (n,), and points, shape (n, 3), from the section $Nodes of an MSH 4.1 file."""
    numbers: list[np.ndarray] = [np.zeros(0, dtype=np.int64)]
    points: list[np.ndarray] = [np.zeros((0, 3))]
    blocks, total, *_ = section.sizes(4)
    for _ in range(checked_count([blocks], section)):
        dim, _, parametric = section.int_list(3)
        n = checked_count(section.sizes(1), section)
        numbers.append(section.sizes(n))
        width = 3 + (checked_dimension(dim, section) if parametric else 0)
        points.append(section.reals(width * n).reshape(n, width)[:, :3])
    _check_total(section, "nodes", total, numbers)
    return np.concatenate(numbers), np.concatenate(points)


def _check_total(section: Section, what: str, total: int, parts: list[np.ndarray]) -> None:
    """Raise an InputError unless a section ends, and its parts have the stated total."""
    section.end()
    if (found := sum(map(len, parts))) != total:
        raise InputError(f"{section.where}: {found} {what}, but its first line says {total}")


def _elements_4(section: Section, groups: dict[tuple[int, int], tuple[int, ...]]) -> list[Block]:
    """Return blocks of MSH 4.1's $Elements in {(dimension, entity): groups}; an unknown type is an InputError."""
    blocks = []
    number, total, *_ = section.sizes(4)
    for _ in range(checked_count([number], section)):
        dim, entity, kind = section.int_list(3)
        n = checked_count(section.sizes(1), section)
        if kind not in _KINDS or _KINDS[kind][0] != dim:
            raise InputError(f"{section.where}: elements of type {kind} and dimension {dim} are not known")
        width = 1 + _KINDS[kind][1]
        rows = section.sizes(n * width).reshape(n, width)[:, 1:]
        blocks.append(Block(dim, entity, kind, groups.get((dim, entity), ()), rows))
    _check_total(section, "elements", total, [block.nodes for block in blocks])
    return blocks
