"""Kernels called from Python."""

from collections.abc import Callable
from functools import cache
from typing import Any

from numba import njit

import flexclear.dynamics.field_types  # noqa: F401  (Numba knows named fields before kernels are compiled)


@cache
def from_python(kernel: Any) -> Callable:
    """The kernel with a wrapper for Python, without which a call ends the process."""
    return njit(error_model="numpy")(kernel.py_func) if hasattr(kernel, "py_func") else kernel
