"""Predictability of a motion: perturbed runs, tangent equations, exponents, periods."""
