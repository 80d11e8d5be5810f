"""Reasons why a run ends or is doubtful, in words."""
