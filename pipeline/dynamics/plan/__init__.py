"""Which effects of a scene its requested accuracy calls for: bounds first, then short runs, then what is left is
kept."""
