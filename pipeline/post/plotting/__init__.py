"""How plots and tables look, and their deterministic bytes."""
