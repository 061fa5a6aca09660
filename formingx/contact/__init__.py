"""Contact of one face with a tool: where it acts, its equations and memory, its increments, how steps bring it on."""
