"""Surfaces of deformed bodies, and stress on them, as numbers."""
