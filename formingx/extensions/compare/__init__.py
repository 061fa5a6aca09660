"""Comparisons of runs with results of other programs and with measured walls."""
