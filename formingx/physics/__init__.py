"""What a scene is made of: each object knows its own law and nothing of the others'."""
