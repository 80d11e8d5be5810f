"""The decorator of every compiled function, `kernel`: IEEE division (no exceptions), fused multiply-add and reordered
sums allowed, NaN and infinity honoured.

Kernels become code without optimisation; the function that Python calls is optimised once, with all kernels it reaches.
By default Numba optimises each function together with copies of all functions that it calls, and generates machine
code, before it compiles the caller: code n calls deep is optimised n times. But only compiled code calls kernels
(`lowering`).

Numba is imported only to compile: a process that finds all code on disk (`compile.machine_code`) does not import it and
starts in half the time.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from functools import cached_property
from typing import Any

#: for debugging: kernels stay functions of Python, as with Numba's own setting
INTERPRETED = os.environ.get("NUMBA_DISABLE_JIT", "") not in ("", "0")
#: for tests: nothing private of Numba is used, which takes two to three times as long
PLAIN = os.environ.get("FLEXCLEAR_PLAIN_NUMBA", "") not in ("", "0")


class Kernel:
    """A function that compiled code calls; its Numba objects are created at first use."""

    def __init__(self, py_func: Any, make: Callable[[Any], Any]) -> None:
        self.py_func, self._make = py_func, make
        self.__name__, self.__doc__, self.__module__ = py_func.__name__, py_func.__doc__, py_func.__module__

    def __call__(self, *arguments: Any) -> Any:
        """Evaluate the function in Python, once and without compilation."""
        return self.py_func(*arguments)

    @cached_property
    def dispatcher(self) -> Any:
        """Numba's dispatcher, which compiles the function for the types of its arguments."""
        return self._make(self.py_func)

    @cached_property
    def _numba_type_(self) -> Any:
        """Type that Numba assigns to the kernel where other kernels name it."""
        from numba import typeof

        return typeof(self.dispatcher)


def kernel(function: Callable) -> Any:
    """Return the function as a kernel, for calls from compiled code."""
    return function if INTERPRETED else Kernel(function, _compiled)


# No kernel allocates, so none counts references; and only compiled code calls kernels: wrappers for Python and C took a
# fifth of the compilation. To call one from Python, as tests do: njit(kernel.py_func).
def _compiled(function: Callable) -> Any:
    options: dict[str, Any] = {
        "error_model": "numpy",
        "fastmath": {"contract", "reassoc", "nsz"},
        "_nrt": False,
        "no_cfunc_wrapper": True,
        "no_cpython_wrapper": True,
    }
    from numba import njit

    if not PLAIN:
        from flexclear.dynamics.lowering import KernelCompiler

        options["pipeline_class"] = KernelCompiler
    return njit(**options)(function)
