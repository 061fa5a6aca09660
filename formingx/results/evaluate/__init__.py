"""Evaluation of states: profile, wall, part, stress, contact, filling, energy balance, admissibility."""
