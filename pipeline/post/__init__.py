"""From datasets to maps, tables, pictures and the report. Reads artifacts, imports no other tower."""

from pipeline.post.series import derive

__all__ = ["derive"]
