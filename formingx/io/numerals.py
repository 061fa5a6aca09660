"""Numbers in files: decimal digits, a point, an exponent. Other forms that Python accepts are refused."""

import re

_WHOLE = r"[+-]?[0-9]+"
_NUMBER = re.compile(rf"(?:{_WHOLE}(?:\.[0-9]*)?|[+-]?\.[0-9]+)(?:[eE]{_WHOLE})?|[+-]?(?:nan|inf|infinity)",
                     re.IGNORECASE)


def is_number(word: str) -> bool:
    """Return True if a word is a number, "nan" and "inf" included."""
    return _NUMBER.fullmatch(word) is not None


def number(word: str) -> float:
    """Return a word as a number.

    Raises:
        ValueError: the word is not a number.
    """
    if not is_number(word):
        raise ValueError(f"{word[:40]!r} is not a number")
    return float(word)


def whole(word: str) -> int:
    """Return a word as an integer.

    Raises:
        ValueError: the word is not an integer, or has more than 18 digits.
    """
    if not re.fullmatch(r"[+-]?[0-9]{1,18}", word):
        raise ValueError(f"{word[:40]!r} is not a whole number")
    return int(word)
