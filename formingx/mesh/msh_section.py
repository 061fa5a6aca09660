"""Reader of the numbers in a section of a gmsh mesh file, text or binary."""

import re
from collections.abc import Sequence

import numpy as np

from ..errors import InputError


class Section:
    """Reader of the numbers in a section of a gmsh file.

    The byte order is "<" or ">", and a count has a width of 4 or 8 bytes. Messages have the name `where`.
    """

    def __init__(self, body: bytes, binary: bool, order: str, width: int, where: str):
        self._binary, self._order, self._width, self.where = binary, order, width, where
        self._body, self._offset = body, 0
        if not binary:
            try:
                if re.search(rb"[^\s+\-.0-9a-zA-Z]", body):      # NumPy takes 1_0 for a number
                    raise ValueError("a character that is not part of a number")
                self._values = np.array(body.split(), dtype=float)
            except ValueError as error:
                raise InputError(f"{where}: {error}: must be numbers") from None

    @property
    def binary(self) -> bool:
        """True if the file is binary."""
        return self._binary

    def line(self) -> int:
        """Return the count on the next line, at the start of a binary MSH 2.2 section, else an InputError."""
        end = self._body.find(b"\n", self._offset)
        word = self._body[self._offset:end].strip()
        if end < 0 or not word.isdigit() or len(word) > 15:
            raise InputError(f"{self.where}: must begin with a count")
        self._offset = end + 1
        return int(word)

    def reals(self, n: int) -> np.ndarray:
        """Return the next n numbers of the section as floats, shape (n,), eight bytes each in a binary file."""
        return self._take(n, "f8")

    def ints(self, n: int) -> np.ndarray:
        """Return the next n numbers of the section, integers of four bytes in a binary file, shape (n,)."""
        return self.whole(self._take(n, "i4"))

    def int_list(self, n: int) -> list[int]:
        """Return the next n numbers of the section as a list; in a binary file they are integers of four bytes."""
        return [int(value) for value in self.ints(n)]

    def sizes(self, n: int) -> np.ndarray:
        """Return the next n counts or numbers of nodes or elements, shape (n,); `width` bytes each in a binary file."""
        return self.whole(self._take(n, f"u{self._width}"))

    def end(self) -> None:
        """Raise an InputError if numbers of the section were left over."""
        remaining = len(self._body[self._offset:].strip()) if self._binary else len(self._values) - self._offset
        if remaining:
            raise InputError(f"{self.where}: {remaining} more {'bytes' if self._binary else 'numbers'} follow what its"
                             f" counts announce")

    def records(self, n: int, fields: list) -> np.ndarray:
        """Return the next n records of a binary section, shape (n,), of fields (name, type, shape)."""
        return self._bytes(n, np.dtype([(name, self._order + kind, shape) for name, kind, shape in fields]))

    def _take(self, n: int, kind: str) -> np.ndarray:
        """Return the next n numbers of a type, such as "f8", (n,), floats in text; too few are an InputError."""
        if self._binary:
            return self._bytes(n, np.dtype(self._order + kind))
        if n > len(self._values) - self._offset:
            raise InputError(f"{self.where}: ends too early: {n} more numbers must follow")
        self._offset += n
        return self._values[self._offset - n:self._offset]

    def _bytes(self, n: int, kind: np.dtype) -> np.ndarray:
        """Return the next n binary numbers or records of a type, (n,); too short a section is an InputError."""
        if n * kind.itemsize > len(self._body) - self._offset:
            raise InputError(f"{self.where}: ends too early: {n} more numbers must follow")
        found = np.frombuffer(self._body, kind, n, self._offset)
        self._offset += n * kind.itemsize
        return found

    def whole(self, values: np.ndarray) -> np.ndarray:
        """Return floats with integral values as integers, of the same shape. Any other number is an InputError."""
        with np.errstate(invalid="ignore"):
            whole = np.abs(values) < 2.0**53
            found = np.where(whole, values, 0).astype(np.int64)
        if not np.all(whole) or np.any(found != values):
            raise InputError(f"{self.where}: a whole number was expected")
        return found


def checked_count(found: Sequence[int] | np.ndarray, section: Section) -> int:
    """Return the first of the numbers `found` as a count of items; InputError if negative or too large."""
    n = int(found[0])
    if not 0 <= n < 2**40:
        raise InputError(f"{section.where}: a count is {n}")
    return n


def checked_dimension(dim: int, section: Section) -> int:
    """Return the dimension `dim` of an entity; InputError unless it is between 0 and 3."""
    if not 0 <= dim <= 3:
        raise InputError(f"{section.where}: a dimension is {dim}")
    return dim
