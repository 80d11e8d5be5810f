"""The interface between an integration method and the stepper."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from flexclear.dynamics import memory as m
from flexclear.dynamics.kernels import kernel
from flexclear.scene.integrators import Traits


@kernel
def slope(d, i):
    """Return the index in w of row i of SLOPES, the slope of a state."""
    return d.at_slopes + d.ny * i


@kernel
def vector(d, i):
    """Return the index in w of row i of VECTORS, a method's storage of the state's length."""
    return d.at_vectors + d.ny * i


@kernel
def matrix(d, i):
    """Return the index in w of one of MATRICES, a method's storage."""
    return d.at_matrices + d.ny * d.ny * i


#: status of an attempt: it waits for rates, is complete, or has failed
AWAITS, MADE, LOST = range(3)


@kernel
def await_rates(d, t, y, dy):
    """Request the rates of the state in w from y at time t, to be stored in w from dy; return AWAITS."""
    d.awaited_time, d.awaited, d.rates_in = t, y, dy
    d.stage += 1
    d.evaluations += 1
    return AWAITS


def make_attempt(evaluate: Callable, proceed: Callable) -> Callable:
    """Build the kernel attempt of a staged method, which evaluates the requested rates itself."""

    @kernel
    def attempt(d, step):
        d.stage = 0
        come = proceed(d, step)
        while come == AWAITS:
            evaluate(d, d.awaited_time, d.awaited, d.rates_in)
            come = proceed(d, step)
        d.stage = 0
        return come == MADE

    return attempt


def make_at_once(attempt: Callable) -> Callable:
    """Build the kernel proceed of a method that is not staged."""

    @kernel
    def proceed(d, step):
        return MADE if attempt(d, step) else LOST

    return proceed


@kernel
def begin_afresh(d):
    """Do nothing: `begin` of a one-step method without memory."""


@kernel
def keep_nothing(d, step):
    """Do nothing: `keep` of a one-step method without memory."""


@dataclass(frozen=True, kw_only=True)
class Method:
    """An integration method.

    traits: properties that scenes and other modules use. room: storage in the work array; the first row of SLOPES is
    the slope at the start of a step, the last row belongs to
        the search for events.
    last: row of the slope at the step's end.
    make_kernels: (evaluate, lists) -> kernels.
        evaluate(d, t, y, dy) takes indices in w; lists: module of kernels that run lists of calls (`compile.calls`).
        The kernels count their evaluations:
        begin(d) is called after every restart, with the slope and the length of the first step known;
        attempt(d, step) fills Y_NEW and returns False when it fails; for a `staged` method proceed(d, step) continues
        to the next evaluation by d.stage, 0 at first, and returns AWAITS (`await_rates`), MADE or LOST;
        error(d, step) returns the norm of the local error, 1 at the tolerance (None: fixed steps only);
        extend(d, step) prepares the dense output once the slope at the end is known;
        keep(d, step) stores what the next step needs of an accepted one.
    interpolate: (d, fraction of the step, out) evaluates the dense output.
    error_order: the error estimate falls with this power of the step plus one; 0 for methods without one.
    staged: whether it has `proceed` in place of `attempt`, so that several engines can step together.
    ends: whether `attempt` leaves the work array evaluated at Y_NEW, its slope in row `last`.
    steady: growth of the step below this factor does not justify another factorisation.
    parameter: the method's number in the scene's solver table, if it has one.
    stability: extent of the stability region along the negative real axis, for an explicit method whose last stage is
        at the step's end and leaves its argument in Y_STAGE; None: stiffness is not detected.
    """

    traits: Traits
    room: m.Room
    last: int
    make_kernels: Callable
    interpolate: Callable
    error_order: int = 0
    staged: bool = False
    ends: bool = False
    steady: float = 1.0
    parameter: Callable[[Any], float] = lambda solver: 0.0
    stability: float | None = None
