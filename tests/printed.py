"""What a page shows of what its code prints: words as they are, numbers to the digits shown, "..." for anything."""

import re

NUMBER = r"-?\d+(?:\.\d*)?(?:e[-+]?\d+)?"


def digit(number):
    """One in the last digit of a number as it is written; 0 of one that counts."""
    if number.lstrip("-").isdigit():
        return 0.0
    mantissa, _, exponent = number.partition("e")
    return 10.0 ** (int(exponent or 0) - len(mantissa.partition(".")[2]))


def assert_shows(shown, printed, rel=0.0):
    """Numbers may differ by one in the last digit shown, or by `rel` if that is more."""
    pieces = re.split(rf"({NUMBER}|\.\.\.|\s+)", shown.strip())
    first, *parts = "".join(rf"({NUMBER})" if re.fullmatch(NUMBER, piece) else "\0" if piece == "..." else
                            r"\s+" if piece.isspace() else re.escape(piece) for piece in pieces).split("\0")
    middle, last = parts[:-1], parts[-1:]                       # atomic: one way to fill each "..." is tried
    pattern = first + "".join(rf"(?>.*?{part})" for part in middle) + "".join(rf".*?{part}" for part in last)
    found = re.fullmatch(pattern, printed.strip(), re.S)
    assert found, f"shown:\n{shown}\nprinted:\n{printed}"
    wanted = [piece for piece in pieces if re.fullmatch(NUMBER, piece)]
    off = [(a, b) for a, b in zip(wanted, found.groups(), strict=True)
           if abs(float(a) - float(b)) > 1.001 * max(digit(a), rel * abs(float(a)))]
    assert not off, f"(shown, printed): {off}"
