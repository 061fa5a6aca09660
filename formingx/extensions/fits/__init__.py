"""Fits of material constants to tests, also to tests in time, with their uncertainty and plots."""
