"""Scenes as users declare them, checked before anything is solved."""
