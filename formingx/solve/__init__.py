"""Solver of F(x, control) = 0 for single states and for paths of states, independent of the physics of F."""
