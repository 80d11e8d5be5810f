"""Papers that this program reproduces, one folder each."""
