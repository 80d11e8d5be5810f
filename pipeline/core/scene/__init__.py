"""Scene files: what they may say (schema and its parts), how they are read and composed (load)."""
