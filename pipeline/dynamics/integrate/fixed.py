"""Steps of the length that the scene gives, shortened only to end on events, drive breaks, the run's end, and before
singular poses."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from flexclear.pipeline.dynamics import memory as m
from flexclear.pipeline.dynamics.integrate.norms import finite, set_error_scales
from flexclear.pipeline.dynamics.kernels import kernel


def make_step_control(
    evaluate: Callable, contacts: tuple[Callable, Callable], begin: Callable, error: Callable, method: Any
) -> tuple:
    """The kernels first_step, error_norm, after_rejection and next_step of the stepper."""
    watch_start, _ = contacts

    @kernel
    def first_step(d):
        """Slope at the start of a segment; False when the equations have no solution here."""
        slope = d.at_slopes
        evaluate(d, d.time, d.at_y, slope)
        d.evaluations += 1
        if d.evaluation != m.OK or not finite(d, slope):
            d.status = m.NOT_A_NUMBER if d.evaluation == m.OK else m.NO_START
            return False
        watch_start(d)
        d.step = d.fixed
        d.fresh = 0
        begin(d)
        return True

    @kernel
    def no_error(d, step):
        """Every step that could be made is good."""
        return 0.0

    @kernel
    def no_error_with_scales(d, step):
        """The same, of a method that looks for stiffness, which measures changes in units of the tolerance."""
        set_error_scales(d, d.at_y_new)
        return 0.0

    @kernel
    def after_rejection(d, step, norm):
        """There is no shorter step to try."""
        if d.evaluation == m.OK:
            d.status = m.NO_CONVERGENCE
        else:
            d.status = m.NOT_A_NUMBER if d.evaluation == m.NOT_FINITE else m.LOST_CLOSURE
        return False

    @kernel
    def next_step(d, step, norm):
        """All steps are alike."""
        return d.fixed

    error_norm = no_error if method.stability is None else no_error_with_scales
    return first_step, error_norm, after_rejection, next_step
