"""How long a motion is predictable: perturbed runs, tangent equations, exponents, periods."""
