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

from .fillets import FilletInSheet, FlatsInSheet, fillets_in_sheet, flats_in_sheet
from .mesh import Mesh, Preset
from .sizes import GROWTH, ends_of_columns, length_along, moved_nodes


class Fineness(NamedTuple):
    """Sizes of the elements of one accuracy.

    Attributes:
        along: number of columns along a sheet without fillets and constrained ends.
        fillet: length of a deformed column on a fillet over the geometric mean of fillet radius and wall thickness.
        through: smallest number of elements through the sheet.
        even: distance from a constrained end up to which the columns have their shortest length, over the thickness.
        height: largest height over length of an element on a fillet, both in the reference configuration.
        promised: largest relative error of the wall.
    """

    along: int
    fillet: float
    through: int
    even: float
    height: float
    promised: float


FINENESS = {"draft": Fineness(16, 1.15, 1, 0.0, 5.0, 0.03), "standard": Fineness(20, 0.68, 2, 0.0, 4.0, 0.01),
            "fine": Fineness(40, 0.36, 3, 1.0, 4.0, 0.003)}
"""Element sizes of each accuracy: benchmarks/accuracy_in_moulds.py measures the errors."""

_THICKEST = 1 / 10
"""Thickness over length above which a body is no sheet and keeps its elements."""

_BLOCK = 1 / 4
"""Thickness over length above which a body is called a block, whose wall is of no interest."""

_SHORTEST = 1 / 16
"""Smallest over largest length of a column."""

_POSITION_ERROR = 0.03
"""Largest error of the estimated ends of a fillet in the sheet, over the length of the sheet. Towards the start of the
sheet the error may be three times larger."""

_END_COLUMN_LENGTH = 0.5
"""Length of a column at a constrained end over the height of an element there, of at most `Fineness.through` elements
through the sheet. Shorter columns lock, longer ones miss the bending."""

_WEAK_BENDING = 0.04
"""Wall over fillet radius, times 1 - cos of the angle of the arc, below which two elements through the sheet are
enough."""

_MAX_WALL = 0.25
"""Largest wall over fillet radius that enters the geometric mean: a thicker wall allows no longer columns."""

_TURN = 1 / 8
"""Exponent of 1 - cos of the angle of the arc: the sheet bridges a short arc less, and its columns may be longer."""

_ON_FLAT = 2.0
"""Length of a column on a flat face of a tool over that on a fillet whose radius is the radius of the free surface when
the sheet touches. A thin sheet leaves the face within this length; longer columns touch too late."""

_ON_CONVEX = 0.25
"""Relative error of the wall on a convex fillet, over which the sheet is drawn, over the square of wall / (fillet
radius times elements through the sheet): 0.09 to 0.25 in five moulds."""

_ON_CONCAVE = 0.14
"""The same quotient on a concave fillet: 0.09 to 0.17 in five moulds."""

_SHARPEST = 1.0
"""Largest wall over fillet radius for which the elements through the sheet are chosen. At 1.5 "draft" has an error of
4.7 %."""

_BESIDE_END = 3.0
"""Distance of the middle of a lip, a convex fillet, from a constrained end, over the thickness, below which the sheet
is hardly stretched there and needs no more elements through it."""

_SHEET_SAMPLES = 2000            # points of the sheet at which sizes are computed


def for_contacts(mesh: Mesh, contacts: Sequence[Any], axisymmetric: bool, keep_through: bool = False) -> Mesh:
    """Return a mesh of the same body with short columns of elements at the fillets of its tools.

    The mesh itself is returned if the script gave its elements, if it was deformed, or if it is no thin sheet.

    Args:
        mesh: mesh from `disc` or `parison`.
        contacts: contacts of the scene, with `on`, `tool` and `direction`.
        axisymmetric: True for bodies of revolution, False in plane strain.
        keep_through: True for at least as many elements through each layer as the mesh has.
    """
    preset, columns = mesh.preset, mesh.columns
    if preset is None or columns is None or not contacts or moved_nodes(mesh) > 1e-9:
        return mesh
    coordinates = np.linspace(columns.ends[0], columns.ends[-1], _SHEET_SAMPLES)
    rows = columns.place(coordinates)
    s = length_along(rows[[0, -1]].mean(0))
    faces = dict(zip(columns.faces, rows[[0, -1]]))
    thickness, touching = float(preset.thickness.sum()), [item for item in contacts if item.on in faces]
    if not touching or thickness > _THICKEST * s[-1]:
        return mesh
    fineness = FINENESS[preset.accuracy]
    longest = s[-1] / fineness.along
    constrained = [s[end] for end in (0, -1) if rows[:, end, 0].max() > 1e-9 * s[-1]]     # the axis is none
    size = np.full(len(s), longest)
    shortest, bending, through = longest, 0.0, 1
    inaccurate = []
    for item in touching:
        for fillet in fillets_in_sheet(item.tool, faces[item.on], axisymmetric, item.direction is not None):
            wall = thickness * fillet.area_ratio
            mean = np.sqrt(fillet.radius * min(wall, _MAX_WALL * fillet.radius))
            column_length = fineness.fillet * fillet.stretch * mean
            column_length *= max(fillet.turn, 0.25) ** -_TURN               # arcs of a curve may be short
            column_length = max(column_length, _SHORTEST * longest)
            middle = (fillet.first + fillet.last) / 2
            if fillet.concave or all(abs(middle - end) > _BESIDE_END * thickness for end in constrained):
                bend = min(wall / fillet.radius, np.arccos(1 - fillet.turn))
                through = max(through, _through_fillet(bend, fillet.concave, fineness.promised))
                if bend > _SHARPEST:
                    inaccurate.append(_sharp_fillet(item, fillet, wall, preset.accuracy, fineness))
            shortest = min(shortest, column_length)
            size = np.minimum(size, column_length + GROWTH * _distance(s, fillet))
            if fillet.concave:
                bending = max(bending, wall / fillet.radius * fillet.turn)
        if item.direction is None:
            size = np.minimum(size, np.maximum(_on_flats(
                flats_in_sheet(item.tool, faces[item.on], axisymmetric), s, thickness, fineness), _SHORTEST * longest))
    through = max(through, fineness.through if bending >= _WEAK_BENDING else min(fineness.through, 2),
                  int(np.ceil(thickness / (fineness.height * shortest) - 1e-9)))
    for end in constrained:
        distance = np.maximum(np.abs(s - end) - fineness.even * thickness, 0.0)
        size = np.minimum(size, _END_COLUMN_LENGTH * thickness / min(through, fineness.through) + GROWTH * distance)
    ends = ends_of_columns(coordinates, s, size, np.union1d(columns.fixed, columns.ends[[0, -1]]))
    return replace(preset.make(ends, _through_layers(preset, through, keep_through)), inaccurate=tuple(inaccurate))


def _sharp_fillet(item: Any, fillet: FilletInSheet, wall: float, accuracy: str, fineness: Fineness) -> str:
    """Return the text of the finding about a fillet that is sharper than the wall on it is thick.

    Args:
        item: the contact.
        fillet: the fillet.
        wall: estimated wall on the fillet, length.
        accuracy: "draft", "standard" or "fine".
        fineness: sizes of the elements of this accuracy.
    """
    return (f"on a fillet of {item.name or item.on!r} of radius {fillet.radius:.4g} the wall, about {wall:.3g}, is"
            f" thicker than the radius: there its error may exceed the {fineness.promised:.1%} of accuracy ="
            f" {accuracy!r}. Compare a run with accuracy = 'fine', or give more elements through the sheet")


def is_thick_sheet(mesh: Mesh) -> bool:
    """Return True for a sheet from `disc` or `parison` whose thickness is 1/10 to 1/4 of its length.

    The tools that it touches do not choose its elements (`for_contacts`). A thicker body is a block, whose wall is of
    no interest.
    """
    if mesh.preset is None or mesh.columns is None:
        return False
    ends = mesh.columns.ends
    line = mesh.columns.place(np.linspace(ends[0], ends[-1], _SHEET_SAMPLES))[[0, -1]].mean(0)
    return _THICKEST < float(mesh.preset.thickness.sum()) / length_along(line)[-1] < _BLOCK


def _distance(s: np.ndarray, fillet: FilletInSheet) -> np.ndarray:
    """Return the distance along the sheet from points to the part that may lie on a fillet, shape (n,), length.

    It is 0 within this part.

    s: lengths along the sheet from its start to the points, shape (n,).
    """
    error = _POSITION_ERROR * s[-1]
    return np.maximum(np.maximum(fillet.first - 3 * error - s, s - fillet.last - error), 0.0)


def _through_fillet(bend: float, concave: bool, promised: float) -> int:
    """Return the number of elements through a sheet on a fillet.

    Args:
        bend: wall over fillet radius, at most the angle of the arc: the wall bridges shorter arcs.
        concave: True if the sheet bridges the fillet before it touches it.
        promised: largest relative error of the wall.
    """
    factor = _ON_CONCAVE if concave else _ON_CONVEX
    return int(np.ceil(min(bend, _SHARPEST) * np.sqrt(factor / promised) - 1e-9))


def _on_flats(flats: FlatsInSheet, s: np.ndarray, thickness: float, fineness: Fineness) -> np.ndarray:
    """Return the largest length of a column at points of a sheet that touch flat faces, shape (n,), length.

    Args:
        flats: points of the sheet that touch.
        s: lengths along the sheet from its start to the points, shape (n,).
        thickness: thickness of the sheet, length.
        fineness: sizes of the elements.
    """
    if not len(flats.positions):
        return np.full(len(s), np.inf)
    wall = np.minimum(thickness * flats.area_ratios, _MAX_WALL * flats.free_radii)
    length = _ON_FLAT * fineness.fillet * flats.stretches * np.sqrt(flats.free_radii * wall)
    return np.interp(s, flats.positions, length)


def _through_layers(preset: Preset, through: int, keep: bool) -> list[int]:
    """Return the numbers of elements through the layers, in proportion to their thickness.

    Args:
        preset: accuracy and layers of the mesh.
        through: number of elements through the whole sheet.
        keep: True for at least as many elements through each layer as the mesh has.
    """
    share = preset.thickness / preset.thickness.sum()
    minimum = np.array(preset.through if keep else np.ones(len(share)))
    return np.maximum(np.ceil(through * share - 1e-9), minimum).astype(int).tolist()
