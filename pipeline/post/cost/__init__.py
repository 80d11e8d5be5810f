"""What accuracy costs: errors of many runs of one scene against the best one, next to what each took."""
