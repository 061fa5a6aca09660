"""Heat conduction in a sheet over time, heat exchange at its faces, and tools in contact with it."""
