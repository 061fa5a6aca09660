"""Evaluation of a state: profile, stress."""
