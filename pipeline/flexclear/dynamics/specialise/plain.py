"""Kernels as functions of Python, which run on any values that support arithmetic: symbols, or dual numbers.

Names in a kernel (other kernels, NumPy's functions, max and min) are replaced by versions for these values. So one
source is compiled, traced and differentiated.
"""

from __future__ import annotations

import builtins
from collections.abc import Callable
from types import CellType, FunctionType, ModuleType, SimpleNamespace
from typing import Any

import numpy as np

from flexclear.dynamics.kernels import INTERPRETED, Kernel

#: functions of NumPy that kernels use
FUNCTIONS = ("sqrt", "sin", "cos", "tan", "exp", "log", "tanh", "arctan2", "round", "copysign")


class Plain:
    """Converter plain(value): objects that a kernel refers to, with kernels that Python runs instead of compiled ones.

    function(name): replacement of NumPy's function.  largest, smallest: of two values.  call(function, arguments):
    result of a kernel; by default the kernel is called.
    """

    def __init__(
        self, function: Callable[[str], Callable], largest: Callable, smallest: Callable, call: Callable | None = None
    ) -> None:
        self._largest, self._smallest, self._call = largest, smallest, call
        self._functions = SimpleNamespace(pi=np.pi, inf=np.inf, **{name: function(name) for name in FUNCTIONS})
        self._made: dict[int, Any] = {}
        self._alive: list[Any] = []

    def __call__(self, value: Any) -> Any:
        """Return the value in its Python version, the same object for each value."""
        if id(value) not in self._made:
            self._alive.append(value)
            self._made[id(value)] = self._plain(value)
        return self._made[id(value)]

    def _plain(self, value: Any) -> Any:
        if isinstance(value, Kernel):
            return self._kernel(value.py_func)
        if INTERPRETED and isinstance(value, FunctionType):
            return self._kernel(value)
        if isinstance(value, ModuleType):
            return self._functions if value is np else _Names(self, value)
        if isinstance(value, tuple):
            entries = [self(entry) for entry in value]
            return type(value)(*entries) if hasattr(value, "_fields") else tuple(entries)
        return value

    def _kernel(self, function: FunctionType) -> Callable:
        scope: dict[str, Any] = {"__builtins__": builtins, "max": self._largest, "min": self._smallest}
        cells = tuple(CellType(self(cell.cell_contents)) for cell in function.__closure__ or ())
        run = FunctionType(function.__code__, scope, function.__name__, function.__defaults__, cells)
        call = self._call

        def traced(*arguments: Any) -> Any:
            if len(scope) == 3:  # at the first call, because kernels refer to each other
                known = function.__globals__
                scope.update({name: self(known[name]) for name in function.__code__.co_names if name in known})
                scope["_"] = None
            return run(*arguments) if call is None else call(run, arguments)

        return traced


class _Names:
    """Names of a module, each converted at its first use."""

    def __init__(self, plain: Plain, module: ModuleType) -> None:
        self._plain, self._module = plain, module

    def __getattr__(self, name: str) -> Any:
        attribute = self._plain(getattr(self._module, name))
        setattr(self, name, attribute)
        return attribute
