"""The processors of this machine, and whether one of them is free."""

from __future__ import annotations

from flexclear.pipeline.core.system import cores

__all__ = ["cores", "free", "tell"]

_told: bool | None = None


def tell(others_idle: bool) -> None:
    """In a worker, with each task: whether nothing else can run while it does."""
    global _told
    _told = others_idle


def free() -> bool:
    """Whether a processor is free, for all that this program knows; in workers of another program none is."""
    import multiprocessing  # here, since what finds everything fresh must start quickly

    idle = multiprocessing.parent_process() is None if _told is None else _told
    return idle and cores() > 1
