"""Output quantities and targets of a run: pressures, travels, volumes, forces."""
