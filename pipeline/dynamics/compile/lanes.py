"""Steppers side by side: each runs until it needs an evaluation, then all those are made at once.

Whatever a stepper is at (a first step, a stage, a rejected step, an event that is searched for), what it waits for is
an evaluation, and so all lanes are in use as long as there is a stepper for each. None knows of the others.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from numba import types
from numba.extending import intrinsic

from flexclear.pipeline.dynamics.compile.calls import call
from flexclear.pipeline.dynamics.compile.stacks import (
    ALONE,
    DONE,
    GIVEN,
    HEAD,
    READY,
    STATE,
    TIME,
    WAITING,
    WANTED,
)
from flexclear.pipeline.dynamics.kernels import kernel
from flexclear.pipeline.dynamics.specialise.straight import exactly

#: all lanes at once take as long as this fraction of them does one by one
FEW = 4


def _pointer(kind: Any) -> Any:
    """What makes of an address [integer] an address in an array."""

    @intrinsic
    def pointer(typingctx: Any, address: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
            return builder.inttoptr(values[0], context.get_value_type(types.CPointer(kind)))

        return types.CPointer(kind)(address), generate

    return pointer


integers, floats = _pointer(types.int64), _pointer(types.float64)


def make_lanes(laws: Callable, note: Callable, abreast: Callable, lanes: int) -> Callable:
    """The kernel run(table, places, numbers, resume), which comes back when a function has, or when it is called back.

    table: HEAD, then addresses of the records.  places: room for 6 lanes words, then for whose numbers are in which
    lane, 0 where they are to be put there again.  numbers: as of `straight.abreast`.  resume: address of `stacks`'
    function.
    """
    few = lanes // FEW

    @kernel
    def let_run(table, resume):
        """Each function on to its next evaluation: how many have come back and how many wait, the record of one."""
        done, waiting, last = 0, 0, 0
        for k in range(lanes):
            record = integers(table[HEAD + k])
            if record[STATE] == READY:
                call(resume, (table[HEAD + k],))
            if record[STATE] == DONE:
                done += 1
            elif record[STATE] == WAITING:
                waiting, last = waiting + 1, table[HEAD + k]
        return done, waiting, last

    @kernel
    def one_by_one(table):
        """All evaluations that are awaited, each alone."""
        for k in range(lanes):
            own = integers(table[HEAD + k])
            if own[STATE] == WAITING:
                h, f, w, n = (
                    integers(own[GIVEN]),
                    floats(own[GIVEN + 1]),
                    floats(own[GIVEN + 2]),
                    integers(own[GIVEN + 3]),
                )
                call(table[ALONE], (h, f, w, n, floats(table[HEAD + k])[TIME], own[GIVEN + 4], own[GIVEN + 5]))
                own[STATE] = READY

    @kernel
    def evaluate(table, places, numbers, spare):
        """All evaluations that are awaited; lanes without one repeat another's, to the same places."""
        for k in range(lanes):
            own = integers(table[HEAD + k])
            record = own if own[STATE] == WAITING else integers(spare)
            for e in range(6):
                places[e * lanes + k] = record[GIVEN + e]
            if places[6 * lanes + k] != record[GIVEN + 1]:
                places[6 * lanes + k] = record[GIVEN + 1]
                note(integers(record[GIVEN]), floats(record[GIVEN + 1]), numbers, k)
            if own[STATE] == WAITING:
                h, f = integers(own[GIVEN]), floats(own[GIVEN + 1])
                w, n = floats(own[GIVEN + 2]), integers(own[GIVEN + 3])
                laws(h, f, w, n, floats(table[HEAD + k])[TIME])
                own[STATE] = READY
        abreast(places, numbers)

    @kernel
    def run(table, places, numbers, resume):
        while True:
            done, waiting, last = let_run(table, resume)
            if done > 0 or table[WANTED] != 0 or waiting == 0:
                return
            if waiting <= few and table[ALONE] != 0:
                one_by_one(table)
            else:
                evaluate(table, places, numbers, last)

    return exactly(run)
