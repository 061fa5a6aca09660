"""Constants of materials from tests: fits, in time too, their uncertainty, plots."""
