"""Curves in a gmsh script (.geo) that is a plain drawing.

gmsh would execute a .geo file, system commands included. So the script is not passed to gmsh. This module reads points,
lines, circles and named numbers. Loops, surfaces, physical groups and mesh sizes are skipped, because a tool does not
need them. Any other statement is refused.
"""

import ast
import math
import operator
import os
import re
from collections.abc import Iterator
from typing import Any

import numpy as np

from ..errors import InputError
from ..io.numerals import is_number
from .pieces import Arc, Line

_OPERATORS: dict[type, Any] = {
    ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul, ast.Div: operator.truediv,
    ast.Pow: operator.pow, ast.USub: operator.neg, ast.UAdd: operator.pos}
_FUNCTIONS: dict[str, Any] = {"Sqrt": math.sqrt, "Sin": math.sin, "Cos": math.cos, "Tan": math.tan, "Fabs": abs}
_NUMBER = re.compile(r"[A-Za-z_]\w*")
_ENTITY = re.compile(r"(Point|Line|Circle|Ellipse|Spline|BSpline|Bezier)\s*\(([^(){}]*)\)\s*=\s*\{([^{}]*)\}")
_PASSED_OVER = re.compile(r"(?:(?:Curve|Line) Loop|Plane Surface|Surface|Ruled Surface"
                          r"|Physical (?:Point|Curve|Line|Surface))"
                          r"\s*\([^{}]*\)\s*\+?=\s*\{[^{}]*\}"
                          r"|(?:MeshSize|Characteristic Length)\s*\{[^{}]*\}\s*=\s*[^{}\"]*"
                          r"|Mesh\.\w+\s*=\s*[^{}\"]*|SetFactory\s*\(\s*\"(?:Built-in|OpenCASCADE)\"\s*\)")
_ALLOWED = ("points, lines, circles, loops, surfaces, physical groups, mesh sizes and numbers with a name,"
            " because a .geo file is a script and nothing in it is run: export anything else as .step or .brep")


def curves(file: str | os.PathLike) -> dict[int, Line | Arc | str]:
    """Return {curve: line, arc, or kind, as "Spline"} of a .geo file; what it cannot read is an InputError."""
    file = os.fspath(file)
    try:
        with open(file, encoding="utf-8") as stream:
            text = stream.read()
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"tool file {file!r} cannot be read: {error}") from None
    drawing, text = _Drawing(), _without_remarks(text)
    for line, statement in _statements(text):
        try:
            drawing.add(statement)
        except (ValueError, ArithmeticError, KeyError, TypeError, RecursionError, MemoryError, SyntaxError) as error:
            raise InputError(f"tool file {file!r} cannot be read: line {line}: {statement[:60]!r}: {error}") from None
    if text.strip() and not text.rstrip().endswith(";"):
        raise InputError(f"tool file {file!r} cannot be read: its last statement does not end in a semicolon")
    return drawing.curves


class _Drawing:
    """Points, curves and named numbers of a gmsh script (.geo); `add` reads one statement.

    Attributes:
        values: {name: number}.
        points: {number of a point: (x, y), shape (2,), length}.
        curves: {number of a curve: line or arc, or the kind of another curve, such as "Spline"}.
    """

    def __init__(self) -> None:
        self.values: dict[str, float] = {"Pi": math.pi}
        self.points: dict[int, np.ndarray] = {}
        self.curves: dict[int, Line | Arc | str] = {}

    def add(self, statement: str) -> None:
        """Add the point, curve or named number of a gmsh statement; an unsupported one is a ValueError."""
        if entity := _ENTITY.fullmatch(statement):
            kind, tag, numbers = entity[1], self._number(entity[2]), [self._number(n) for n in entity[3].split(",")]
            if kind in ("Point", "Line", "Circle"):
                getattr(self, f"_add_{kind.lower()}")(self._tag(tag), numbers)
            else:
                self._add_curve(self._tag(tag), kind)
        elif _PASSED_OVER.fullmatch(statement):
            return
        else:
            name, equals, value = statement.partition("=")
            if not equals or not _NUMBER.fullmatch(name.strip()):
                raise ValueError(f"is not allowed: a tool's .geo file may hold {_ALLOWED}")
            self.values[name.strip()] = self._number(value)

    def _add_point(self, tag: int, numbers: list[float]) -> None:
        """Add point `tag` at (x, y, 0[, mesh size]), length; another plane or a used number is a ValueError."""
        if len(numbers) not in (3, 4) or numbers[2] != 0 or not all(map(math.isfinite, numbers)):
            raise ValueError("a point must be {x, y, 0} or {x, y, 0, mesh size}, finite numbers")
        if tag in self.points:
            raise ValueError(f"a second point {tag}")
        self.points[tag] = np.array(numbers[:2])

    def _add_line(self, tag: int, numbers: list[float]) -> None:
        """Add line `tag` between two point numbers; ValueError if there are others or the tag is used."""
        if len(numbers) != 2:
            raise ValueError("a line must be {first point, last point}")
        self._add_curve(tag, Line(*(self._point(n) for n in numbers)))

    def _add_circle(self, tag: int, numbers: list[float]) -> None:
        """Add the circular arc `tag`.

        Below 180 degrees it has the numbers of first end, centre and last end; any arc may have (x, y, 0, radius[,
        first, last angle]), length and radians. Other numbers are a ValueError.
        """
        if len(numbers) == 3:
            first, centre, last = (self._point(n) for n in numbers)
            (a, begin), (b, end) = ((math.dist(p, centre), math.atan2(*(p - centre)[::-1])) for p in (first, last))
            if not a > 0 or abs(a - b) > 1e-9 * a:
                raise ValueError(f"the ends are {a:.6g} and {b:.6g} away from the centre: must be the same")
            sweep = math.remainder(end - begin, 2 * math.pi)
            self._add_curve(tag, Arc(centre, a, begin, sweep))
        elif len(numbers) in (4, 6):
            x, y, z, radius, begin, end = [*numbers, 0.0, 2 * math.pi][:6] if len(numbers) == 4 else numbers
            if z != 0 or not radius > 0:
                raise ValueError("a circle must be {x, y, 0, radius > 0, first angle, last angle}")
            self._add_curve(tag, Arc(np.array([x, y]), radius, begin, end - begin))
        else:
            raise ValueError("a circle must be {first point, centre, last point}")

    def _add_curve(self, tag: int, piece: Line | Arc | str) -> None:
        """Add a line, arc, or kind such as "Spline" with a tag; ValueError if it is used."""
        if tag in self.curves:
            raise ValueError(f"a second curve {tag}")
        self.curves[tag] = piece

    def _point(self, number: float) -> np.ndarray:
        """Return point `number` (x, y), shape (2,), length; ValueError if there is none."""
        tag = self._tag(number)
        if tag not in self.points:
            raise ValueError(f"there is no point {tag}")
        return self.points[tag]

    @staticmethod
    def _tag(number: float) -> int:
        """Return the number of a point or curve as a positive integer; otherwise a ValueError."""
        if number != int(number) or number < 1:
            raise ValueError(f"{number:g} is no number of a point or curve")
        return int(number)

    def _number(self, text: str) -> float:
        """Return the value of numbers, names, functions and + - * / ^; anything else is a ValueError."""
        words = re.findall(r"(?<![\w.])[0-9.][\w.]*", text)            # Python takes 1_0, 0x10 and 1j for numbers
        if len(text) > 1000 or "**" in text or not re.fullmatch(r"[\w\s.+\-*/^()]*", text, re.ASCII) or not all(
                is_number(word.removesuffix("e").removesuffix("E")) for word in words):
            raise ValueError(f"{text.strip()[:40]!r} is not a number")
        return float(self._value(ast.parse(text.strip().replace("^", "**"), mode="eval").body))

    def _value(self, node: ast.expr) -> float:
        """Return the value of a syntax node: a number, known name or operation; another is a ValueError."""
        if isinstance(node, ast.Constant) and isinstance(node.value, int | float) and not isinstance(node.value, bool):
            return float(node.value)
        if isinstance(node, ast.Name) and node.id in self.values:
            return self.values[node.id]
        if isinstance(node, ast.BinOp) and type(node.op) in _OPERATORS:
            return _real(_OPERATORS[type(node.op)](self._value(node.left), self._value(node.right)))
        if isinstance(node, ast.UnaryOp) and type(node.op) in _OPERATORS:
            return _OPERATORS[type(node.op)](self._value(node.operand))
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in _FUNCTIONS \
                and len(node.args) == 1 and not node.keywords:
            return _FUNCTIONS[node.func.id](self._value(node.args[0]))
        raise ValueError(f"{ast.unparse(node)[:40]!r} is not a number, nor a name that was given one")


def _real(value: Any) -> float:
    """Return the result of an operation as a float; ValueError if it is complex."""
    if isinstance(value, complex):
        raise ValueError("a root of a negative number")
    return value


def _without_remarks(text: str) -> str:
    """Return the text of a script with its comments replaced by spaces, so that lines keep their numbers."""
    return re.sub(r"//[^\n]*|/\*.*?\*/", lambda found: re.sub(r"[^\n]", " ", found[0]), text, flags=re.DOTALL)


def _statements(text: str) -> Iterator[tuple[int, str]]:
    """Yield (number of the first line, text without the semicolon) of each statement of a script without comments."""
    line = 1
    for part in text.split(";"):
        begin = line + part[: len(part) - len(part.lstrip())].count("\n")
        line += part.count("\n")
        if part.strip():
            yield begin, " ".join(part.split())
