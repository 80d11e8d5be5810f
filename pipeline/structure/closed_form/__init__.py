"""Closed-form results, for comparison with those of finite elements."""
