"""Pictures of shapes and motion with pyvista; the only package that imports it.

`pictures.make` draws them; nothing is imported here, so that `gl` can report quickly what this machine can draw.
"""
