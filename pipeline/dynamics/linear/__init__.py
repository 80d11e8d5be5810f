"""Static equilibrium of a mechanism, and the small motions about it.

All numbers come from the compiled right-hand side that also integrates the motion: its generalised forces, its mass
matrix and the Jacobian of its closures. Nothing here is compiled.
"""
