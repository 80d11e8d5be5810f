"""Recipe, mesh and beam matrices. The only package, with modes, that knows of nodes and elements."""
