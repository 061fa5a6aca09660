"""The discrete equations of a scene: the interface of `solve`."""
