"""What the user declares, checked before anything is solved."""
