"""The files in which the towers meet: what they hold (schema) and how they are stored (store)."""
