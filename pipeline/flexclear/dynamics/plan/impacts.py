"""Plan decisions with clearance: bodies that bend, number of modes, method and tolerance.

All are based on differences from one run of the whole mechanism at a loose tolerance, over as much time as it may
take; only the part of a difference that exceeds chance counts.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from flexclear.artifacts.effect_size import Influence
from flexclear.artifacts.points import Point
from flexclear.dynamics.plan.budget import BUDGET, UNCHANGED, Integration, Search, possible_increase
from flexclear.dynamics.plan.screening_runs import MEMBERS, OF_TIGHT, longest_affordable
from flexclear.dynamics.plan.tolerance import TIGHTEST
from flexclear.dynamics.run.ledger import CHOSEN
from flexclear.scene.integrators import DEFAULT
from flexclear.scene.variants import Effect

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


def decide_bending(search: Search, soft: Sequence[Effect]) -> None:
    """Decide between flexible and rigid bodies in a mechanism that keeps its clearance."""
    runs, dropped = search.runs, search.dropped
    for fraction in sorted({runs.affordable_part(dropped), runs.examined_part(dropped)}):
        full = runs.must_run(dropped, fraction)
        sizes, upper = search.compare(runs.point([*dropped, *soft], fraction=fraction), full, fraction=fraction)
        if not search.fits(upper):
            break
    small = search.fits(upper)
    if small:
        search.spend(upper)
    for effect in soft:
        search.judge(effect, "bending does not change the clearance response" if small else "", upper, sizes)


def choose_with_contacts(search: Search) -> Integration:
    """Return the cheapest verified integration of a scene with contacts; default: the screening runs' method, tighter.

    All candidates are compared with that method at a tighter tolerance (TIGHTER), over the whole time if affordable:
    impacts make small errors grow. The screening runs' method at its own tolerance is no candidate: single members
    lose a few per cent of the energy where stability bounds the steps.
    """
    runs, dropped = search.runs, search.dropped
    loose = runs.loose_tolerance(runs.variant(dropped))
    tight, limit = max(TIGHTER * loose, TIGHTEST), OF_TIGHT * runs.extent.most
    unknown = Integration(DEFAULT, tight, dict.fromkeys(search.requested, np.nan))
    fraction, reference = longest_affordable(
        runs.examined_part(dropped), lambda part: runs.point(dropped, fraction=part, rtol=tight, evaluations=limit)
    )
    if reference.refused:
        return unknown
    levels = _levels_to_test(search)
    for rtol in (QUICK_RTOL, loose):
        for level in [*levels, None]:
            if runs.work > MOST_WORK:
                return unknown
            tried = _run_candidate(search, level, fraction, rtol, reference)
            errors, fits = _integration_errors(search, tried, reference, fraction)
            if fits:
                search.spend(errors)
                taken = [point.evaluations / (MEMBERS * fraction) for point in (tried, reference)]
                return Integration(QUICK, rtol, errors, level, LEDGER, *taken)
            if level is not None and _is_due_to_modes(search, errors, runs.differences(tried, reference)):
                levels = [k for k in levels if k != level]
    near = all(errors[name] <= NEAR * BUDGET * requested for name, requested in search.requested.items())
    return unknown if near else UNCHANGED


def _integration_errors(
    search: Search, tried: Point, reference: Point, fraction: float
) -> tuple[dict[str, float], bool]:
    """Return the error of an integration over the whole time, by quantity, and True when it fits into the budget.

    The observed difference with its uncertainty must fit, and so must the difference extrapolated to the whole time.
    """
    differences = search.runs.paired_differences(tried, reference, search.requested)
    errors = {name: (1.0 + possible_increase(fraction)) * i.difference for name, i in differences.items()}
    return errors, search.fits({name: max(errors[name], i.most) for name, i in differences.items()})


def _is_due_to_modes(search: Search, errors: Mapping[str, float], sizes: Mapping[str, Influence]) -> bool:
    """Return True when modes rather than tolerance cause a difference: it is large, or members diverge anyway."""
    return any(
        NEAR * BUDGET * requested < errors[name] < np.inf or sizes[name].uncertainty > requested
        for name, requested in search.requested.items()
    )


def _levels_to_test(search: Search) -> list[int]:
    """Return the levels of fewer modes that may be tested."""
    runs = search.runs
    bending = runs.variant(search.dropped).flexible()
    return [k for k in range(len(runs.fewer)) if runs.modes(k, bending) and runs.saved_work(k) >= 1.0 / WORTH]


def _run_candidate(search: Search, level: int | None, fraction: float, rtol: float, rival: Point) -> Point:
    """Run a level of modes at a tolerance; the run stops where it takes longer than another run of all modes, or loses
    energy too fast."""
    runs = search.runs
    saved = 1.0 if level is None else runs.saved_work(level)
    limits: dict[str, Any] = {
        "evaluations": int(saved * rival.evaluations / MEMBERS) + 1,
        "ledger_tolerance": OF_LEDGER * CHOSEN * fraction,
    }
    return runs.point(search.dropped, level=level, fraction=fraction, integrator=QUICK, rtol=rtol, **limits)
