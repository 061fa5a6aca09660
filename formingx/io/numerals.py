"""Numbers in text files: decimal digits, a point, an exponent.

Other forms that Python accepts, such as "1_000", are refused.
"""

import re

_WHOLE = r"[+-]?[0-9]+"
_NUMBER = re.compile(rf"(?:{_WHOLE}(?:\.[0-9]*)?|[+-]?\.[0-9]+)(?:[eE]{_WHOLE})?|[+-]?(?:nan|inf|infinity)",
                     re.IGNORECASE)


def is_number(word: str) -> bool:
    """Return True if a text is a number: decimal digits with a point and an exponent, "nan" or "inf".

    Args:
        word: text without spaces.
    """
    return _NUMBER.fullmatch(word) is not None


def number(word: str) -> float:
    """Return the number that a text stands for.

    Args:
        word: text without spaces, such as "1.5e-3".

    Raises:
        ValueError: the text is not a number.
    """
    if not is_number(word):
        raise ValueError(f"{word[:40]!r} is not a number")
    return float(word)


def whole(word: str) -> int:
    """Return the integer that a text stands for.

    Args:
        word: text without spaces, such as "-12".

    Raises:
        ValueError: the text is not an integer, or has more than 18 digits.
    """
    if not re.fullmatch(r"[+-]?[0-9]{1,18}", word):
        raise ValueError(f"{word[:40]!r} is not a whole number")
    return int(word)
