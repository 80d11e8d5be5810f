"""The processors of this machine, and whether one of them is free."""

from __future__ import annotations

import os

_told: bool | None = None


def cores() -> int:
    """Processors that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def tell(others_idle: bool) -> None:
    """In a worker, with each task: whether nothing else can run while it does."""
    global _told
    _told = others_idle


def free() -> bool:
    """Whether a processor is free, for all that this program knows; in workers of another program none is."""
    import multiprocessing  # here, since what finds everything fresh must start quickly

    idle = multiprocessing.parent_process() is None if _told is None else _told
    return idle and cores() > 1
