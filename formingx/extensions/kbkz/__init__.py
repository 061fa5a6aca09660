"""Integral constitutive laws of K-BKZ type."""
