"""Points of a sweep: planned, handed to processes or a cluster, stored."""
