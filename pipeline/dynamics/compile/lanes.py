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
from flexclear.pipeline.dynamics.compile.stacks import DONE, GIVEN, HEAD, READY, STATE, TIME, WAITING
from flexclear.pipeline.dynamics.kernels import kernel
from flexclear.pipeline.dynamics.specialise.straight import exactly


def _pointer(kind: Any) -> Any:
    """What makes of an address [integer] a place in an array."""

    @intrinsic
    def pointer(typingctx: Any, address: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
            return builder.inttoptr(values[0], context.get_value_type(types.CPointer(kind)))

        return types.CPointer(kind)(address), generate

    return pointer


integers, floats = _pointer(types.int64), _pointer(types.float64)


def make_lanes(laws: Callable, abreast: Callable, lanes: int) -> Callable:
    """The kernel run(table, places, resume), which comes back when a function has, or when it is called back.

    table: HEAD, then addresses of the records.  places: room for 6 lanes words.  resume: address of `stacks`' function.
    """

    @kernel
    def let_run(table, resume):
        """Each function on to its next evaluation: how many have come back, and the record of one that waits."""
        done, waiting = 0, 0
        for k in range(lanes):
            record = integers(table[HEAD + k])
            if record[STATE] == READY:
                call(resume, (table[HEAD + k],))
            if record[STATE] == DONE:
                done += 1
            elif record[STATE] == WAITING:
                waiting = table[HEAD + k]
        return done, waiting

    @kernel
    def evaluate(table, places, spare):
        """All evaluations that are waited for; lanes without one repeat another's, to the same places."""
        for k in range(lanes):
            own = integers(table[HEAD + k])
            record = own if own[STATE] == WAITING else integers(spare)
            for e in range(6):
                places[e * lanes + k] = record[GIVEN + e]
            if own[STATE] == WAITING:
                h, f = integers(own[GIVEN]), floats(own[GIVEN + 1])
                w, n = floats(own[GIVEN + 2]), integers(own[GIVEN + 3])
                laws(h, f, w, n, floats(table[HEAD + k])[TIME])
                own[STATE] = READY
        abreast(places)

    @kernel
    def run(table, places, resume):
        while True:
            done, waiting = let_run(table, resume)
            if done > 0 or table[0] != 0 or waiting == 0:
                return
            evaluate(table, places, waiting)

    return exactly(run)
