"""What an integration method is to the stepper, and which variant of the stepper a scene wants."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from flexclear.pipeline.core.scene.integrators import Traits
from flexclear.pipeline.dynamics import memory as m
from flexclear.pipeline.dynamics.kernels import kernel


@kernel
def slope(d, i):
    """Where w holds row i of SLOPES, the slope of a state."""
    return d.at_slopes + d.ny * i


@kernel
def vector(d, i):
    """Where w holds row i of VECTORS, of the state's length, which a method keeps."""
    return d.at_vectors + d.ny * i


@kernel
def matrix(d, i):
    """Where w holds one of MATRICES, which a method keeps."""
    return d.at_matrices + d.ny * d.ny * i


#: how far an attempt has come: it waits for rates, it is made, it cannot be made
AWAITS, MADE, LOST = range(3)


@kernel
def await_rates(d, t, y, dy):
    """Ask whoever lets the attempt proceed for the rates of the state in w from y at time t, into w from dy."""
    d.awaited_time, d.awaited, d.rates_in = t, y, dy
    d.stage += 1
    d.evaluations += 1
    return AWAITS


def make_attempt(evaluate: Callable, proceed: Callable) -> Callable:
    """The kernel attempt of a method that waits for its rates: it makes them itself."""

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
    """The kernel proceed of a method that waits for nothing."""

    @kernel
    def proceed(d, step):
        return MADE if attempt(d, step) else LOST

    return proceed


@kernel
def begin_afresh(d):
    """`begin` of a one-step method, which has nothing to forget."""


@kernel
def keep_nothing(d, step):
    """`keep` of a one-step method, which has nothing to remember."""


@dataclass(frozen=True, kw_only=True)
class Method:
    """An integration method.

    traits: what is known of it elsewhere.
    room: what it needs of the work space; of SLOPES the first row is the slope where a step starts, the last is left to
        the search for events.
    last: row of the slope at the step's end.
    make_kernels: (evaluate, retract) -> kernels, with a third argument of methods that read more than rates
        (`Traits.reads_all`): an evaluation of which everything is left, with the module that factors the mass matrix.
        evaluate(d, t, y, dy), retract(d, y, displacement, out, scratch) take indices in w. They count their evaluations
        themselves:
        begin(d) after every restart, with the slope and the length of the first step known;
        attempt(d, step) fills Y_NEW, False when it could not; of a `staged` method proceed(d, step) does so from one
        evaluation to the next: AWAITS (`await_rates`), MADE or LOST, by d.stage, 0 at first;
        error(d, step) gives the norm of the local error, 1 at the tolerance (None: fixed steps only);
        extend(d, step) prepares the dense output once the slope at the end is known;
        keep(d, step) remembers an accepted step.
    interpolate: (d, share of the step, out) the dense output.
    error_order: the error estimate falls with this power of the step plus one; 0 for methods without one.
    staged: whether it gives `proceed` in place of `attempt`, so that several can proceed together.
    ends: whether `attempt` leaves the work space evaluated at Y_NEW, its slope in row `last`.
    steady: a growth of the step below this is not worth another factorisation.
    parameter: the method's number in the scene's solver table, if it has one.
    stability: reach of the region of stability along the negative real axis, of an explicit method whose last
        stage is at the step's end and leaves its argument in Y_STAGE; None where stiffness is not looked for.
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
