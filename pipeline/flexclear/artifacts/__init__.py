"""The files through which the towers exchange data: their contents (schema) and their storage (store)."""
