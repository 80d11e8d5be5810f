"""Reduced coordinates of a meshed body: eigenproblem, reference conditions, inertia integrals, bundle."""

from pipeline.structure.modes.solution import solve

__all__ = ["solve"]
