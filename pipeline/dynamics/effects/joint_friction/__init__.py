"""Friction of ideal joints that follows their reactions."""
