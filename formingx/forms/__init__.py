"""The discrete equations of a scene: what `solve` sees."""
