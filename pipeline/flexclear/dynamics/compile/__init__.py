"""Compiled functions of a mechanism, composed of the kernels of its parts."""
