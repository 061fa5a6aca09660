"""Forms of a scene, with its fields, materials, histories and constraints."""
