"""Elements of a sheet that tools touch, for `accuracy=` of `disc` and `parison`.

The wall of a formed sheet is least accurate where the sheet lies on a fillet of a tool. The columns of elements there
are short; elsewhere long columns are accurate enough. `fillets_in_sheet` estimates the part of the sheet that reaches
a fillet.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from ..values.tolerances import CURVE_POINTS
from .fillets import FilletInSheet, FlatsInSheet, fillets_in_sheet, flats_in_sheet
from .mesh import Mesh, Preset
from .sizes import GROWTH, ends_of_columns, length_along, moved_nodes, number_of_columns


class Fineness(NamedTuple):
    """Sizes of the elements of one accuracy.

    Attributes:
        along: number of columns along a sheet without fillets and constrained ends.
        max_through_at_end: number of elements through the sheet up to which more of them shorten the columns at a
            constrained end.
        max_through: largest number of elements through the sheet.
        even: distance from a constrained end up to which the columns have their shortest length, over the thickness.
        height: largest height over length of an element on a fillet, both in the reference configuration.
        promised: largest relative error of the wall.
        target: estimated error for which the elements are chosen. The estimate may be a fifth too low.
    """

    along: int
    max_through_at_end: int
    max_through: int
    even: float
    height: float
    promised: float
    target: float


FINENESS = {"draft": Fineness(16, 1, 6, 0.0, 4.0, 0.03, 0.03), "standard": Fineness(20, 2, 8, 0.0, 5.0, 0.01, 0.01),
            "fine": Fineness(32, 3, 12, 1.0, 5.0, 0.003, 0.0024)}
"""Element sizes of each accuracy: benchmarks/accuracy_in_moulds.py measures the errors."""

_THICKEST = 1 / 10
"""Thickness over length above which a body is no sheet and keeps its elements."""

_BLOCK = 1 / 4
"""Thickness over length above which a body is called a block, whose wall is of no interest."""

_SHORTEST = 1 / 20
"""Smallest over largest length of a column."""

_POSITION_ERROR = 0.03
"""Largest error of the estimated ends of a fillet in the sheet, over the length of the sheet. Towards the start of the
sheet the error may be twice as large, in a curved sheet three times."""

_END_COLUMN_LENGTH = 0.5
"""Length of a column at a constrained end over the height of an element there, of at most `max_through_at_end` elements
through the sheet (`Fineness`). Shorter columns lock, longer ones miss the bending."""

_ALONG_CONCAVE = 0.0155
"""Relative error of the wall on a concave fillet if the deformed columns are as long as its radius and the sheet is not
stretched (`_column_length`)."""

_ALONG_CONVEX = 0.65
"""The same error on a fillet behind which the wall is e times as thick as in front of it."""

_MIN_WALL_CHANGE = 0.16
"""Smallest change of the logarithm of the wall that is expected over a fillet."""

_ON_FLAT = 0.012
"""The same error on a flat face of a tool if the columns are as long as the geometric mean of wall and radius of the
free surface. A thin sheet leaves the face within this length; longer columns touch too late."""

_THROUGH = 0.0225
"""Relative error of the wall on a fillet for one element through a sheet that is as thick as the radius and is not
stretched (`_error_through`)."""

_THROUGH_CONVEX = 0.35
"""The same error on a convex fillet behind which the wall is e times as thick as in front of it."""

_BESIDE_END = 3.0
"""Distance of the middle of a lip, a convex fillet, from a constrained end, over the thickness, below which the sheet
is hardly stretched there and needs no more elements through it."""


def for_contacts(mesh: Mesh, contacts: Sequence[Any], axisymmetric: bool, keep_through: bool = False) -> Mesh:
    """Return a mesh with short columns at fillets of tools, or a thick, deformed or user-divided one as it is."""
    preset, columns = mesh.preset, mesh.columns
    if preset is None or columns is None or not contacts or moved_nodes(mesh) > 1e-9:
        return mesh
    coordinates = np.linspace(columns.ends[0], columns.ends[-1], CURVE_POINTS)
    rows = columns.place(coordinates)
    s = length_along(rows[[0, -1]].mean(0))
    faces = dict(zip(columns.faces, rows[[0, -1]]))
    thickness, touching = float(preset.thickness.sum()), [item for item in contacts if item.on in faces]
    if not touching or thickness > _THICKEST * s[-1]:
        return mesh
    fineness = FINENESS[preset.accuracy]
    constrained = [s[end] for end in (0, -1) if rows[:, end, 0].max() > 1e-9 * s[-1]]     # the axis is none
    longest = s[-1] / fineness.along
    size, fillets, inaccurate = np.full(len(s), longest), [], []
    for item in touching:
        flat = bool(np.ptp(faces[item.on][:, 1]) < 1e-9 * s[-1])
        for fillet in fillets_in_sheet(item.tool, faces[item.on], axisymmetric, item.direction is not None):
            middle = (fillet.first + fillet.last) / 2
            inside = fillet.concave or all(abs(middle - end) > _BESIDE_END * thickness for end in constrained)
            fillets.append((fillet, inside, _distance(s, fillet, flat)))
            if inside and _bend(fillet, thickness) > 1:
                inaccurate.append(_sharp_fillet(item, fillet, thickness, preset.accuracy, fineness))
        if item.direction is None:
            flats = flats_in_sheet(item.tool, faces[item.on], axisymmetric)
            size = np.minimum(size, np.maximum(_on_flats(flats, s, thickness, fineness.target), _SHORTEST * longest))
    size, through = _fewest_unknowns(s, size, fillets, constrained, thickness, fineness)
    ends = ends_of_columns(coordinates, s, size, np.union1d(columns.fixed, columns.ends[[0, -1]]))
    return replace(preset.make(ends, _through_layers(preset, through, keep_through)), inaccurate=tuple(inaccurate))


def _fewest_unknowns(s: np.ndarray, size: np.ndarray, fillets: list[tuple[FilletInSheet, bool, np.ndarray]],
                     constrained: list[float], thickness: float, fineness: Fineness) -> tuple[np.ndarray, int]:
    """Return the largest lengths of columns, shape (n,), and the number of elements through the sheet.

    They have the fewest unknowns with a small enough estimated error on every fillet, given as (fillet, False for a lip
    at a constrained end, distances (n,)). s, `size` and thickness are lengths.
    """
    choices, longest = [], s[-1] / fineness.along
    for through in range(1, fineness.max_through + 1):
        errors, lengths, sizes = [0.0], [longest], [size]
        for fillet, inside, distance in fillets:
            errors.append(_error_through(fillet, thickness, through, inside) / fineness.target)
            length = _column_length(fillet, fineness.target * np.sqrt(max(1 - errors[-1] ** 2, 0.0)))
            lengths.append(max(length, _SHORTEST * longest))
            sizes.append(lengths[-1] + GROWTH * distance)
        for end in constrained:
            distance = np.maximum(np.abs(s - end) - fineness.even * thickness, 0.0)
            sizes.append(_END_COLUMN_LENGTH * thickness / min(through, fineness.max_through_at_end) + GROWTH * distance)
        smallest = np.minimum.reduce(sizes)
        fails = max(errors) > 1 or thickness > fineness.height * through * min(lengths)
        unknowns = number_of_columns(s, smallest)[-1] * (18 * through + 4)
        choices.append((fails, -through if fails else unknowns, smallest, through))
    return min(choices, key=lambda choice: choice[:2])[2:]


def _sharp_fillet(item: Any, fillet: FilletInSheet, thickness: float, accuracy: str, fineness: Fineness) -> str:
    """Return the text of the finding about a fillet that is sharper than the wall on it is thick."""
    return (f"on a fillet of {item.name or item.on!r} of radius {fillet.radius:.4g} the wall, about"
            f" {thickness * fillet.area_ratio:.3g}, is thicker than the radius: there its error may exceed the"
            f" {fineness.promised:.1%} of accuracy = {accuracy!r}. Compare a run with accuracy = 'fine', or give more"
            f" elements through the sheet")


def is_thick_sheet(mesh: Mesh) -> bool:
    """Return True for a `disc` or `parison` of 1/10 to 1/4 of its length, whose elements tools do not choose."""
    if mesh.preset is None or mesh.columns is None:
        return False
    ends = mesh.columns.ends
    line = mesh.columns.place(np.linspace(ends[0], ends[-1], CURVE_POINTS))[[0, -1]].mean(0)
    return _THICKEST < float(mesh.preset.thickness.sum()) / length_along(line)[-1] < _BLOCK


def _distance(s: np.ndarray, fillet: FilletInSheet, flat: bool) -> np.ndarray:
    """Return the distance along a sheet from points s, (n,), to the part that may lie on a fillet, (n,), length."""
    error = _POSITION_ERROR * s[-1]
    return np.maximum(np.maximum(fillet.first - (2 if flat else 3) * error - s, s - fillet.last - error), 0.0)


def _bend(fillet: FilletInSheet, thickness: float) -> float:
    """Return the wall over the radius of a fillet, at most the angle of the arc: it bridges shorter arcs."""
    return float(min(thickness * fillet.area_ratio / fillet.radius, np.arccos(1 - fillet.turn)))


def _error_through(fillet: FilletInSheet, thickness: float, through: int, inside: bool) -> float:
    r"""Return the relative error of the wall on a fillet that is due to the number of elements through the sheet.

    With the thickness h0, radius r of the fillet, inverse stretch q, n elements and change s of the logarithm of the
    wall over the fillet it is the larger of

    .. math:: b_1 \frac{h_0}{q r n^{7/4}}, \quad b_2 s \Bigl(\frac{h_0}{r}\Bigr)^{3/2} \frac{1}{n^2}.

    The second error is that of a convex fillet over which the sheet is drawn. A wall thicker than the radius counts as
    one as thick as the radius: such an edge is reported. `through` is n, and `inside` is False for a lip beside a
    constrained end.
    """
    relative = min(_bend(fillet, thickness), 1.0) / max(fillet.area_ratio, 1e-6)
    error = _THROUGH * relative / fillet.stretch / through**1.75
    if inside and not fillet.concave:
        error = max(error, _THROUGH_CONVEX * fillet.wall_change * relative**1.5 / through**2)
    return float(error)


def _column_length(fillet: FilletInSheet, error: float) -> float:
    r"""Return the length of a column in the reference configuration that has a given error of the wall on a fillet.

    A column of the deformed length l has the larger of the errors

    .. math:: a_1 \Bigl(\frac{l}{q^{3/2} r}\Bigr)^{7/4}, \quad a_2 s \Bigl(\frac{l}{r}\Bigr)^2

    on a concave fillet, and the second one on a convex fillet (symbols as in `_error_through`). The error is relative
    to the wall.
    """
    change = max(fillet.wall_change, _MIN_WALL_CHANGE)
    relative = np.sqrt(error / (_ALONG_CONVEX * change))
    if fillet.concave:
        relative = min(relative, fillet.stretch**1.5 * (error / _ALONG_CONCAVE) ** (1 / 1.75))
    return float(fillet.stretch * fillet.radius * relative)


def _on_flats(flats: FlatsInSheet, s: np.ndarray, thickness: float, error: float) -> np.ndarray:
    r"""Return the largest length of a column at points of a sheet that touch flat faces, shape (n,), length.

    A column of the deformed length l, of a wall h, has the error

    .. math:: a_3 \Bigl(\frac{l}{\sqrt{\rho h}}\Bigr)^{3/2}

    with the radius rho of the free surface when the sheet touches. Lengths s along the sheet, thickness h and the
    error, relative to the wall, are given.
    """
    if not len(flats.positions):
        return np.full(len(s), np.inf)
    length = flats.stretches * np.sqrt(flats.free_radii * thickness * flats.area_ratios)
    return np.interp(s, flats.positions, length * (error / _ON_FLAT) ** (2 / 3))


def _through_layers(preset: Preset, through: int, keep: bool) -> list[int]:
    """Return elements through each layer by its thickness; `keep`: at least as many as the mesh has."""
    share = preset.thickness / preset.thickness.sum()
    minimum = np.array(preset.through if keep else np.ones(len(share)))
    return np.maximum(np.ceil(through * share - 1e-9), minimum).astype(int).tolist()
