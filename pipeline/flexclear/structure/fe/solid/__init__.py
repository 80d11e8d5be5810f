"""Solids: recipes, meshes (generated or read from files), isotropic elasticity, and frames tied to regions."""
