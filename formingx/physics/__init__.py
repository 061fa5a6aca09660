"""Laws of a scene: each object knows only its own law."""
