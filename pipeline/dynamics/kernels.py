"""The decorator of every compiled function, `kernel`: IEEE division (no exceptions), fused multiply-add and reordered
sums allowed, NaN and infinity honoured.

Kernels become code without being optimised: the function that Python calls is, once, with all that it reaches.

Left to itself Numba optimises each function together with copies of all that it calls, and makes machine code of it,
before it compiles the next one up: what lies n calls deep is optimised n times. But only compiled code calls kernels
(`lowering`).

Numba is imported when something is compiled: a process that finds all code on disk (`compile.machine_code`) does
without it, and starts in half the time.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from functools import cache, cached_property
from importlib import import_module
from typing import Any

#: releases of Numba with which `lowering` has been tested
TESTED = ("0.67.", "0.68.")
#: for debugging: kernels are the functions of Python that they look like, as Numba's own setting has it
INTERPRETED = os.environ.get("NUMBA_DISABLE_JIT", "") not in ("", "0")


def release_is_tested() -> bool:
    """Whether `lowering` has been tested with the release of Numba that is there."""
    import numba

    return str(numba.__version__).startswith(TESTED)


@cache
def lowering() -> Any:
    """The module of that name; None where Numba is another release, or its inner parts are not what they were."""
    if not release_is_tested():
        return None
    try:
        from flexclear.pipeline.dynamics import lowering as made

        return made if made.works() else None
    except Exception:  # whatever Numba raises where it is given what it does not know
        return None


class Kernel:
    """A function that compiled code calls; what Numba knows of it comes to be when it is first asked for."""

    def __init__(self, py_func: Any, make: Callable[[Any], Any]) -> None:
        self.py_func, self._make = py_func, make
        self.__name__, self.__doc__, self.__module__ = py_func.__name__, py_func.__doc__, py_func.__module__

    @cached_property
    def dispatcher(self) -> Any:
        """What compiles it, by the types of its arguments."""
        return self._make(self.py_func)

    @cached_property
    def _numba_type_(self) -> Any:
        """What Numba takes it for where other kernels name it."""
        from numba import typeof

        return typeof(self.dispatcher)


def kernel(function: Callable) -> Any:
    """The function, to be called by compiled code."""
    return function if INTERPRETED else Kernel(function, _compiled)


# No kernel allocates, so none counts references; and none is called but by compiled code: wrappers for Python and
# C took a fifth of the compilation. To call one from Python, as tests do: njit(kernel.py_func).
def _compiled(function: Callable) -> Any:
    options = {
        "error_model": "numpy",
        "fastmath": {"contract", "reassoc", "nsz"},
        "_nrt": False,
        "no_cfunc_wrapper": True,
        "no_cpython_wrapper": True,
    }
    from numba import njit

    import_module("flexclear.pipeline.dynamics.field_types")  # named fields, which kernels use
    made = lowering()
    return njit(**options, **({"pipeline_class": made.KernelCompiler} if made else {}))(function)
