"""Cost of accuracy: errors of many runs of one scene against the best one, and their costs."""
