"""Processes that end with the one that started them, whatever it dies of."""

from __future__ import annotations

import os
import signal
import threading
import time

from flexclear.pipeline.core import system

#: where the system sends none, the parent is searched for so often [s]
LOOK = 1.0


def follow(parent: int, *, by_main_thread: bool = True) -> None:
    """In a process that `parent` started: end when it does; Ctrl-C is left to it, which ends its children.

    parent: its number, as it says itself: by now the system may have given this process another one.
    by_main_thread: whether it was that thread of the parent that started this process; what the system sends at
    the end of a parent comes at the end of the thread.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if by_main_thread:
        system.end_with_parent()
    threading.Thread(target=_watch, args=(parent,), daemon=True).start()


def _watch(parent: int) -> None:
    while system.is_parent(parent):
        time.sleep(LOOK)
    os._exit(1)
