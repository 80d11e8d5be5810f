"""Specialised right-hand side of one topology: kernels run on symbols, and the operations become specialised code."""
