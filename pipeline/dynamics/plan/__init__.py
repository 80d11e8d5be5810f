"""Which effects of a scene its wanted accuracy calls for: bounds first, then short runs, then what is left is kept."""
