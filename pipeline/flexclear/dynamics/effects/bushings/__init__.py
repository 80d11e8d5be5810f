"""Bushings: rotation vectors beyond half a turn, and recorded displacements."""
