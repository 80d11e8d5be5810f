"""Kernels called from Python."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

from numba import njit


@cache
def from_python(kernel: Any) -> Callable:
    """The kernel with a wrapper for Python, without which a call ends the process."""
    return njit(error_model="numpy")(kernel.py_func) if hasattr(kernel, "py_func") else kernel
