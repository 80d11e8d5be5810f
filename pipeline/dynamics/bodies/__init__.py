"""Inertia of the bodies: rigid ones in `rigid`, modally reduced ones in `flexible`."""
