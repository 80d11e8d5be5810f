"""Integration of a scene's motion."""
