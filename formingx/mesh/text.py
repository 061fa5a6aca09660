"""The text file of a mesh: nodes and six-node triangles, for other solvers.

The file, line by line. Blank lines and comments (from # to the end of the line) are skipped. Node numbers are any whole
numbers.

    six-node triangles 2                    the format and its version
    numbering corners                       of the six nodes, see below
    nodes 63                                then as many lines: number R Z
    1 0.0 0.082
    elements 20 sheet                       then as many lines: number and six nodes; a block for each layer
    1 3 7 1 12 5 4
    boundary 10 bottom                      then as many lines: first, middle and last node of an edge
    3 12 7
    end                                     marks a complete file (version 1 has no end line)

`numbering corners`: the three corners counter-clockwise, then the middles of the edges 1-2, 2-3, 3-1 (the usual order
of textbooks and of gmsh). `numbering around`: corner, middle, corner, ... counter-clockwise, so that every edge reads
first, middle, last as in eq. (3.3.8) of Song (1993). Along an edge of a boundary the body is on the left, as in the
thesis' eq. (3.3.4).
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from ..errors import InputError
from ..io.numerals import number, whole
from ..io.output import replace
from .grid import Grid, counter_clockwise

_FORMAT, _VERSIONS = "six-node triangles", ("1", "2")
# position of our node (corners first) in a line of the file
_NUMBERINGS = {"corners": [0, 1, 2, 3, 4, 5], "around": [0, 2, 4, 1, 3, 5]}


def write(grid: Grid, file: str | os.PathLike, numbering: str = "corners") -> None:
    """Write a grid of six-node triangles (else an InputError) in the text format of `formingx.mesh.text`.

    numbering: order of the nodes of an element, "corners" first, or "around" (corner, middle, corner, ...).
    """
    order = np.argsort(_NUMBERINGS[_checked_numbering(numbering)])
    if any(t.shape[1] != 6 for t in grid.layers.values()):
        raise InputError("mesh.write: the text format holds six-node triangles; this mesh has three-node ones")
    lines = [f"{_FORMAT} 2", f"numbering {numbering}", f"nodes {len(grid.points)}"]
    lines += [f"{n} {float(r)!r} {float(z)!r}" for n, (r, z) in zip(grid.numbers, grid.points, strict=True)]
    number = 0
    for name, triangles in grid.layers.items():
        lines.append(f"elements {len(triangles)} {name}")
        for row in grid.numbers[triangles[:, order]]:
            number += 1
            lines.append(f"{number} {' '.join(map(str, row))}")
    for name, edges in grid.boundaries.items():
        lines.append(f"boundary {len(edges)} {name}")
        lines += [" ".join(map(str, row)) for row in grid.numbers[edges[:, [0, 2, 1]]]]
    replace(file, lambda stream: stream.write("\n".join([*lines, "end"]) + "\n"))


def read(file: str | os.PathLike) -> Grid:
    """Return the grid in a file of `write`, made counter-clockwise; another format is an InputError with the line."""
    lines = _Lines(os.fspath(file))
    *first, version = next(lines, None) or [""]
    if " ".join(first) != _FORMAT or version not in _VERSIONS:
        raise lines.error(f"the first line must be '{_FORMAT} 2'")
    order, points, numbers = None, np.zeros((0, 2)), np.zeros(0, dtype=np.int64)
    layers: dict[str, np.ndarray] = {}
    boundaries: dict[str, np.ndarray] = {}
    index: dict[int, int] = {}
    elements: set[int] = set()
    ended = version == "1"
    for words in lines:
        if words[0] == "numbering" and len(words) == 2 and order is None:
            order = _NUMBERINGS[_checked_numbering(words[1], lines)]
        elif words[0] == "nodes" and len(words) == 2 and not index:
            rows = lines.block(words[1], (whole, number, number), "number R Z")
            points, numbers = np.array([row[1:] for row in rows]), np.array([row[0] for row in rows])
            index = {n: i for i, n in enumerate(numbers.tolist())}
            if len(index) < len(rows):
                raise lines.error("a node number stands twice in the block of nodes")
            if not np.all(np.isfinite(points)):
                raise lines.error("a coordinate in the block of nodes is not finite")
        elif words[0] == "elements" and len(words) > 2:
            if order is None:
                raise lines.error("'numbering corners' or 'numbering around' must come before the elements")
            rows = lines.block(words[1], (whole,) * 7, "number and six nodes", index)
            if len({row[0] for row in rows} | elements) < len(rows) + len(elements):
                raise lines.error("an element number stands twice")
            elements |= {row[0] for row in rows}
            triangles = np.array([row[1:] for row in rows])[:, order]
            layers[_new_name(lines, words, layers)] = counter_clockwise(points, triangles)
        elif words[0] == "boundary" and len(words) > 2:
            rows = lines.block(words[1], (whole,) * 3, "first, middle and last node", index, all_nodes=True)
            boundaries[_new_name(lines, words, boundaries)] = np.array(rows)[:, [0, 2, 1]]
        elif words == ["end"] and not ended:
            ended = True
            if next(lines, None):
                raise lines.error("stands after 'end'")
        else:
            raise lines.error("must be 'numbering corners|around' or 'nodes COUNT', each once, 'elements COUNT LAYER',"
                              " 'boundary COUNT NAME' or, last, 'end'")
    if not ended:
        raise lines.error("must be followed by 'end', as the last line of version 2: was the file cut off?")
    if not layers:
        raise InputError(f"mesh file {lines.file!r} has no block 'elements COUNT LAYER'")
    _check_edges(lines.file, layers, boundaries, numbers)
    return Grid(points, numbers, layers, boundaries)


def _check_edges(file: str, layers: dict, boundaries: dict, numbers: np.ndarray) -> None:
    """Raise an InputError, with node `numbers`, unless boundary edges (k, 3) belong to elements (m, 6)."""
    edges = {(frozenset(row[[i, j]].tolist()), int(row[k])) for triangles in layers.values() for row in triangles
             for i, j, k in ((0, 1, 3), (1, 2, 4), (2, 0, 5))}
    for name, rows in boundaries.items():
        for a, b, middle in rows.tolist():
            if (frozenset((a, b)), middle) not in edges:
                raise InputError(f"mesh file {file!r}: boundary {name!r}: {numbers[a]} {numbers[middle]} {numbers[b]}"
                                 f" is not an edge of an element (first, middle and last node)")


def _checked_numbering(numbering: str, lines: _Lines | None = None) -> str:
    """Return the checked order of the six nodes, "corners" first or "around"; otherwise an InputError."""
    if numbering not in _NUMBERINGS:
        message = f"numbering = {numbering!r}: must be one of {', '.join(map(repr, _NUMBERINGS))}"
        raise lines.error(message) if lines else InputError(f"mesh.write: {message}")
    return numbering


def _new_name(lines: _Lines, words: Sequence[str], taken: Any) -> str:
    """Return the new name of a layer or boundary from its line of words; InputError if it is taken."""
    name = " ".join(words[2:])
    if name in taken:
        raise lines.error(f"a second block {words[0]!r} is called {name!r}")
    return name


class _Lines(Iterator):
    """Iterator over the lines of a file, each a list of words without comments; it counts lines for messages."""

    def __init__(self, file: str):
        self.file, self.line_number = file, 0
        try:
            with open(file, encoding="utf-8") as stream:
                self._text = stream.read().splitlines()
        except (OSError, UnicodeDecodeError) as error:
            raise InputError(f"mesh file {file!r} cannot be read: {error}") from None

    def __next__(self) -> list[str]:
        while self.line_number < len(self._text):
            words = self._text[self.line_number].split("#")[0].split()
            self.line_number += 1
            if words:
                return words
        raise StopIteration

    def error(self, message: str) -> InputError:
        """Return an error with this message, which names the file and the present line."""
        shown = self._text[self.line_number - 1].strip() if self._text else ""
        return InputError(f"mesh file {self.file!r}, line {self.line_number} ({shown[:60]!r}): {message}")

    def block(self, count: str, kinds: tuple, what: str, nodes: dict | None = None, all_nodes: bool = False) -> list:
        """Return the next `count` lines of numbers as lists, with node numbers converted to indices.

        `kinds` convert the words of each column; `nodes` is {number: index} for all columns but the first, or
        `all_nodes`. Another form or an unknown node is an InputError.
        """
        if not (count.isascii() and count.isdigit() and len(count) <= 15) or int(count) < 1:
            raise self.error(f"the count {count!r} must be a whole number of at least 1")
        rows = []
        for k in range(int(count)):
            words = next(self, None)
            if words is None:
                raise self.error(f"the file ends after {k} of {count} lines of {what}")
            try:
                row = [kind(word) for kind, word in zip(kinds, words, strict=True)]
            except ValueError:
                raise self.error(f"must be {what}: {len(kinds)} numbers") from None
            if nodes is not None:
                for i in range(0 if all_nodes else 1, len(row)):
                    if row[i] not in nodes:
                        raise self.error(f"node {row[i]} is not among the nodes")
                    row[i] = nodes[row[i]]
            rows.append(row)
        return rows
