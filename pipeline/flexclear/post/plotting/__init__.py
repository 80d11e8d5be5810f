"""Look of plots and tables, and their deterministic bytes."""
