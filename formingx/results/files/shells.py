"""Part as shell elements with the wall as thickness: an input file for CalculiX and Abaqus.

G. Dhondt, CalculiX CrunchiX User's Manual: S8R and S6 elements, *SHELL SECTION with *NODAL THICKNESS.
"""

from typing import Any

import numpy as np

from ..evaluate.profile import distance_to_line, refined
from . import tabular


def shells(profile: Any, parts: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return nodes, wall and quadratic shell elements of the middle surface of an axisymmetric sheet.

    `parts` elements lie round the axis. Nodes (n, 3), length; walls (n,), length, means of the shortest distances
    between the faces; node numbers of triangles S6 (m, 6) and quadrilaterals S8R (k, 8), corners first.
    """
    wall = (distance_to_line(profile.bottom, refined(profile.top))
            + distance_to_line(profile.top, refined(profile.bottom))) / 2
    line = profile.middle
    n, turn = len(line), np.linspace(0, 2 * np.pi, 2 * parts, endpoint=False)
    points = np.stack([np.outer(np.cos(turn), line[:, 0]), np.outer(np.sin(turn), line[:, 0]),
                       np.tile(line[:, 1], (2 * parts, 1))], axis=-1)
    number = np.arange(2 * parts * n).reshape(2 * parts, n)
    pole = line[0, 0] < 1e-9 * np.ptp(line)
    if pole:
        number[:, 0] = number[0, 0]
    start, middle, end = (np.roll(number, -k, axis=0)[::2] for k in range(3))
    a, b = slice(0, -1, 2), slice(2, None, 2)
    quads = np.stack([start[:, a], start[:, b], end[:, b], end[:, a], start[:, 1::2], middle[:, b], end[:, 1::2],
                      middle[:, a]], axis=-1)
    tips = quads[:, 0][:, [0, 1, 2, 4, 5, 6]] if pole else np.zeros((0, 6), dtype=int)
    quads = quads[:, int(pole):].reshape(-1, 8)
    used, new = np.unique(np.concatenate([tips.ravel(), quads.ravel()]), return_inverse=True)
    new = new.ravel()
    return (points.reshape(-1, 3)[used], np.tile(wall, 2 * parts)[used], new[: tips.size].reshape(-1, 6),
            new[tips.size:].reshape(-1, 8))


def to_inp(profile: Any, parts: int, file: Any, comm: Any) -> None:
    """Write an axisymmetric sheet as shells with walls and rim for CalculiX or Abaqus (`Path.to_inp`) on rank 0."""
    file = tabular.named("to_inp", file, ".inp")
    points, walls, tips, quads = shells(profile, parts)
    lines = ["*HEADING", "formingx: middle surface of a formed part, turned about z; its walls as thickness",
             "*NODE, NSET=ALL"]
    lines += [", ".join([str(k), *map(repr, map(float, x))]) for k, x in enumerate(points, 1)]
    first = 1
    for kind, elements in (("S6", tips), ("S8R", quads)):
        if len(elements):
            lines.append(f"*ELEMENT, TYPE={kind}, ELSET=WALL")
            lines += [", ".join(map(str, [k, *row])) for k, row in enumerate((elements + 1).tolist(), first)]
            first += len(elements)
    section = np.column_stack([np.hypot(*points[:, :2].T), points[:, 2]])
    ends = profile.middle[[-1]] if profile.middle[0, 0] < 1e-9 * np.ptp(points) else profile.middle[[0, -1]]
    rim = np.flatnonzero((np.linalg.norm(section[:, None] - ends, axis=2) < 1e-9 * np.ptp(points)).any(1)) + 1
    lines += ["*NSET, NSET=RIM", *(f"{k}," for k in rim), "*NODAL THICKNESS"]
    lines += [f"{k}, {wall!r}" for k, wall in enumerate(walls.tolist(), 1)]
    lines += ["** give MATERIAL its constants, here or before: *MATERIAL, NAME=MATERIAL",
              "*SHELL SECTION, ELSET=WALL, MATERIAL=MATERIAL, NODAL THICKNESS", repr(float(walls.mean()))]
    tabular.on_root(comm, lambda: tabular.replace(file, lambda stream: stream.write("\n".join(lines) + "\n")))
