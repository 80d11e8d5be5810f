"""Attempts of several steppers made together, one in each lane of the processor's vectors.

Each stepper proceeds alone until an attempt waits for the rates of a state (`integrate.method.await_rates`): the next
stage, or the end of the step. All those are then evaluated at once. First steps, searches for events and projections a
stepper evaluates by itself, while the others wait. None knows of the others, and they may be at different stages.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from numba import types
from numba.extending import intrinsic

from flexclear.pipeline.dynamics import memory as m
from flexclear.pipeline.dynamics.compile.calls import awaited, call, laws
from flexclear.pipeline.dynamics.fields import data
from flexclear.pipeline.dynamics.kernels import kernel
from flexclear.pipeline.dynamics.specialise.batched import exactly

#: all lanes at once take as long as this fraction of them does one by one
LANE_COST = 4


def _pointer(kind: Any) -> Any:
    """What makes of an address [integer] an address in an array."""

    @intrinsic
    def pointer(typingctx: Any, address: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
            return builder.inttoptr(values[0], context.get_value_type(types.CPointer(kind)))

        return types.CPointer(kind)(address), generate

    return pointer


integers, floats = _pointer(types.int64), _pointer(types.float64)


def make_lanes(note: Callable, evaluate: Callable, lanes: int) -> Callable:
    """The kernel run(table, places, numbers), which comes back when a stepper has, or when it is called back.

    table: see `memory.LANE_WORDS`. places: room for 6 lanes words, then for whose numbers are in which lane, 0 where
    they are to be put there again. numbers: as of `specialise.batched`.
    """
    few = lanes // LANE_COST

    @kernel
    def engine(table, own):
        """The arrays of a lane's stepper."""
        o = own + m.LANE_ARGUMENTS
        return data(integers(table[o]), floats(table[o + 1]), floats(table[o + 2]), integers(table[o + 3]))

    @kernel
    def proceed(table):
        """Each stepper on to its next rates: how many have come to their end and how many wait, the lane of one."""
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
        """All rates that are awaited, each alone."""
        for k in range(lanes):
            own = m.LANES_HEAD + m.LANE_WORDS * k
            if table[own] == m.LANE_WAITING:
                d = engine(table, own)
                awaited(d.h, d.f, d.w, d.n)
                table[own] = m.LANE_READY

    @kernel
    def together(table, places, numbers, spare):
        """All rates that are awaited; lanes without a stepper repeat another's, to the same places."""
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
