r"""Gears and racks: closures by which one joint coordinate follows another, :math:`q_2 = r\,q_1 + c`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from flexclear.dynamics.mechanics.coordinates import Gauge, along, bias
from flexclear.dynamics.mechanics.trees import End, Numbers, carried, on_both
from flexclear.dynamics.routines.calls import routine


@routine
def coupling(gauges: Sequence[Gauge], turns: Sequence[Numbers], ratio: Any, offset: Any, kept: int, *ends: End) -> Any:
    """Return residual [rad or m], its rate, and the rates of turns; then as `closures.closure` gamma and wrenches.

    gauges, turns: of the second coordinate, then of the first.  ends: of their joints.
    """
    joints = list(zip(gauges, turns, (ends[:2], ends[2:]), strict=True))
    frames = [[carried(*end) for end in both] for _, _, both in joints]
    second, first = (along(gauge, turn, *both) for (gauge, turn, _), both in zip(joints, frames, strict=True))
    rest_of_second, rest_of_first = (bias(gauge, *both) for gauge, both in zip(gauges, frames, strict=True))
    residual, rate = second.value - ratio * first.value - offset, second.rate - ratio * first.rate
    turning = [one.rate for one, before in zip((second, first), turns, strict=True) for _ in before]
    wrenches = [
        *on_both(*ends[:2], frames[0][1], second.unit),
        *on_both(*ends[2:], frames[1][1], first.unit * -ratio),
    ]
    gamma = [ratio * rest_of_first - rest_of_second]
    return [residual, rate, *turning], gamma[:kept], *([wrench][:kept] for wrench in wrenches)
