"""Derivatives of recorded quantities by numbers of the scene."""
