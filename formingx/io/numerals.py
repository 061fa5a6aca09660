"""Numbers in text files: decimal digits, a point, an exponent.

Other forms that Python accepts, such as "1_000", are refused.
"""

import re

_WHOLE = r"[+-]?[0-9]+"
_NUMBER = re.compile(rf"(?:{_WHOLE}(?:\.[0-9]*)?|[+-]?\.[0-9]+)(?:[eE]{_WHOLE})?|[+-]?(?:nan|inf|infinity)",
                     re.IGNORECASE)


def is_number(word: str) -> bool:
    """Return True if a word is decimal digits with a point and an exponent, "nan" or "inf"."""
    return _NUMBER.fullmatch(word) is not None


def number(word: str) -> float:
    """Return the number of a word, such as "1.5e-3"; otherwise a ValueError."""
    if not is_number(word):
        raise ValueError(f"{word[:40]!r} is not a number")
    return float(word)


def whole(word: str) -> int:
    """Return the integer of a word of at most 18 digits, such as "-12"; otherwise a ValueError."""
    if not re.fullmatch(r"[+-]?[0-9]{1,18}", word):
        raise ValueError(f"{word[:40]!r} is not a whole number")
    return int(word)
