"""Meshes adapted to a pilot run."""
