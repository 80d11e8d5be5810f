"""The right-hand side again, for one wiring: kernels run on symbols, what they compute made straight code."""
