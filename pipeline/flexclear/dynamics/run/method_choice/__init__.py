"""Choice of a run's method and tolerance, and verification of the requested accuracy."""
