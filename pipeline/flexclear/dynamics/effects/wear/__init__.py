"""Wear of contacts: the sliding distance of their surfaces, and the normal force over it."""
