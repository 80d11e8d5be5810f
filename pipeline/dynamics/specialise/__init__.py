"""The right-hand side again, for one mechanism's wiring: kernels run on symbols, what they compute made straight code."""
