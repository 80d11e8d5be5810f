"""Which method and tolerance a run gets, and whether it reaches the requested accuracy."""
