"""Steps of the length that the scene gives, shortened only to end on events, drive breaks and the run's end, and before
singular poses."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from flexclear.dynamics import memory as m
from flexclear.dynamics.integrate.norms import set_error_scales
from flexclear.dynamics.kernels import kernel


def make_step_control(evaluate: Callable, any_closed: Callable, error: Callable, method: Any) -> tuple:
    """Build the stepper's kernels first_step, error_norm, after_rejection and next_step."""

    @kernel
    def first_step(d):
        """Return the fixed length of all steps."""
        return d.fixed

    @kernel
    def error_norm(d, step):
        """Return 0: every step is accepted. Stiffness is measured in units of the tolerance."""
        set_error_scales(d, d.at_y_new)
        return 0.0

    @kernel
    def after_rejection(d, step, norm):
        """Give up: fixed steps are never shortened."""
        if d.evaluation == m.OK:
            d.status = m.NO_CONVERGENCE
        else:
            d.status = m.NOT_A_NUMBER if d.evaluation == m.NOT_FINITE else m.LOST_CLOSURE
        return False

    @kernel
    def next_step(d, step, norm):
        """Return the fixed length of all steps."""
        return d.fixed

    return first_step, error_norm, after_rejection, next_step
