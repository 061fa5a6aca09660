"""New meshes for deformed bodies during a run."""
