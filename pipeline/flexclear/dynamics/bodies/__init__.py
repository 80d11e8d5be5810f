"""Inertia of the bodies: rigid bodies in `rigid`, modally reduced bodies in `flexible`."""
