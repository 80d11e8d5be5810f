"""Solids: recipes, meshes made here or read from files, isotropic elasticity, and frames tied to regions."""
