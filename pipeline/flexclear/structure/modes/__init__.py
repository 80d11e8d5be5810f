"""Reduced coordinates of a meshed body: eigenproblem, reference conditions, inertia integrals, bundle."""
