"""Check of the tags of a DXF drawing: are its curves complete?

In place of a missing tag ezdxf assumes a default, such as (0, 0) for an end point. It also skips unknown tags. So a
damaged curve would be read without an error.
"""

from collections import Counter
from pathlib import Path

from ..io.numerals import number, whole

_NEEDED = {"LINE": (10, 20, 11, 21), "ARC": (10, 20, 40, 50, 51), "CIRCLE": (10, 20, 40), "VERTEX": (10, 20),
           "ELLIPSE": (10, 20, 11, 21, 40, 41, 42), "LWPOLYLINE": (), "POLYLINE": (), "SPLINE": (), "SEQEND": ()}
"""{curve: group codes that occur once}."""
_COUNTED: dict[str, dict[int, tuple[int, ...]]] = {
    "LWPOLYLINE": {90: (10, 20)}, "SPLINE": {72: (40,), 73: (10, 20), 74: (11, 21)}}
"""{curve: {group code of a count: codes whose occurrences it counts}}."""
_LETTERING = ("ACAD_PROXY_ENTITY", "ACAD_TABLE", "ARC_DIMENSION", "ATTDEF", "ATTRIB", "CAMERA", "DGNUNDERLAY",
              "DIMENSION", "DWFUNDERLAY", "GEOPOSITIONMARKER", "HATCH", "IMAGE", "LARGE_RADIAL_DIMENSION", "LEADER",
              "LIGHT", "MPOLYGON", "MTEXT", "MULTILEADER", "OLE2FRAME", "OLEFRAME", "PDFUNDERLAY", "POINT", "SHAPE",
              "SOLID", "TEXT", "TOLERANCE", "TRACE", "VIEWPORT", "WIPEOUT")
"""Entities of a drawing other than curves."""


def check(file: str, others: tuple[str, ...]) -> Counter:
    """Check that every curve of a drawing has all its data, and return {kind, such as "LINE": number of curves}.

    `others` are kinds that are not examined. A damaged drawing or an unknown kind is a ValueError with the line.
    """
    data = Path(file).read_bytes()
    if data.startswith(b"AutoCAD Binary DXF"):
        raise ValueError("it is binary: save it as text")
    lines = [line.strip() for line in data.decode("latin-1").rstrip().split("\n")]
    section, kinds, entity = "", Counter[str](), list[tuple[int, str]]()
    kind, last = "", ""
    for n in range(0, len(lines), 2):
        try:
            code = whole(lines[n])
        except ValueError:
            raise ValueError(f"line {n + 1}: {lines[n][:40]!r} is no group code") from None
        if n + 1 == len(lines):
            raise ValueError("it ends within a tag")
        value = lines[n + 1]
        if 10 <= code <= 59 and section == "ENTITIES" and kind in _NEEDED:
            try:
                number(value)
            except ValueError as error:
                raise ValueError(f"line {n + 2}: {error}") from None
        if code != 0:
            section = value if kind == "SECTION" and code == 2 else section
            entity.append((code, value))
            continue
        if section == "ENTITIES" and kind not in ("", "SECTION"):
            _check_entity(kind, entity, n, others)
            kinds[kind] += kind in _NEEDED
        kind, entity, last = value, [], value
        section = "" if value == "ENDSEC" else section
    if last != "EOF":
        raise ValueError("it has no end: it was cut off")
    return kinds


def _check_entity(kind: str, tags: list[tuple[int, str]], line: int, others: tuple[str, ...]) -> None:
    """Raise a ValueError with the line if an entity has an unknown kind, or a tag is missing or occurs twice.

    Tags are (group code, value); `others` are kinds that are not examined.
    """
    where = f"the {kind} that ends before line {line + 1}"
    if kind not in _NEEDED:
        if kind not in _LETTERING and kind not in others:
            raise ValueError(f"{where}: an unknown kind of entity")
        return
    counts = Counter(code for code, _ in tags)
    wrong = [code for code in _NEEDED[kind] if counts[code] != 1]
    if wrong:
        raise ValueError(f"{where}: has {counts[wrong[0]]} values of group code {wrong[0]}, must have one")
    for code, counted in _COUNTED.get(kind, {}).items():
        found = [value for c, value in tags if c == code]
        if len(found) > 1 or not found and code != 74:
            raise ValueError(f"{where}: has {len(found)} counts of group code {code}, must have one")
        for other in counted:
            if counts[other] != whole((found or ["0"])[0]):
                raise ValueError(f"{where}: announces {(found or ['0'])[0]} and has {counts[other]} values of group"
                                 f" code {other}")
