"""Steppers that advance together, one in each lane of the processor's vectors.

Each stepper proceeds alone until an attempt waits for the rates of a state (`integrate.method.await_rates`): the next
stage, or the end of the step. The rates of all waiting steppers are then evaluated at once. First steps, event searches
and projections are evaluated by each stepper alone. Steppers are independent and may be at different stages.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from numba import types
from numba.extending import intrinsic

from flexclear.dynamics import memory as m
from flexclear.dynamics.compile.calls import awaited, call, laws
from flexclear.dynamics.fields import data
from flexclear.dynamics.kernels import kernel
from flexclear.dynamics.specialise.batched import exactly

#: evaluating all lanes at once takes as long as this fraction of them one by one
LANE_COST = 4


def _pointer(kind: Any) -> Any:
    """Return an intrinsic that converts an address [integer] into a pointer to array entries."""

    @intrinsic
    def pointer(typingctx: Any, address: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
            return builder.inttoptr(values[0], context.get_value_type(types.CPointer(kind)))

        return types.CPointer(kind)(address), generate

    return pointer


integers, floats = _pointer(types.int64), _pointer(types.float64)


def make_lanes(note: Callable, evaluate: Callable, lanes: int) -> Callable:
    """Build the kernel run(table, places, numbers), which returns when a stepper has finished or the caller interrupts.

    table: see `memory.LANE_WORDS`. places: room for 6 lanes words, then a word per lane that names the stepper whose
    numbers the lane has; 0: they must be copied again. numbers: see `specialise.batched`.
    """
    few = lanes // LANE_COST

    @kernel
    def engine(table, own):
        """Return the arrays of a lane's stepper."""
        o = own + m.LANE_ARGUMENTS
        return data(integers(table[o]), floats(table[o + 1]), floats(table[o + 2]), integers(table[o + 3]))

    @kernel
    def proceed(table):
        """Advance each stepper to its next rates; return numbers of finished and waiting ones, and the lane of one."""
        done, waiting, last = 0, 0, 0
        for k in range(lanes):
            own = m.LANES_HEAD + m.LANE_WORDS * k
            o, d = own + m.LANE_ARGUMENTS, engine(table, own)
            if table[own] == m.LANE_READY:
                arrays = (table[o], table[o + 1], table[o + 2], table[o + 3])
                record = (table[o + 4], table[o + 5], table[o + 6], table[o + 7], table[o + 8])
                call(
                    table[own + m.LANE_FUNCTION],
                    (*arrays, 0.0, -1, *record, table[o + 9], table[o + 10], table[o + 11]),
                )
                table[own] = m.LANE_WAITING if d.stage > 0 else m.LANE_DONE
            if table[own] == m.LANE_DONE:
                done += 1
            elif table[own] == m.LANE_WAITING:
                waiting, last = waiting + 1, own
        return done, waiting, last

    @kernel
    def one_by_one(table):
        """Evaluate all awaited rates, one after the other."""
        for k in range(lanes):
            own = m.LANES_HEAD + m.LANE_WORDS * k
            if table[own] == m.LANE_WAITING:
                d = engine(table, own)
                awaited(d.h, d.f, d.w, d.n)
                table[own] = m.LANE_READY

    @kernel
    def together(table, places, numbers, spare):
        """Evaluate all awaited rates at once; lanes without a waiting stepper repeat another's, to its addresses."""
        for k in range(lanes):
            own = m.LANES_HEAD + m.LANE_WORDS * k
            waits = table[own] == m.LANE_WAITING
            stepper = own if waits else spare
            d = engine(table, stepper)
            for e in range(4):
                places[e * lanes + k] = table[stepper + m.LANE_ARGUMENTS + e]
            places[4 * lanes + k], places[5 * lanes + k] = d.awaited, d.rates_in
            if places[6 * lanes + k] != places[lanes + k]:
                places[6 * lanes + k] = places[lanes + k]
                note(d.h, d.f, numbers, k)
            if waits:
                laws(d.h, d.f, d.w, d.n, d.awaited_time)
                table[own] = m.LANE_READY
        evaluate(places, numbers)

    @kernel
    def run(table, places, numbers):
        while True:
            done, waiting, last = proceed(table)
            if done > 0 or table[m.LANES_CALLED_BACK] != 0 or waiting == 0:
                return
            if waiting <= few:
                one_by_one(table)
            else:
                together(table, places, numbers, last)

    return exactly(run)
