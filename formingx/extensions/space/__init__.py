"""Membranes in three dimensions and their tools."""
