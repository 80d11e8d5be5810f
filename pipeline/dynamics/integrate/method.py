"""What an integration method is to the stepper, and which variant of the stepper a scene wants."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from pipeline.dynamics.kernels import kernel
from pipeline.dynamics.memory import Room


@kernel
def begin_afresh(h, f, w, n):
    """A one-step method remembers nothing."""


@kernel
def keep_nothing(h, f, w, n, step):
    """A one-step method remembers nothing."""


def no_memory(nq: int, nv: int, ny: int) -> int:
    """Floats that a method without memory needs."""
    return 0


def no_parameter(solver: Any) -> float:
    """Number that a method without a parameter takes from the scene."""
    return 0.0


@dataclass(frozen=True)
class Method:
    """An integration method.

    slopes: rows of SLOPES; the first is the slope where a step starts, the last is left to the events.
    last: row of the slope at the step's end.  dense: rows of DENSE.
    error_order: the error estimate falls with this power of the step plus one; for methods without one, their order.
    compose: (evaluate, retract) -> kernels that count their evaluations themselves:
        begin(h, f, w, n) after every restart, with the slope and the length of the first step known;
        attempt(h, f, w, n, step) fills Y_NEW, False when it could not;
        error(h, f, w, n, step) gives the norm of the local error, 1 at the tolerance (None: fixed steps only);
        extend(h, f, w, n, step) prepares the dense output once the slope at the end is known;
        keep(h, f, w, n, step) remembers an accepted step.
    interpolate: (h, w, share of the step, out) the dense output.
    retracts: whether `compose` uses retract.
    ends: whether `attempt` leaves the work space evaluated at Y_NEW, its slope in row `last`.
    steady: a growth of the step below this is not worth another factorisation.
    memory: floats kept between steps, from the numbers of positions, speeds and state variables.
    parameter: the method's number in the scene's solver table.
    stability: reach of the region of stability along the negative real axis, of an explicit method whose last
        stage is at the step's end and leaves its argument in Y_STAGE; None where stiffness is not looked for.
    """

    slopes: int
    last: int
    dense: int
    error_order: int
    compose: Callable
    interpolate: Callable
    retracts: bool = False
    ends: bool = False
    steady: float = 1.0
    memory: Callable[[int, int, int], int] = no_memory
    parameter: Callable[[Any], float] = no_parameter
    stability: float | None = None

    def room(self, nq: int, nv: int, ny: int) -> Room:
        """What it needs of the work space, from the numbers of positions, speeds and state variables."""
        return Room(self.slopes, self.dense, self.memory(nq, nv, ny))


@dataclass(frozen=True)
class Scheme:
    """Which stepper is compiled: method, fixed or chosen steps, events located or noticed at step ends."""

    integrator: str
    fixed: bool = False
    located: bool = True


def scheme_of(solver: Any) -> Scheme:
    """The scheme that a scene's solver table asks for."""
    return Scheme(solver.integrator, solver.step is not None, solver.events == "located")
