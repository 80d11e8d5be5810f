"""Pictures of shapes and motion with pyvista; the only package that imports it."""

from pipeline.post.render.pictures import pictures

__all__ = ["pictures"]
