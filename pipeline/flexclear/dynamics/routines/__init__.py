"""Routines: functions of numbers that are traced once per kind of their arguments, compiled, and called from lists."""
