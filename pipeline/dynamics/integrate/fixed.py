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
    def first_step(h, f, w, n):
        """Slope at the start of a segment; False when the equations have no solution here."""
        c, slope = h[m.CONTROL], h[m.SLOPES]
        evaluate(h, f, w, n, w[c + m.TIME], h[m.Y], slope)
        n[m.EVALUATIONS] += 1
        if n[m.EVALUATION] != m.OK or not finite(h, w, slope):
            n[m.STATUS] = m.NOT_A_NUMBER if n[m.EVALUATION] == m.OK else m.NO_START
            return False
        watch_start(h, w)
        w[c + m.STEP] = w[c + m.FIXED]
        n[m.FRESH] = 0
        begin(h, f, w, n)
        return True

    @kernel
    def no_error(h, f, w, n, step):
        """Every step that could be made is good."""
        return 0.0

    @kernel
    def no_error_with_scales(h, f, w, n, step):
        """The same, of a method that looks for stiffness, which measures changes in units of the tolerance."""
        set_error_scales(h, f, w, h[m.Y_NEW])
        return 0.0

    @kernel
    def after_rejection(h, w, n, step, norm):
        """There is no shorter step to try."""
        if n[m.EVALUATION] == m.OK:
            n[m.STATUS] = m.NO_CONVERGENCE
        else:
            n[m.STATUS] = m.NOT_A_NUMBER if n[m.EVALUATION] == m.NOT_FINITE else m.LOST_CLOSURE
        return False

    @kernel
    def next_step(h, w, n, step, norm):
        """All steps are alike."""
        return w[h[m.CONTROL] + m.FIXED]

    error_norm = no_error if method.stability is None else no_error_with_scales
    return first_step, error_norm, after_rejection, next_step
