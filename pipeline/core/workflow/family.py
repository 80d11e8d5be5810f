"""Processes that end with the one that started them, whatever it dies of."""

from __future__ import annotations

import os
import signal
import sys
import threading
import time

#: the request that the system send a signal when the parent dies (linux/prctl.h)
PR_SET_PDEATHSIG = 1
#: where the system sends none, the parent is looked for so often [s]
LOOK = 1.0


def follow(parent: int) -> None:
    """In a process that `parent` started: end when it does; Ctrl-C is left to it, which ends its children.

    parent: its number, as it says itself: by now the system may have given this process another one.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if sys.platform == "linux":
        import ctypes

        # compiled code and compilers do not let a thread of Python run; the system asks nobody
        ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
    threading.Thread(target=_watch, args=(parent,), daemon=True).start()


def _watch(parent: int) -> None:
    while os.getppid() == parent:
        time.sleep(LOOK)
    os._exit(1)
