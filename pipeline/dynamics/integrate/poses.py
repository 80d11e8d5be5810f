"""What the stepper does about singular poses of closed loops; without loops, nothing."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from flexclear.pipeline.dynamics.kernels import kernel


@dataclass(frozen=True)
class Poses:
    """Kernels, and makers of some; those of mechanisms with loops are in `singular_step`.

    note(d): remember how independent the closures are in the state just evaluated.
    stand(d, t): take that for the start of a step.
    steer(d, t): the next step from t, 0 where a polynomial must be laid over a pose.
    ready(d): whether one lies ready.  done(d, t): it has been gone along up to t.
    make_foresee(evaluate): foresee(d, t) looks for a pose ahead of an accepted step's end.
    make_along(method, attempt, extend): the method's attempt, extend and interpolate, for such polynomials as well.
    make_arrive(evaluate, project, attempt, method): arrive(d, step, t_new) goes along one.
    """

    note: Callable
    stand: Callable
    steer: Callable
    ready: Callable
    done: Callable
    make_foresee: Callable
    make_along: Callable
    make_arrive: Callable


@kernel
def never(d):
    """No polynomial lies ready; no contact is closed."""
    return False


@kernel
def note_nothing(d):
    """No closure."""


@kernel
def stand_anywhere(d, t):
    """No closure."""


@kernel
def step_as_planned(d, t):
    """No pose to stop before."""
    return d.step


@kernel
def nothing_done(d, t):
    """No polynomial."""


def make_foresee_nothing(evaluate: Callable) -> Callable:
    """The kernel foresee of a tree."""

    @kernel
    def foresee(d, t):
        """No pose to foresee."""

    return foresee


def make_along_nothing(method: Any, attempt: Callable, extend: Callable) -> tuple[Callable, Callable, Callable]:
    """The method's own kernels."""
    return attempt, extend, method.interpolate


def make_arrive_nowhere(evaluate: Callable, project: Callable, attempt: Callable, method: Any) -> Callable:
    """The kernel arrive of a tree."""

    @kernel
    def arrive(d, step, t_new):
        """No polynomial."""

    return arrive


NO_POSES = Poses(
    note_nothing,
    stand_anywhere,
    step_as_planned,
    never,
    nothing_done,
    make_foresee_nothing,
    make_along_nothing,
    make_arrive_nowhere,
)
