"""What is read off the states of a sheet in space: its wall, element by element, the part, how it fills tools."""
