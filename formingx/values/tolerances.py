"""Numbers that many files share: round-off, a number for infinity, difference quotients, and levels of error."""

FAR = 1e30
"""A number that stands for infinity, finite so that its product with 0 is 0, and so are its square and its root."""

ROUND_OFF = 1e-9
"""Relative difference below which two coordinates, directions or targets are equal.

Sums of thousands of numbers of 16 digits, and numbers that were printed with 10 digits, differ by less.
"""

CURVE_POINTS = 2000
"""Number of points that stand for any smooth curve: lines between them miss a full circle by 1e-6 of its radius."""

PIECE_POINTS = 33
"""Number of points on a parabola, among which the largest value is too low by at most 0.1 % of its height."""

EXAMINED_STATES = 12
"""Number of states of a run, evenly spaced, whose errors are estimated."""

DIFFERENCE_STEP = 1e-5
"""Relative step to either side of a central difference quotient.

It is about the cube root of the relative round-off 1e-16: truncation and round-off then contribute equal errors.
"""

NEGLIGIBLE = 1e-3
"""Part of a length, an area, a force, a stiffness or a mass that findings, checks of states and steps, and searches
leave out of account."""

NOTICEABLE = 5e-3
"""Relative error of an integral (volume, energy) of a finished run from which a finding reports it."""

WALL_ERROR = 3e-3
"""Expected relative error of the wall from which a check or a run warns: the accuracy that fine elements promise."""

WARNED_ERROR = 2e-3
"""Estimated relative error of forces and temperatures above which a run warns."""

MEASURED_ACCURACY = 0.01
"""Relative accuracy of measured walls, forces and temperatures: results that differ by less agree with a test."""

LARGE_ERROR = 0.05
"""Relative error, or relative change of a wall, from which a result is not to be used."""

LARGEST_FRICTION = 5.0
"""Largest plausible coefficient of friction: polymers on metal have 0.05 to 1, rubber on dry steel up to 4."""
