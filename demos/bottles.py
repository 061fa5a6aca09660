"""Square bottle, parison and card that the demos of bottles in three dimensions share. Lengths in mm, stresses in MPa.

The mould is 70 mm by 70 mm wide and 180 mm high: a body with vertical edges of radius 12 mm, a base with a fillet of 10
mm, a shoulder from a height of 134 mm to 160 mm, and a round neck of radius 17 mm. The parison has a middle surface of
radius 16 mm and a wall of 2.5 mm. The card of the material is invented: it relaxes like a polyethylene melt for blow
moulding.
"""

from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from common import COMM, save
from matplotlib.image import imread

import formingx as fx
from formingx import figures

RADIUS, WALL, HEIGHT, HALF, EDGE, NECK = 16.0, 2.5, 180.0, 35.0, 12.0, 17.0
SHOULDER, PROFILE_FILLETS = [(0.0, -16.0), (10.0, -16.0), (HALF, -46.0)], [0.0, 0.0, 12.0, 10.0, 0.0]
MID_HEIGHT, DENSITY, HOLD = -HEIGHT / 2, 0.95, 0.6
UNITS = fx.Units(length="mm", stress="MPa", time="s")
CARD = fx.Viscoelastic(fx.NeoHookean(c10=0.004), [(0.08, 0.3), (0.03, 3.0)])                  # invented
SECTION = (2 * HALF) ** 2 - (4 - np.pi) * EDGE**2                                            # area of the body, mm2


def mould():
    """Return the mould of the square bottle, whose mouth is at z = 0 and whose base is at z = -180."""
    profile = fx.Tool([*SHOULDER, (HALF, -HEIGHT), (0.0, -HEIGHT)], PROFILE_FILLETS)
    body = fx.tools.swept(profile, half=(HALF, HALF), corner=EDGE)
    neck = fx.tools.revolved(fx.Tool([(NECK, 10.0), (NECK, -60.0), (0.0, -60.0)]))
    return fx.tools.intersection(body, neck, fillet=4.0)


def graded(divisions, place, width, low, high):
    """Return places from `low` to `high` that are three times as dense at `place` as far from it, by its width."""
    x = np.linspace(low, high, 2001)
    density = 1 + 2 * np.exp(-(((x - place) / width) ** 2))
    s = np.concatenate([[0.0], np.cumsum((density[1:] + density[:-1]) / 2)])
    return np.interp(np.linspace(0.0, s[-1], divisions + 1), s, x)


def symmetries(mesh):
    """Return the supports of the cuts of a half or a quarter."""
    return [fx.Symmetry(name, name[0]) for name in ("x0", "y0") if name in mesh.boundaries]


def walls_at(wall, z, edge=8.0):
    """Return the wall in the middle of a face and at the vertical edge in the section at a height z.

    The edge is the mean within `edge` degrees of the diagonal.
    """
    found = wall.section((0, 0, z), (0, 0, 1))
    angle = np.degrees(np.arctan2(np.abs(found["y"]), np.abs(found["x"])))
    order = np.argsort(angle)
    h, angle = found["wall"][order], angle[order]
    at = np.linspace(45 - edge, 45 + edge, 33)
    return {"middle_of_face_mm": float(h[[0, -1]].mean()), "edge_mm": float(np.interp(at, angle, h).mean())}


def wall_area(wall, z):
    """Return the area of the wall in the modelled part of the section at a height z, mm2."""
    found = wall.section((0, 0, z), (0, 0, 1))
    h = found["wall"]
    return float(np.sum(np.diff(found["arc_length"]) * (h[1:] + h[:-1]) / 2))


def without_border(picture):
    """Return a picture, shape (rows, columns, channels), without its white border."""
    ink = (picture[..., :3] < 0.98).any(2)
    rows, columns = np.flatnonzero(ink.any(1)), np.flatnonzero(ink.any(0))
    return picture[rows[0]: rows[-1] + 1, columns[0]: columns[-1] + 1]


def draw_states(path, states, file, grid=None, curves=None):
    """Draw the whole body in some states side by side, with the wall over the original one.

    Args:
        path: the path.
        states: {title: state}.
        file: the picture.
        grid: size of printed squares, or None.
        curves: function that draws curves into one more plot on the left, or None.
    """
    with TemporaryDirectory() as folder:
        pictures = []
        for k, state in enumerate(states.values()):
            path.view3d(Path(folder) / f"{k}.png", state, grid=grid)
            pictures.append(Path(folder) / f"{k}.png")
        if COMM.rank == 0:
            figure, axes = figures.figure(len(states) + bool(curves), width=4.6)
            if curves:
                curves(axes[0])
            for axis, title, picture in zip(axes[bool(curves):], states, pictures):
                axis.imshow(without_border(imread(picture)))
                axis.set_title(title)
                axis.axis("off")
            save(figure, file)
