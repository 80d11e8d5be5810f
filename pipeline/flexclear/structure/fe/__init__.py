"""Recipes, meshes and matrices of flexible bodies; only this package and `modes` know nodes and elements."""
