"""Checks of a scene or of a script before a run, and of a run after its end."""
