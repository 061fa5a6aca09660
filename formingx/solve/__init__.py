"""Solves F(x, control) = 0 and follows its solutions; knows no physics."""
