"""Plan decisions with clearance: bodies that bend, number of modes, method and tolerance.

All are based on differences from one run of the whole mechanism at a loose tolerance, over as much time as it may
take; only the part of a difference that exceeds chance counts.
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

#: method of the candidates: next to impacts steps are short at any order, so order 5; and their first tolerance, looser
#: than that of the screening runs where these are tight
QUICK, QUICK_RTOL = "dopri5", 1e-4
#: reference of the candidates: the screening runs' method at a tolerance tighter by this factor, at least `TIGHTEST`
TIGHTER = 1e-2
#: energy error of a candidate over a part of the time: this fraction of a run's limit, times that part, at most
OF_LEDGER = 0.25
#: energy error that the planned run may then have: its effect on the requested quantities has been tested
LEDGER = 5e-3
#: levels of modes that leave more than this fraction of the variables save too little to be tested
WORTH = 0.85
#: differences beyond this multiple of the budget are not due to the tolerance
NEAR = 10.0
#: evaluations times variables of all screening runs beyond which no further candidate is tested
MOST_WORK = 3e8


def bent(search: Search, soft: Sequence[Effect]) -> None:
    """Decide between flexible and rigid bodies in a mechanism that keeps its clearance."""
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
    """Return the cheapest verified integration of a scene with contacts; default: the screening runs' method, tighter.

    All candidates are compared with that method at a tighter tolerance (TIGHTER), over the whole time if affordable:
    impacts make small errors grow. The screening runs' method at its own tolerance is no candidate: single members
    lose a few per cent of the energy where stability bounds the steps.
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
    """Return the error of an integration over the whole time, by quantity, and True when it fits into the budget.

    The observed difference with its uncertainty must fit, and so must the difference extrapolated to the whole time.
    """
    differences = search.pilots.same_starts(tried, there, search.requested)
    errors = {name: (1.0 + _more(fraction)) * i.difference for name, i in differences.items()}
    return errors, search.fits({name: max(errors[name], i.most) for name, i in differences.items()})


def _by_modes(search: Search, most: Mapping[str, float], effect_sizes: Mapping[str, Influence]) -> bool:
    """Return True when modes rather than tolerance cause a difference: it is large, or members diverge anyway."""
    return any(
        NEAR * BUDGET * requested < most[name] < np.inf or effect_sizes[name].uncertainty > requested
        for name, requested in search.requested.items()
    )


def _more(fraction: float) -> float:
    """Return the possible increase over the rest of the time, as a fraction."""
    return 0.0 if fraction == 1.0 else WHOLE


def _levels(search: Search) -> list[int]:
    """Return the levels of fewer modes that may be tested."""
    pilots = search.pilots
    bending = pilots.variant(search.gone).flexible()
    return [k for k in range(len(pilots.fewer)) if pilots.modes(k, bending) and pilots.saved(k) >= 1.0 / WORTH]


def _tried(search: Search, level: int | None, fraction: float, rtol: float, rival: Point) -> Point:
    """Run a level of modes at a tolerance; the run stops where it takes longer than another run of all modes, or loses
    energy too fast."""
    pilots = search.pilots
    saved = 1.0 if level is None else pilots.saved(level)
    limits: dict[str, Any] = {
        "evaluations": int(saved * rival.evaluations / MEMBERS) + 1,
        "ledger_tolerance": OF_LEDGER * CHOSEN * fraction,
    }
    return pilots.point(search.gone, level=level, fraction=fraction, integrator=QUICK, rtol=rtol, **limits)
