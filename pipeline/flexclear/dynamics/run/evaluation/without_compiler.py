"""Functions of an engine that Python evaluates, kernel by kernel and routine by routine.

So `check` examines a start without a compiler, and `NUMBA_DISABLE_JIT=1` a run in a debugger. An evaluation takes
milliseconds, a thousand times as long as compiled code.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any, ClassVar

import numpy as np

from flexclear.dynamics import memory as m
from flexclear.dynamics.compile import functions, sources
from flexclear.dynamics.compile.addresses import make_calls
from flexclear.dynamics.compile.files import PART
from flexclear.dynamics.compile.functions import Arrays
from flexclear.dynamics.effects import scheme_of
from flexclear.dynamics.fields import data
from flexclear.dynamics.kernels import INTERPRETED
from flexclear.dynamics.model.model import Model
from flexclear.dynamics.run.evaluation.specialised_code import evaluated_in_python, lists_in_python

#: whether new engines are evaluated in Python
IN_PYTHON: ContextVar[bool] = ContextVar("in_python", default=INTERPRETED)
#: places in the header of the addresses of functions and of lists, at which `Uncompiled` writes numbers
FUNCTIONS, LISTS = (m.EVALUATE, m.RATES, m.PRESCRIBE, m.PROJECT, m.RESOLVE, m.RUN), (m.CLOSE, m.MOVE, m.SPRINGS)


@dataclass(frozen=True)
class Uncompiled(functions.Entry):
    """Kernels of a mechanism that Python evaluates: those of its files, `evaluate`, and `calls` of each other."""

    kernels: SimpleNamespace
    compiled: ClassVar[bool] = False

    @classmethod
    def of(cls, model: Model) -> Uncompiled:
        """Return the kernels of a model."""
        return cls({}, _kernels(model))

    def connect(self, h: np.ndarray) -> None:
        """Write a number for each address in the header."""
        for where in FUNCTIONS:
            h[where] = where
        for where in LISTS:
            h[where] = 2 * PART * where

    def observe(self, arrays: Arrays, rows: np.ndarray, pieces: np.ndarray, tolerance: float, out: np.ndarray) -> None:
        """Evaluate the outputs of every row; arrays: h, f, w and n."""
        with np.errstate(all="ignore"):  # as in compiled code, unused values may be infinite
            self.kernels.observation(*arrays, rows, pieces, tolerance, out)

    def advance(self, arrays: Arrays, outputs: np.ndarray, rows: np.ndarray, events: np.ndarray) -> None:
        """Step to the end of the segment or of the budget."""
        with np.errstate(all="ignore"):
            while self.kernels.steps(*arrays, outputs, rows, events):
                self.kernels.calls.awaited(*arrays)

    def evaluate(self, arrays: Arrays, t: float, repeat: int) -> None:
        """Evaluate the state in Y at time t, once."""
        h = arrays[0]
        with np.errstate(all="ignore"):
            self.kernels.evaluate(*arrays, t, int(h[m.Y]), int(h[m.SLOPES]))

    def evaluate_laws(self, arrays: Arrays, t: float) -> None:
        """Evaluate all laws at time t."""
        self.kernels.laws(*arrays, t)


@contextmanager
def without_compiler() -> Iterator[None]:
    """Let all engines that are prepared during the context be evaluated in Python."""
    token = IN_PYTHON.set(True)
    try:
        yield
    finally:
        IN_PYTHON.reset(token)


def _kernels(model: Model) -> SimpleNamespace:
    """Return the kernels of a model, and `evaluate`."""
    known = dict[int, Callable]()
    calls = make_calls(lambda place, given: known[int(place)](*given))
    made = SimpleNamespace(calls=calls)
    for name, source in sources.for_python(model.parts, scheme_of(model.scene.solver)):
        scope: dict[str, Any] = {"calls": calls}
        exec(source, scope)
        setattr(made, name, scope[name])
    made.evaluate = evaluated_in_python(model, made.laws)
    known[m.EVALUATE], known[m.PRESCRIBE], known[m.RUN] = made.evaluate, made.laws, lists_in_python(model)
    known[m.RATES] = evaluated_in_python(model, made.laws, m.CALLS)
    if model.parts.closures:
        known[m.PROJECT] = made.projection
    if hasattr(made, "resolution"):
        known[m.RESOLVE] = lambda h, f, w, n, step, t, rows, count, width, events, *_: made.resolution(
            data(h, f, w, n), step, t, rows, events
        )
    return made
