"""Points of a sweep: planned, run by processes or a cluster, stored."""
