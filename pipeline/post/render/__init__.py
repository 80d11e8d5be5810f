"""Pictures of shapes and motion with pyvista; the only package that imports it.

`pictures.pictures` makes them; nothing is imported here, because asking `gl` what this machine
can draw must stay quick.
"""
