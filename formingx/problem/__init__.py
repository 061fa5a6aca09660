"""The discrete problem of a scene: forms and contact together."""
