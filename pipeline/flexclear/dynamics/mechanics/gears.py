r"""Gears and racks: closures by which one joint coordinate follows another, :math:`q_2 = r\,q_1 + c`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from flexclear.dynamics.joints.conditions import along, second_rate
from flexclear.dynamics.mechanics.trees import End, Numbers, on_both, site_motion
from flexclear.dynamics.routines.calls import routine


@routine
def coupling(gauges: Sequence[Any], turns: Sequence[Numbers], numbers: Any, kept: int, *ends: End) -> Any:
    """Return residual [rad or m], its rate, and the rates of turns; then as `closures.closure` gamma and wrenches.

    gauges, turns: of the second coordinate, then of the first.  ends: of their joints.
    """
    (F2, G2, F1, G1), r = (site_motion(*end) for end in ends), numbers.ratio
    second, first = along(gauges[0], turns[0], F2, G2), along(gauges[1], turns[1], F1, G1)
    residual, rate = second.value - r * first.value - numbers.offset, second.rate - r * first.rate
    turning = [one.rate for one, before in zip((second, first), turns, strict=True) for _ in before]
    gamma = r * second_rate(gauges[1], F1, G1) - second_rate(gauges[0], F2, G2)
    wrenches = *on_both(ends[:2], G2, second.unit), *on_both(ends[2:], G1, first.unit * -r)
    return [residual, rate, *turning], [gamma][:kept], *([wrench][:kept] for wrench in wrenches)
