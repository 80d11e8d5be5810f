"""Rotations and directions in NumPy, for data and set-up."""
