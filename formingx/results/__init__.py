"""Results of a run: path, profile, files, plots, views."""
