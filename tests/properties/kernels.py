"""Kernels called from Python."""

from collections.abc import Callable
from functools import cache
from typing import Any

from numba import njit

import flexclear.dynamics.field_types  # noqa: F401  (Numba knows named fields before kernels are compiled)
from flexclear.dynamics.fields import data


@cache
def from_python(kernel: Any) -> Callable:
    """The kernel with a wrapper for Python, without which a call ends the process."""
    return njit(error_model="numpy")(kernel.py_func) if hasattr(kernel, "py_func") else kernel


@cache
def from_arrays(kernel: Any) -> Callable:
    """A kernel of `fields.data`, to be called from Python with the four arrays."""

    def call(h, f, w, n):  # type: ignore[no-untyped-def]
        return kernel(data(h, f, w, n))

    return njit(error_model="numpy")(call) if hasattr(kernel, "py_func") else call
