"""An engine that Python evaluates, kernel by kernel: what a run does at its start is checked without a compiler.

An evaluation takes milliseconds, a thousand times as long as compiled code: enough for a start, not for a run.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np

from flexclear.dynamics import memory as m
from flexclear.dynamics.compile import functions, sources
from flexclear.dynamics.compile.files import PART
from flexclear.dynamics.integrate import METHODS
from flexclear.dynamics.model.mobility import Mobility
from flexclear.dynamics.model.model import Model
from flexclear.dynamics.run.evaluation.engine import MAKER, Engine, assemble
from flexclear.dynamics.run.evaluation.specialised_code import evaluated_in_python, lists_in_python
from flexclear.system.progress import Progress, silent


@dataclass(frozen=True)
class Uncompiled(functions.Entry):
    """Functions of a mechanism that Python evaluates, by their names in `compile.calls`."""

    kernels: SimpleNamespace

    def connect(self, h: np.ndarray) -> None:
        """Leave the header as it is: no function calls another one by its address."""


class PythonEngine(Engine):
    """An engine without compiled functions: it evaluates and observes, and takes no steps."""

    entry: Uncompiled

    def connect(self, progress: Progress = silent) -> None:
        """Leave the header as it is."""

    def evaluate_laws(self, t: float) -> None:
        """Store the values and rates of all laws at time t."""
        self.entry.kernels.laws(*self._numbers(), t)

    def evaluate(self, t: float, repeat: int = 1) -> None:
        """Store the rate of the state in Y at time t in the first row of SLOPES."""
        with np.errstate(all="ignore"):  # as in compiled code, unused values may be infinite
            self.entry.kernels.evaluate(*self._numbers(), t, int(self.h[m.Y]), int(self.h[m.SLOPES]))

    def observe(self, rows: np.ndarray, pieces: np.ndarray, tolerance: float, out: np.ndarray) -> None:
        """Evaluate the outputs of every row."""
        with np.errstate(all="ignore"):
            self.entry.kernels.observe(*self._numbers(), rows, pieces, tolerance, out)

    def _numbers(self) -> tuple[np.ndarray, ...]:
        return self.h, self.model.arrays.f, self.w, self.n


def uncompiled(model: Model, mobility: Mobility) -> Engine:
    """Return an engine for the start of a model's run, without compilation."""
    method = METHODS[model.scene.solver.integrator]
    return assemble(model, Uncompiled({}, _kernels(model)), method, mobility, PythonEngine)


@contextmanager
def without_compiler() -> Iterator[None]:
    """Let all engines that are prepared during the context be evaluated in Python."""
    token = MAKER.set(uncompiled)
    try:
        yield
    finally:
        MAKER.reset(token)


def _kernels(model: Model) -> SimpleNamespace:
    calls = SimpleNamespace(evaluate=evaluated_in_python(model, lambda *given: calls.laws(*given)))
    run = lists_in_python(model)
    calls.correct = lambda *given: run(*given, 2 * PART * m.CLOSE)
    calls.rates = lambda d, *given: calls.evaluate(d.h, d.f, d.w, d.n, *given)
    for name, kernel, source in sources.for_python(model.parts):
        scope: dict[str, Any] = {"calls": calls}
        exec(source, scope)
        setattr(calls, name, scope[kernel])
    return calls
