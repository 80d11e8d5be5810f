"""Flexible bodies, from recipe to reduced bundle: finite elements (fe), modes and stress. Depends on: core."""
