"""A scene, or a script's, looked over before a run."""
