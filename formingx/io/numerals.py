"""Numbers as files write them: decimal digits, a point, an exponent; nothing else that Python takes for a number."""

import re

_WHOLE = r"[+-]?[0-9]+"
_NUMBER = re.compile(rf"(?:{_WHOLE}(?:\.[0-9]*)?|[+-]?\.[0-9]+)(?:[eE]{_WHOLE})?|[+-]?(?:nan|inf|infinity)",
                     re.IGNORECASE)


def is_number(word: str) -> bool:
    """Return True if a word is a number, "nan" and "inf" among them."""
    return _NUMBER.fullmatch(word) is not None


def number(word: str) -> float:
    """Return the number; a ValueError unless the word is one."""
    if not is_number(word):
        raise ValueError(f"{word[:40]!r} is not a number")
    return float(word)


def whole(word: str) -> int:
    """Return the whole number; a ValueError unless the word is one, of at most 18 digits."""
    if not re.fullmatch(r"[+-]?[0-9]{1,18}", word):
        raise ValueError(f"{word[:40]!r} is not a whole number")
    return int(word)
