"""Springback of a formed part, and its mesh."""
