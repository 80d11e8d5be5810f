"""The stages from recipe to pictures, how they hang together (graph), and the command (__main__, a module per verb)."""

# reaching `pipeline` first pins BLAS to one thread, before any stage loads NumPy
