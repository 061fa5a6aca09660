"""Part as a solid of triangles: STL for CAD and 3-D printing, coloured binary glTF for viewers and web pages.

STL: 3D Systems (1988), binary. glTF 2.0: Khronos, ISO/IEC 12113:2022, binary (GLB), in metres.
"""

import json
from typing import Any

import numpy as np

from ...io.stl import volume, write_stl
from ...units import LENGTHS, NONE, Units
from ..evaluate.profile import refined
from . import tabular

_EDGE_PIECES = 4  # number of straight pieces that replace the curved edge of an element


def solid(profile: Any, axisymmetric: bool, parts: int = 120) -> tuple[np.ndarray, np.ndarray]:
    """Return points (n, 3), length, and triangles (m, 3), seen from outside, of the surface of a sheet.

    It is revolved about z in `parts` strips, or in plane strain extruded along y over the width of the section.
    """
    line = _section(profile)[0]
    n = len(line)
    on_axis = np.abs(line[:, 0]) < 1e-9 * np.ptp(line)
    if axisymmetric:
        turn = np.linspace(0, 2 * np.pi, parts, endpoint=False)
        points = np.stack([np.outer(np.cos(turn), line[:, 0]), np.outer(np.sin(turn), line[:, 0]),
                           np.tile(line[:, 1], (parts, 1))], axis=-1)
    else:
        width = np.ptp(line[:, 0])
        points = np.stack([np.stack([line[:, 0], np.full(n, y), line[:, 1]], axis=-1) for y in (0.0, width)])
    number = np.arange(len(points) * n).reshape(len(points), n)
    if axisymmetric:
        number[:, on_axis] = number[0, on_axis]              # one point, for any angle
    start, end = (number, np.roll(number, -1, axis=0)) if axisymmetric else (number[:1], number[1:])
    a, b, c, d = start, np.roll(start, -1, axis=1), np.roll(end, -1, axis=1), end
    triangles = np.concatenate([np.stack(three, axis=-1).reshape(-1, 3) for three in ((a, b, c), (a, c, d))])
    if not axisymmetric:
        triangles = np.concatenate([triangles, *_ends(number)])
    triangles = triangles[[len(set(t)) == 3 for t in triangles.tolist()]]
    points = points.reshape(-1, 3)
    if volume(points, triangles) < 0:
        triangles = triangles[:, ::-1]
    return points, triangles


def _section(profile: Any) -> tuple[np.ndarray, np.ndarray]:
    """Return points (2 k, 2) round a section, and the positions of its first half, (k,), along the nodes.

    It runs along half of the start, the bottom and half of the end, and back along the upper half.
    """
    bottom, top = (refined(face, _EDGE_PIECES) for face in (profile.bottom, profile.top))
    (below, above), (under, over) = (
        (edge[1:len(edge) // 2], edge[-2:len(edge) // 2:-1]) if edge is not None else (bottom[:0], bottom[:0])
        for edge in (profile.start, profile.end))           # without the middle: halves of equal numbers
    last = len(profile.bottom) - 1
    faces = np.arange(0, last + 1e-9, 2 / _EDGE_PIECES)
    along = np.concatenate([np.zeros(len(below)), faces, np.full(len(under), last)])
    return np.vstack([below[::-1], bottom, under, over[::-1], top[::-1], above]), along


def coloured(profile: Any, axisymmetric: bool) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return points (n, 3), triangles (m, 3) of the surface, and wall over original thickness (n,)."""
    points, triangles = solid(profile, axisymmetric)
    ratio = np.interp(_section(profile)[1], np.arange(len(profile.bottom)), profile.wall_ratio)
    ratio = np.concatenate([ratio, ratio[::-1]])
    return points, triangles, np.tile(ratio, len(points) // len(ratio))


def to_stl(surface: tuple[np.ndarray, np.ndarray, np.ndarray], file: Any, comm: Any) -> None:
    """Write a surface (points, triangles, wall ratio) as .stl; InputError by ending, else OSError."""
    file = tabular.named("to_stl", file, ".stl")
    tabular.on_root(comm, lambda: write_stl(*surface[:2], file))


def to_gltf(surface: tuple[np.ndarray, np.ndarray, np.ndarray], file: Any, comm: Any, units: Units = NONE) -> None:
    """Write the surface of a part as a binary glTF file, coloured by the wall ratio (rank 0 writes).

    It is (points (n, 3), triangles (m, 3), ratios (n,)) in `units`; the file is in metres, its ending .glb.
    """
    from matplotlib import colormaps
    file = tabular.named("to_gltf", file, ".glb")
    points, triangles, ratio = surface
    shade = (ratio - ratio.min()) / (np.ptp(ratio) or 1.0)
    colours = colormaps["viridis_r"](shade)[:, :3]
    upright = LENGTHS[units.length or "m"] * points[:, [0, 2, 1]] * (1, 1, -1)              # glTF has y up
    arrays = [("POSITION", upright.astype("<f4"), 5126, 34962), ("COLOR_0", colours.astype("<f4"), 5126, 34962),
              ("indices", triangles.astype("<u4").ravel(), 5125, 34963)]
    data = b""
    views: list[dict] = []
    accessors: list[dict] = []
    for _, array, kind, target in arrays:
        views.append({"buffer": 0, "byteOffset": len(data), "byteLength": array.nbytes, "target": target})
        accessor = {"bufferView": len(accessors), "componentType": kind, "count": len(array),
                    "type": "VEC3" if array.ndim == 2 else "SCALAR"}
        accessors.append(accessor)
        data += array.tobytes()
    accessors[0] |= {"min": upright.min(0).astype("<f4").tolist(), "max": upright.max(0).astype("<f4").tolist()}
    shine = {"metallicFactor": 0.0, "roughnessFactor": 0.6}
    about = {"asset": {"version": "2.0", "generator": "formingx"}, "scene": 0, "scenes": [{"nodes": [0]}],
             "nodes": [{"mesh": 0}], "buffers": [{"byteLength": len(data)}], "bufferViews": views,
             "accessors": accessors, "materials": [{"doubleSided": True, "pbrMetallicRoughness": shine}],
             "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "COLOR_0": 1}, "indices": 2, "material": 0}]}]}
    text = json.dumps(about).encode()
    text += b" " * (-len(text) % 4)
    chunks = b"".join(np.array([len(part)], "<u4").tobytes() + kind + part for kind, part in
                      ((b"JSON", text), (b"BIN\0", data)))
    content = b"glTF" + np.array([2, 12 + len(chunks)], "<u4").tobytes() + chunks
    tabular.on_root(comm, lambda: tabular.replace(file, lambda stream: stream.write(content), "wb"))


def _ends(number: np.ndarray) -> list[np.ndarray]:
    """Return the triangles of both ends, (k, 3) each, with numbers (2, n) along bottom and back on top."""
    found = []
    for row, sense in ((number[0], 1), (number[1], -1)):
        half = len(row) // 2
        low, high = row[:half], row[:half - 1:-1]            # opposite each other
        quads = np.stack([low[:-1], high[:-1], high[1:], low[1:]], axis=-1)
        found += [quads[:, [0, 1, 2]][:, ::sense], quads[:, [0, 2, 3]][:, ::sense]]
    return found
