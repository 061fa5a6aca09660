"""What a run can aim at and what it records: pressures, travels, volumes, forces."""
