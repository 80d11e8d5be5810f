"""Plans: which effects of a scene its requested accuracy requires. Bounds come first, then short runs; remaining
effects are kept."""
