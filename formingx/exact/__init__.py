"""Exact solutions and membrane theory, to compare runs with."""
