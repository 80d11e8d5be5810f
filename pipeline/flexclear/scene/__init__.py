"""Scene files: their possible content (schema and its parts), their reading and composition (load)."""
