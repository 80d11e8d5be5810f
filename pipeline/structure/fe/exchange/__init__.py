"""Matrices of other finite element codes, in and out."""
