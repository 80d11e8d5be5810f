"""Calls of separately compiled functions through addresses in the header of h.

A right-hand side composed into its integrator is optimised again in every function between the two, and every mechanism
needs an integrator of its own. Called by its address it is compiled once, and so is the integrator, for all mechanisms.
A call costs some nanoseconds.
"""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace

from flexclear.dynamics import memory as m
from flexclear.dynamics.compile.files import PART
from flexclear.dynamics.fields import data
from flexclear.dynamics.kernels import kernel


def make_calls(call: Callable) -> SimpleNamespace:
    """Build these kernels; call(address, arguments): returns what the function at an address returns."""

    @kernel
    def evaluate(h, f, w, n, t, y, dy):
        """Evaluate the right-hand side, and store all that the record has of it: `mechanics.record`."""
        call(h[m.EVALUATE], (h, f, w, n, float(t), y, dy))

    @kernel
    def laws(h, f, w, n, t):
        """Evaluate the laws of time: `equations.prescribed_motion`."""
        call(h[m.PRESCRIBE], (h, f, w, n, float(t)))

    @kernel
    def rates(d, t, y, dy):
        """Evaluate the right-hand side for steps, which need only the rates."""
        call(d.h[m.RATES], (d.h, d.f, d.w, d.n, float(t), y, dy))

    @kernel
    def awaited(h, f, w, n):
        """Evaluate the rates that an attempt waits for: `integrate.method.await_rates`."""
        d = data(h, f, w, n)
        rates(d, d.awaited_time, d.awaited, d.rates_in)

    @kernel
    def project(h, f, w, n, t, y, dy, tolerance):
        """Project a state onto the closures: `equations.projection`."""
        return call(h[m.PROJECT], (h, f, w, n, float(t), y, dy, tolerance))

    @kernel
    def correct(h, f, w, n, t, y, dy):
        """Store, as rates of the state evaluated last, the changes that close its loops: `mechanics.responses`."""
        call(h[m.RUN], (h, f, w, n, float(t), y, dy, h[m.CLOSE]))

    @kernel
    def retract(d, y, displacement, out):
        """Store the positions after a displacement; all are indices in w."""
        for k in range(d.nq):
            d.w[out + k] = d.w[y + k]
        call(d.h[m.RUN], (d.h, d.f, d.w, d.n, d.time, out, displacement - d.nq, d.h[m.MOVE]))

    @kernel
    def factor_springs(d, t, y):
        """Prepare `release_spring` for a state."""
        laws(d.h, d.f, d.w, d.n, t)
        call(d.h[m.RUN], (d.h, d.f, d.w, d.n, float(t), y, y, d.h[m.SPRINGS]))

    @kernel
    def release_spring(d, t, y, response):
        """Replace forces on modes, in a row like the state's rates, by what they cause."""
        call(d.h[m.RUN], (d.h, d.f, d.w, d.n, float(t), y, response, d.h[m.SPRINGS] + PART))

    @kernel
    def resolve(d, step, t_new, rows, events):
        """Locate the events of a step: `integrate.stepper.make_resolution`."""
        (count, width), (event_count, event_width) = rows.shape, events.shape
        record = (rows, count, width, events, event_count, event_width)
        happened = call(d.h[m.RESOLVE], (d.h, d.f, d.w, d.n, float(step), float(t_new), *record))
        return happened, d.extended == 1, d.resolved_end, d.resolved_step

    made = evaluate, laws, rates, awaited, project, correct, retract, factor_springs, release_spring, resolve
    return SimpleNamespace(**{one.__name__: one for one in made})
