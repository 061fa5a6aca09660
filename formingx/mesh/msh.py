"""gmsh's mesh files, MSH 2.2 and 4.1, text and binary, read as data.

gmsh itself takes a file for a script unless it begins as a mesh, and scripts can run commands. Here a file is numbers
and names or it is refused: nothing in it can run.
"""

import os
import re
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from ..errors import InputError
from ..io.output import replace
from .grid import Grid, counter_clockwise

_KINDS = {1: (1, 2), 2: (2, 3), 3: (2, 4), 4: (3, 4), 5: (3, 8), 6: (3, 6), 7: (3, 5), 8: (1, 3), 9: (2, 6),
          10: (2, 9), 11: (3, 10), 12: (3, 27), 13: (3, 18), 14: (3, 14), 15: (0, 1), 16: (2, 8), 17: (3, 20),
          18: (3, 15), 19: (3, 13), 20: (2, 9), 21: (2, 10), 22: (2, 12), 23: (2, 15), 24: (2, 15), 25: (2, 21),
          26: (1, 4), 27: (1, 5), 28: (1, 6), 29: (3, 20), 36: (2, 16), 37: (2, 25)}
"""gmsh's number of an element type: (dimension, nodes)."""
_ONCE = ("MeshFormat", "PhysicalNames", "Entities", "PartitionedEntities", "Nodes", "Elements")
_LINES, _TRIANGLES = {1: 2, 8: 3}, {2: 3, 9: 6}


class Block(NamedTuple):
    """Elements of one type on one entity: its dimension and number, gmsh's element type, the physical groups (numbers),
    and node numbers, shape (n, nodes of one)."""

    dim: int
    entity: int
    kind: int
    groups: tuple[int, ...]
    nodes: np.ndarray


class Content(NamedTuple):
    """Content of a file: node numbers, shape (n,); points, shape (n, 3); blocks; {(dimension, group): name}."""

    numbers: np.ndarray
    points: np.ndarray
    blocks: list[Block]
    names: dict[tuple[int, int], str]


def content(file: str | os.PathLike) -> Content:
    """Nodes, elements and names of a mesh file.

    Raises:
        InputError: the file cannot be read, or is not a mesh in one of the formats; the message names the section.
    """
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

    def numbers(name: str) -> _Numbers:
        return _Numbers(sections[name], binary, order, width, f"mesh file {file!r}, section ${name}")
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
    """Return the grid in a mesh file: physical groups name the layers (2-D) and the boundaries (1-D).

    Raises:
        InputError: as `content`; no physical group of dimension 2, elements other than triangles, a body that is not
            in a plane of constant z.
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
    if np.ptp(body[:, 2]) > 1e-9 * size:
        raise InputError(f"mesh file {file!r} is not a plane section: z goes from {body[:, 2].min():.6g} to"
                         f" {body[:, 2].max():.6g}; x must be R, y Z, and z the same everywhere")
    used = np.unique(np.concatenate([found.numbers[sort][rows].ravel() for rows in layers.values()]))
    for block in found.blocks:
        if block.dim == 2 and not block.groups and np.isin(block.nodes, used).any():
            raise InputError(f"mesh file {file!r}: {len(block.nodes)} elements of surface {block.entity} are of no"
                             f" physical group, and part of the body: name their layer, or leave them out")
    layers = {name: counter_clockwise(points[:, :2], rows) for name, rows in layers.items()}
    orders = {rows.shape[1] for rows in layers.values()}
    if len(orders) > 1:
        raise InputError(f"mesh file {file!r} has triangles of three and of six nodes: all must have the same number")
    return Grid(points[:, :2].copy(), found.numbers[sort], layers, boundaries)


def write(grid: Grid, file: str | os.PathLike) -> None:
    """Write a grid as MSH 2.2, text: groups numbered in order, layers first."""
    parts = [(2, name, rows) for name, rows in grid.layers.items()]
    parts += [(1, name, rows) for name, rows in grid.boundaries.items()]
    named = [f'{dim} {tag} "{name}"' for tag, (dim, name, _) in enumerate(parts, 1)]
    kinds = {(2, 6): 9, (2, 3): 2, (1, 3): 8, (1, 2): 1}
    elements = [f"{kinds[dim, rows.shape[1]]} 2 {tag} {tag} {' '.join(map(str, row))}"
                for tag, (dim, _, rows) in sorted(enumerate(parts, 1), key=lambda part: part[1][0])
                for row in grid.numbers[rows].tolist()]
    nodes = [f"{n} {float(r)!r} {float(z)!r} 0" for n, (r, z) in zip(grid.numbers.tolist(), grid.points, strict=True)]
    lines = ["$MeshFormat", "2.2 0 8", "$EndMeshFormat",
             "$PhysicalNames", str(len(named)), *sorted(named, key=lambda line: line[0]), "$EndPhysicalNames",
             "$Nodes", str(len(nodes)), *nodes, "$EndNodes",
             "$Elements", str(len(elements)), *(f"{k} {row}" for k, row in enumerate(elements, 1)), "$EndElements"]
    replace(file, lambda stream: stream.write("\n".join(lines) + "\n"))


def _parts(found: Content, dim: int, kinds: dict[int, int], numbers: np.ndarray, file: str) -> dict[str, np.ndarray]:
    """{name: elements as indices into the sorted numbers} of the physical groups of a dimension."""
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
            at = np.minimum(np.searchsorted(numbers, block.nodes), max(len(numbers) - 1, 0))
            if not len(numbers) or np.any(numbers[at] != block.nodes):
                raise InputError(f"mesh file {file!r}: an element of group {name!r} has a node that is not in $Nodes")
            rows.append(at)
        if len({r.shape[1] for r in rows}) > 1:
            raise InputError(f"mesh file {file!r}: group {name!r} mixes {what} of"
                             f" {' and '.join(map(str, kinds.values()))} nodes: all must have the same number")
    return {name: np.concatenate(rows) for name, rows in parts.items()}


def _sections(data: bytes, file: str) -> Iterator[tuple[str, bytes]]:
    """Names and bodies of the sections, which must be the whole file."""
    begin, at = re.compile(rb"\s*\$(\w{1,40})[ \t]*\r?\n"), 0
    while match := begin.match(data, at):
        end = data.find(b"$End" + match[1], match.end())
        if end < 0:
            raise InputError(f"mesh file {file!r} ends within its section ${match[1].decode()}")
        yield match[1].decode(), data[match.end():end]
        at = end + len(match[1]) + 4
    rest = data[at:].strip()
    if rest:
        raise InputError(f"mesh file {file!r}: {rest[:40].decode('utf-8', 'replace')!r} is no section of a mesh")


def _format(body: bytes, file: str) -> tuple[str, bool, str, int]:
    """(version, binary, byte order, bytes of a size) from $MeshFormat."""
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


class _Numbers:
    """The numbers of a section one after the other, text or binary."""

    def __init__(self, body: bytes, binary: bool, order: str, width: int, where: str):
        self._binary, self._order, self._width, self.where = binary, order, width, where
        self._body, self._at = body, 0
        if not binary:
            try:
                if re.search(rb"[^\s+\-.0-9a-zA-Z]", body):      # NumPy takes 1_0 for a number
                    raise ValueError("a character that is not part of a number")
                self._values = np.array(body.split(), dtype=float)
            except ValueError as error:
                raise InputError(f"{where}: {error}: must be numbers") from None

    @property
    def binary(self) -> bool:
        return self._binary

    def line(self) -> int:
        """Return the count on a line of text, as the old binary format has it."""
        end = self._body.find(b"\n", self._at)
        word = self._body[self._at:end].strip()
        if end < 0 or not word.isdigit() or len(word) > 15:
            raise InputError(f"{self.where}: must begin with a count")
        self._at = end + 1
        return int(word)

    def reals(self, n: int) -> np.ndarray:
        """Return the next n real numbers."""
        return self._take(n, "f8")

    def ints(self, n: int) -> np.ndarray:
        """Return the next n whole numbers of four bytes."""
        return self.whole(self._take(n, "i4"))

    def few(self, n: int) -> list[int]:
        """`ints` as a list."""
        return [int(value) for value in self.ints(n)]

    def sizes(self, n: int) -> np.ndarray:
        """Return the next n whole numbers of the file's own width (counts, and numbers of nodes and elements)."""
        return self.whole(self._take(n, f"u{self._width}"))

    def end(self) -> None:
        """Raise an InputError unless all of the section was read: the part beyond its counts would be lost."""
        left = len(self._body[self._at:].strip()) if self._binary else len(self._values) - self._at
        if left:
            raise InputError(f"{self.where}: {left} more {'bytes' if self._binary else 'numbers'} follow what its"
                             f" counts announce")

    def records(self, n: int, fields: list) -> np.ndarray:
        """Return the next n records of a binary section."""
        return self._bytes(n, np.dtype([(name, self._order + kind, shape) for name, kind, shape in fields]))

    def _take(self, n: int, kind: str) -> np.ndarray:
        if self._binary:
            return self._bytes(n, np.dtype(self._order + kind))
        if n > len(self._values) - self._at:
            raise InputError(f"{self.where}: ends too early: {n} more numbers must follow")
        self._at += n
        return self._values[self._at - n:self._at]

    def _bytes(self, n: int, kind: np.dtype) -> np.ndarray:
        if n * kind.itemsize > len(self._body) - self._at:
            raise InputError(f"{self.where}: ends too early: {n} more numbers must follow")
        found = np.frombuffer(self._body, kind, n, self._at)
        self._at += n * kind.itemsize
        return found

    def whole(self, values: np.ndarray) -> np.ndarray:
        """Return the values as whole numbers; an InputError unless they are."""
        with np.errstate(invalid="ignore"):
            whole = np.abs(values) < 2.0**53
            found = np.where(whole, values, 0).astype(np.int64)
        if not np.all(whole) or np.any(found != values):
            raise InputError(f"{self.where}: a whole number was expected")
        return found


def _count(found: Sequence[int] | np.ndarray, section: _Numbers) -> int:
    n = int(found[0])
    if not 0 <= n < 2**40:
        raise InputError(f"{section.where}: a count is {n}")
    return n


def _dimension(dim: int, section: _Numbers) -> int:
    if not 0 <= dim <= 3:
        raise InputError(f"{section.where}: a dimension is {dim}")
    return dim


def _nodes_2(section: _Numbers) -> tuple[np.ndarray, np.ndarray]:
    if section.binary:
        rows = section.records(section.line(), [("number", "i4", ()), ("x", "f8", (3,))])
        section.end()
        return rows["number"].astype(np.int64), rows["x"].astype(float)
    n = _count(section.ints(1), section)
    rows = section.reals(4 * n).reshape(n, 4)
    section.end()
    return section.whole(rows[:, 0]), rows[:, 1:].copy()


def _elements_2(section: _Numbers) -> list[Block]:
    """One block for each (type, group, entity), in the order of the file."""
    found: dict[tuple[int, int, int], list] = {}
    n, got = section.line() if section.binary else _count(section.ints(1), section), 0
    while got < n:
        # binary: type, number of such elements, number of tags, then elements; text: number, type, number of tags
        head = section.few(3)
        kind, many, tags = head if section.binary else (head[1], 1, head[2])
        if kind not in _KINDS or many < 1 or not 2 <= tags <= 1000:
            raise InputError(f"{section.where}: element {got + 1}: type {kind} with {tags} tags is not known")
        width = section.binary + tags + _KINDS[kind][1]
        rows = section.ints(many * width).reshape(many, width)[:, int(section.binary):]
        for row in rows:
            found.setdefault((kind, int(row[0]), int(row[1])), []).append(row[tags:])
        got += many
    section.end()
    return [Block(_KINDS[kind][0], entity, kind, (abs(group),) if group else (), np.array(rows))
            for (kind, group, entity), rows in found.items()]


def _groups(section: _Numbers, whole: dict | None = None) -> dict[tuple[int, int], tuple[int, ...]]:
    """{(dimension, entity): its physical groups}; `whole`: those of the entities that partitions are parts of."""
    found = {}
    if whole is not None:
        section.sizes(1)                                    # number of partitions
        section.ints(2 * _count(section.sizes(1), section))         # ghost entities
    counts = section.sizes(4)
    for dim in range(4):
        for _ in range(_count(counts[dim:], section)):
            tag, = section.few(1)
            if whole is not None:
                parent = tuple(section.few(2))
                section.ints(_count(section.sizes(1), section))     # partitions
            section.reals(3 if dim == 0 else 6)
            groups = section.few(_count(section.sizes(1), section))
            if dim:
                section.ints(_count(section.sizes(1), section))
            if whole is not None:
                groups += whole.get(parent, ()) if parent[0] == dim else ()
            found[dim, tag] = tuple(dict.fromkeys(map(abs, groups)))
    section.end()
    return found


def _nodes_4(section: _Numbers) -> tuple[np.ndarray, np.ndarray]:
    numbers: list[np.ndarray] = [np.zeros(0, dtype=np.int64)]
    points: list[np.ndarray] = [np.zeros((0, 3))]
    blocks, total, *_ = section.sizes(4)
    for _ in range(_count([blocks], section)):
        dim, _, parametric = section.few(3)
        n = _count(section.sizes(1), section)
        numbers.append(section.sizes(n))
        width = 3 + (_dimension(dim, section) if parametric else 0)
        points.append(section.reals(width * n).reshape(n, width)[:, :3])
    _total(section, "nodes", total, numbers)
    return np.concatenate(numbers), np.concatenate(points)


def _total(section: _Numbers, what: str, total: int, parts: list[np.ndarray]) -> None:
    """Raise an InputError unless the section ends and has as many parts as its first line says."""
    section.end()
    if (found := sum(map(len, parts))) != total:
        raise InputError(f"{section.where}: {found} {what}, but its first line says {total}")


def _elements_4(section: _Numbers, groups: dict[tuple[int, int], tuple[int, ...]]) -> list[Block]:
    blocks = []
    many, total, *_ = section.sizes(4)
    for _ in range(_count([many], section)):
        dim, entity, kind = section.few(3)
        n = _count(section.sizes(1), section)
        if kind not in _KINDS or _KINDS[kind][0] != dim:
            raise InputError(f"{section.where}: elements of type {kind} and dimension {dim} are not known")
        width = 1 + _KINDS[kind][1]
        rows = section.sizes(n * width).reshape(n, width)[:, 1:]
        blocks.append(Block(dim, entity, kind, groups.get((dim, entity), ()), rows))
    _total(section, "elements", total, [block.nodes for block in blocks])
    return blocks
