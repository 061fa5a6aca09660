"""What a run gives back: measures, path, profile, files, plots, views."""
