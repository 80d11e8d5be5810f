"""Decisions where joints stay loose: which bodies bend, with how many modes, by which method and at which tolerance.

All of them are differences from one run of the whole mechanism at a loose tolerance, over as much of the time as it may
take, and count by what exceeds chance.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from flexclear.pipeline.core.artifacts.effect_size import Influence
from flexclear.pipeline.core.artifacts.points import Point
from flexclear.pipeline.core.scene.integrators import DEFAULT
from flexclear.pipeline.core.scene.variants import Effect
from flexclear.pipeline.dynamics.plan.budget import AS_IT_IS, BUDGET, WHOLE, Chosen, Search, most_of, with_doubt
from flexclear.pipeline.dynamics.plan.screening_runs import MEMBERS, OF_TIGHT, longest
from flexclear.pipeline.dynamics.plan.tolerance import TIGHTEST
from flexclear.pipeline.dynamics.run.ledger import CHOSEN

#: what is tried: next to impacts steps are short whatever the order, so the method of order 5, at a tolerance that is
#: looser than that of the pilots where these are tight
QUICK, QUICK_RTOL = "dopri5", 1e-4
#: what they are compared with: the pilots' method at so much tighter a tolerance, at most `TIGHTEST`
TIGHTER = 1e-2
#: of the largest energy error of a run, what one over a part of the time may have, as a fraction of that part
OF_LEDGER = 0.25
#: energy error that the planned run may have then: what it does to the requested quantities has been tested
LEDGER = 5e-3
#: levels of modes that leave more than this fraction of the variables save too little to be tried
WORTH = 0.85
#: differences beyond so many budgets are not of the tolerance
NEAR = 10.0
#: evaluations times variables of all pilots beyond which nothing more is tried
MOST_WORK = 3e8


def bent(search: Search, soft: Sequence[Effect]) -> None:
    """Decide between flexible and rigid bodies in a mechanism that stays loose."""
    pilots, gone = search.pilots, search.gone
    for fraction in sorted({pilots.part(gone), pilots.whole(gone)}):
        there = pilots.must_run(gone, fraction)
        seen = pilots.between(pilots.point([*gone, *soft], fraction=fraction), there)
        seen = with_doubt(search, seen, False, _more(fraction))
        most = most_of(seen)
        if not search.fits(most):
            break
    small = search.fits(most)
    if small:
        search.spend(most)
    for effect in soft:
        search.judge(effect, "with or without bending the loose joints do the same" if small else "", most, seen)


def quickest(search: Search) -> Chosen:
    """The cheapest way to integrate what is left of a scene with contacts; the pilots' method, tighter, where none is
    shown to do.

    All are compared with that at a tolerance that is TIGHTER than the pilots', over the whole time if that can be had:
    impacts make small errors grow. The pilots' method at their own tolerance is none of them: of its members, single
    ones lose a few per cent of the energy where stability bounds the steps.
    """
    pilots, gone = search.pilots, search.gone
    loose = pilots.loose(pilots.variant(gone))
    tight, most = max(TIGHTER * loose, TIGHTEST), OF_TIGHT * pilots.extent.most
    unknown = Chosen(DEFAULT, tight, dict.fromkeys(search.requested, np.nan))
    fraction, there = longest(
        pilots.whole(gone), lambda part: pilots.point(gone, fraction=part, rtol=tight, evaluations=most)
    )
    if there.refused:
        return unknown
    levels = _levels(search)
    for rtol in (QUICK_RTOL, loose):
        for level in [*levels, None]:
            if pilots.work > MOST_WORK:
                return unknown
            tried = _tried(search, level, fraction, rtol, there)
            errors, fits = _errors(search, tried, there, fraction)
            if fits:
                search.spend(errors)
                taken = [point.evaluations / (MEMBERS * fraction) for point in (tried, there)]
                return Chosen(QUICK, rtol, errors, level, LEDGER, *taken)
            if level is not None and _by_modes(search, errors, pilots.between(tried, there)):
                levels = [k for k in levels if k != level]
    near = all(errors[name] <= NEAR * BUDGET * requested for name, requested in search.requested.items())
    return unknown if near else AS_IT_IS


def _errors(search: Search, tried: Point, there: Point, fraction: float) -> tuple[dict[str, float], bool]:
    """What a way to integrate errs by over the whole time, by quantity, and whether it may.

    What was seen, chance included, must fit into the budget, and with what the rest of the time may add, as well.
    """
    differences = search.pilots.same_starts(tried, there, search.requested)
    errors = {name: (1.0 + _more(fraction)) * i.difference for name, i in differences.items()}
    return errors, search.fits({name: max(errors[name], i.most) for name, i in differences.items()})


def _by_modes(search: Search, most: Mapping[str, float], effect_sizes: Mapping[str, Influence]) -> bool:
    """Whether a difference is rather due to the modes than to the tolerance: it is large, or members part anyway."""
    return any(
        NEAR * BUDGET * requested < most[name] < np.inf or effect_sizes[name].uncertainty > requested
        for name, requested in search.requested.items()
    )


def _more(fraction: float) -> float:
    """What the rest of the time may add, as a fraction."""
    return 0.0 if fraction == 1.0 else WHOLE


def _levels(search: Search) -> list[int]:
    """Levels of fewer modes that may be tried."""
    pilots = search.pilots
    bending = pilots.variant(search.gone).flexible()
    return [k for k in range(len(pilots.fewer)) if pilots.modes(k, bending) and pilots.saved(k) >= 1.0 / WORTH]


def _tried(search: Search, level: int | None, fraction: float, rtol: float, rival: Point) -> Point:
    """A run of a level of modes at a tolerance, given up where it takes longer than another run of all modes, or
    loses energy too fast."""
    pilots = search.pilots
    saved = 1.0 if level is None else pilots.saved(level)
    limits: dict[str, Any] = {
        "evaluations": int(saved * rival.evaluations / MEMBERS) + 1,
        "ledger_tolerance": OF_LEDGER * CHOSEN * fraction,
    }
    return pilots.point(search.gone, level=level, fraction=fraction, integrator=QUICK, rtol=rtol, **limits)
