"""Ready-made shapes of rigid tools. The function `read` makes tools from files."""

import math
from typing import NamedTuple

import numpy as np

from ..errors import InputError, finite, non_negative, positive
from .files import read
from .pieces import TURN, Arc, Line
from .profile import Nearest, Tool

__all__ = ["Arc", "Line", "Nearest", "Pot", "Tool", "bottle", "clamp_ring", "cone", "cup", "cylinder", "male", "plane",
           "pot", "read", "sphere"]


def plane(z: float = 0.0) -> Tool:
    """Return the half-space above Z = z as a tool.

    Args:
        z: Z of the surface of the tool, length.

    >>> fx.tools.plane(5.0).signed_distance([[0.0, 4.0], [0.0, 7.0]]).tolist()          # below 0: outside
    [-1.0, 2.0]
    """
    z = finite("plane: z", z)
    return Tool([(0.0, z), (1.0, z)])


def cup(*, radius: float, depth: float, mouth: float = 0.0, draft: float = 0.0, fillet: float = 0.0,
        lip: float = 0.0) -> Tool:
    """Return a female mould that opens downwards: an axisymmetric cup, in plane strain half of a box section.

    Args:
        radius: radius of the mouth, or half width of a box section, length.
        depth: height of the floor above the mouth, length.
        mouth: Z of the mouth and of the flange around it, length.
        draft: draft angle between the wall and the Z axis, degrees; the floor is narrower than the mouth.
        fillet: radius of the edge between wall and floor, length.
        lip: radius of the edge between wall and flange, length.

    Raises:
        InputError: a length is not positive, an angle too large, or a fillet too large.

    >>> mould = fx.tools.cup(radius=30.0, depth=20.0, draft=5.0, fillet=3.0, lip=2.0)
    >>> mould.signed_distance([[0.0, 19.0]]).round(6).tolist()          # below 0: outside
    [-1.0]
    """
    radius, depth = positive("cup: radius", radius), positive("cup: depth", depth)
    mouth, floor = finite("cup: mouth", mouth), radius - depth * math.tan(_draft("cup", draft))
    if floor <= 0:
        raise InputError(f"cup: draft = {draft!r} degrees: leaves no floor at depth = {depth!r}; must be below"
                         f" {math.degrees(math.atan(radius / depth)):.4g}")
    top = mouth + depth
    fillet, lip = non_negative("cup: fillet", fillet), non_negative("cup: lip", lip)
    return Tool([(0.0, top), (floor, top), (radius, mouth), (2 * radius + lip, mouth)], [0.0, fillet, lip, 0.0])


def male(*, radius: float, height: float, base: float = 0.0, draft: float = 0.0, fillet: float = 0.0,
         foot: float = 0.0) -> Tool:
    """Return a male mould that points up, over which a sheet is draped.

    Args:
        radius: radius of the flat top, length.
        height: height of the top above the base plate, length.
        base: Z of the base plate, length.
        draft: draft angle between the wall and the Z axis, degrees; the base is wider than the top.
        fillet: radius of the edge around the top, length.
        foot: radius of the edge between wall and base plate, length.

    Raises:
        InputError: a length is not positive, or an angle or a fillet is too large.

    >>> mould = fx.tools.male(radius=30.0, height=20.0, fillet=3.0)
    >>> mould.signed_distance([[0.0, 25.0]]).tolist()          # below 0: outside
    [-5.0]
    """
    radius, height = positive("male: radius", radius), positive("male: height", height)
    base, wide = finite("male: base", base), radius + height * math.tan(_draft("male", draft))
    foot = non_negative("male: foot", foot)
    return Tool([(2 * wide + foot, base), (wide, base), (radius, base + height), (0.0, base + height)],
                [0.0, foot, non_negative("male: fillet", fillet), 0.0])


def bottle(*, radius: float, height: float, neck: float, shoulder: float, neck_height: float, base: float = 0.0,
           fillet: float = 0.0, shoulder_fillet: float = 0.0) -> Tool:
    """Return a bottle mould around a parison, open at the neck, which points up.

    Args:
        radius: radius of the body, length.
        height: height of the body, length.
        neck: radius of the neck, length.
        shoulder: height of the cone between body and neck, length.
        neck_height: height of the neck, length.
        base: Z of the bottom, length.
        fillet: radius of the bottom edge, length.
        shoulder_fillet: radius of both shoulder edges, length.

    Raises:
        InputError: a length is not positive, or the neck is not narrower than the body.

    >>> mould = fx.tools.bottle(radius=30.0, height=110.0, neck=12.0, shoulder=20.0, neck_height=20.0, fillet=5.0)
    >>> mould.signed_distance([[0.0, 60.0]]).tolist(), float(mould.bounds[1, 1])           # 150 mm high in all
    ([-30.0], 150.0)
    """
    radius, height = positive("bottle: radius", radius), positive("bottle: height", height)
    neck, shoulder = positive("bottle: neck", neck), positive("bottle: shoulder", shoulder)
    neck_height, base = positive("bottle: neck_height", neck_height), finite("bottle: base", base)
    if neck >= radius:
        raise InputError(f"bottle: neck = {neck!r}: must be below radius = {radius!r}")
    levels = base + height, base + height + shoulder, base + height + shoulder + neck_height
    round_ = non_negative("bottle: shoulder_fillet", shoulder_fillet)
    return Tool([(neck, levels[2]), (neck, levels[1]), (radius, levels[0]), (radius, base), (0.0, base)],
                [0.0, round_, round_, non_negative("bottle: fillet", fillet), 0.0])


def cylinder(*, radius: float, z: float = 0.0, fillet: float = 0.0) -> Tool:
    """Return a flat-ended plug that points down.

    Args:
        radius: radius of the plug, length.
        z: Z of the flat end, length.
        fillet: radius of the edge between flat end and shaft, length.

    Raises:
        InputError: the radius is not positive, or the fillet is too large.

    >>> plug = fx.tools.cylinder(radius=20.0, z=2.0, fillet=4.0)
    >>> plug.signed_distance([[0.0, 0.0], [25.0, 30.0]]).tolist()          # below 0: outside
    [-2.0, -5.0]
    """
    radius, z = positive("cylinder: radius", radius), finite("cylinder: z", z)
    return Tool([(0.0, z), (radius, z), (radius, z + 2 * radius)],
                [0.0, non_negative("cylinder: fillet", fillet), 0.0])


def cone(*, half_angle: float, z: float = 0.0, tip: float = 0.0, size: float = 1.0) -> Tool:
    """Return a cone that points down.

    Args:
        half_angle: angle between the surface and the Z axis, degrees, from 0.01 to below 90.
        z: Z of the lowest point of the cone, length.
        tip: radius of the rounded tip, length.
        size: length of the drawn surface; the cone itself has no end.

    Raises:
        InputError: the angle is outside its range.

    >>> plug = fx.tools.cone(half_angle=30.0, z=1.0)
    >>> plug.signed_distance([[0.0, 0.0]]).tolist()          # below 0: outside
    [-1.0]
    """
    a = math.radians(positive("cone: half_angle", half_angle))
    if a >= math.pi / 2:
        raise InputError(f"cone: half_angle = {half_angle!r}: must be below 90 degrees")
    if half_angle < 0.01:
        raise InputError(f"cone: half_angle = {half_angle!r}: must be at least 0.01 degrees")
    tip, size, z = non_negative("cone: tip", tip), positive("cone: size", size), finite("cone: z", z)
    size = max(size, 4 * tip)
    apex = z - tip * (1 / math.sin(a) - 1)
    return Tool([(0.0, apex), (size * math.sin(a), apex + size * math.cos(a))], [tip, 0.0])


def sphere(*, radius: float, z: float = 0.0, r: float = 0.0) -> Tool:
    """Return a ball (axisymmetric, r = 0) or a round bar (plane strain).

    Args:
        radius: radius of the ball or bar, length.
        z: Z of the lowest point, length.
        r: R of the lowest point, length.

    Raises:
        InputError: the radius is not positive.

    >>> fx.tools.sphere(radius=10.0, z=5.0).signed_distance([[0.0, 4.0], [0.0, 6.0]]).tolist()   # below 0: outside
    [-1.0, 1.0]
    """
    radius = positive("sphere: radius", radius)
    centre = np.array([finite("sphere: r", r), finite("sphere: z", z) + radius])
    return Tool.of_pieces([Arc(centre, radius, -math.pi / 2, TURN)], closed=True)


class Pot(NamedTuple):
    """Tools of a tapered cup.

    Attributes:
        mould: female mould above the sheet.
        plug: plug below the sheet.
    """

    mould: Tool
    plug: Tool


def clamp_ring(*, radius: float, width: float, fillet: float, z: float = 0.0, height: float | None = None) -> Tool:
    """Return the upper ring of a clamp, with its flat face at Z = z and rounded inner edges.

    The lower ring is `clamp_ring(...).mirrored()`. The sheet may become thinner between the rings, and it leaves them
    over rounded edges. So this clamp has no singular corner. Support the rim of the sheet between the rings by
    `SimplySupported`.

    Args:
        radius: radius of the opening, length.
        width: radial width of the ring, larger than the fillet, length.
        fillet: radius of the edges, length.
        z: position of the flat face, length.
        height: height of the ring, at least two fillets (the default), length.

    Raises:
        InputError: a length is not positive, or the fillets do not fit on the ring.

    >>> ring = fx.tools.clamp_ring(radius=50.0, width=20.0, fillet=2.0)
    >>> ring.signed_distance([[60.0, -1.0]]).tolist()          # below 0: outside
    [-1.0]
    """
    radius, z = positive("clamp_ring: radius", radius), finite("clamp_ring: z", z)
    fillet, width = positive("clamp_ring: fillet", fillet), positive("clamp_ring: width", width)
    height = 2 * fillet if height is None else positive("clamp_ring: height", height)
    outer, top = radius + width, z + height
    return Tool([(outer, top), (radius, top), (radius, z), (outer, z)], [0.0, fillet, fillet, 0.0])


def pot(*, mouth: float, base: float, depth: float, sheet: float, fillet: float, lip: float = 0.0,
        plug: float | None = None, nose: float | None = None) -> Pot:
    """Return mould and plug of a tapered cup, which is formed upwards.

    The sheet lies on Z from 0 to its thickness, as made by `mesh.disc`. The mould opens downwards onto the top of the
    sheet. The plug points up and touches the bottom face of the sheet. Its contact needs `direction=(0, 1)`.

    Args:
        mouth: radius of the cup at its mouth, length.
        base: radius of the cup at its base, at most `mouth`, length.
        depth: distance between mouth and base, length.
        sheet: thickness of the sheet, length.
        fillet: radius of the edge between wall and base, length.
        lip: radius of the edge between wall and flange, length.
        plug: radius of the flat-ended plug, smaller than the base, length; default 0.8 of the base.
        nose: radius of the plug's rounded edge, at most its radius (a ball), length; default half of it.

    Returns:
        The mould and the plug.

    Raises:
        InputError: a length is not positive, the base is wider than the mouth, or the plug as wide as the base. A
            fillet does not fit.

    >>> tools = fx.tools.pot(mouth=40.0, base=25.0, depth=70.0, sheet=1.2, fillet=4.0)
    >>> tools.mould.bounds.round(6).tolist()
    [[0.0, 1.2], [80.0, 71.2]]
    """
    mouth, base, depth = positive("pot: mouth", mouth), positive("pot: base", base), positive("pot: depth", depth)
    sheet = positive("pot: sheet", sheet)
    if base > mouth:
        raise InputError(f"pot: base = {base:g}: must not be wider than mouth = {mouth:g}")
    radius = 0.8 * base if plug is None else positive("pot: plug", plug)
    if radius >= base:
        raise InputError(f"pot: plug = {plug!r}: must be below base = {base:g}")
    edge = radius / 2 if nose is None else positive("pot: nose", nose)
    if edge > radius:
        raise InputError(f"pot: nose = {nose!r}: must not be above the plug's radius, {radius:g}")
    mould = cup(radius=mouth, depth=depth, mouth=sheet, draft=math.degrees(math.atan((mouth - base) / depth)),
                fillet=fillet, lip=lip)
    below = 2 * depth + edge                               # the plug's shaft, longer than it travels
    return Pot(mould, Tool([(radius, -below), (radius, 0.0), (0.0, 0.0)], [0.0, edge, 0.0]))


def _draft(shape: str, draft: float) -> float:
    """Return the draft angle in radians, from degrees; InputError unless it is from 0 to below 90."""
    angle = non_negative(f"{shape}: draft", draft)
    if angle >= 90:
        raise InputError(f"{shape}: draft = {draft!r}: must be below 90 degrees")
    return math.radians(angle)
