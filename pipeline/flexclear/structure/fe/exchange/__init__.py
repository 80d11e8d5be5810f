"""Import and export of matrices of other finite element codes."""
