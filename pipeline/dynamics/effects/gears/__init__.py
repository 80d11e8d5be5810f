"""Gears and racks: joint coordinates that follow each other."""
