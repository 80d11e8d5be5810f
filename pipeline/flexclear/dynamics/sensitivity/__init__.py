"""Derivatives of recorded quantities with respect to numbers of the scene."""
