"""Gears and racks: constraints between two joint coordinates."""
