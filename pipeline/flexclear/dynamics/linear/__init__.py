"""Static equilibrium and steady motion of a mechanism, and small motions about them.

All numbers come from the compiled right-hand side that also integrates the motion: its generalised forces, its mass
matrix and the Jacobian of its closure constraints. This package compiles nothing itself.
"""
