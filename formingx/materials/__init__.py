"""Strain energies, homogeneous tests and fits."""
