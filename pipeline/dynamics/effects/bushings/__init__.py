"""Bushings: rotation vectors beyond half a turn, and how far they give."""
