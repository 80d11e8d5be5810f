"""Readers as a file that was made to harm would turn them into; they are run in the child process."""

from __future__ import annotations

import ctypes
import os
import sys
import time
from pathlib import Path

import numpy as np


def crashes(path: Path) -> None:
    """What a broken library in C does."""
    ctypes.string_at(0)


def ends(path: Path) -> None:
    os._exit(7)


def turns(path: Path) -> None:
    """Without end, in C: Python's own limits of regular expressions are none."""
    while True:
        sum(range(10**9))


def sleeps(path: Path) -> None:
    time.sleep(1000.0)


def grows(path: Path, count: int) -> float:
    return float(np.ones(count).sum())


def answers_much(path: Path, count: int) -> np.ndarray:
    return np.broadcast_to(np.float64(1.0), (count,))


def writes(path: Path) -> None:
    path.with_name("made").write_bytes(b"x" * 100)


def babbles(path: Path) -> None:
    """Writes where answers go, as code would that a file brought with it."""
    for number in range(3, 10):
        try:
            os.write(number, b"\xff" * 1000)
        except OSError:
            continue


def gives_objects(path: Path) -> object:
    return np.array([{}, sys], dtype=object)


def number(path: Path) -> int:
    return os.getpid()


def doubled(path: Path) -> dict[str, object]:
    content = path.read_bytes()
    return {"bytes": np.frombuffer(content, dtype=np.uint8), "more": [None, True, 1.5, "text", {"a": np.eye(2) > 0}]}
