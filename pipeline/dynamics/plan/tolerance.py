"""The integrator and the tolerance of a planned run: the loosest whose error is a small share of what is wanted."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from flexclear.pipeline.core.scene.variants import Effect
from flexclear.pipeline.dynamics.plan.budget import Chosen
from flexclear.pipeline.dynamics.plan.pilots import RTOL, SMOOTH, SMOOTH_RTOL, Pilots

#: share of what is wanted that the integration may err by
SHARE = 0.15
#: tolerances that are tried, loosest first, down to that of the reference
TRIED = (1e-4, 1e-5, 1e-6)
STIFF_TRIED = (1e-3, 1e-4)
DEFAULT, TIGHT = "dop853", 1e-8


def smooth(pilots: Pilots, gone: Sequence[Effect], wanted: Mapping[str, float], level: int | None) -> Chosen:
    """Integrator and tolerance of the scene without what is gone, where that has no contacts.

    level: of modes of its flexible bodies; None: all.
    """
    if not pilots.variant(gone).flexible():
        return _loosest(pilots, gone, wanted, DEFAULT, TRIED, RTOL, level)
    found = _loosest(pilots, gone, wanted, SMOOTH, STIFF_TRIED, SMOOTH_RTOL, level)
    if found.rtol > SMOOTH_RTOL or _within(found.error, wanted):
        return found
    return Chosen(DEFAULT, TIGHT, {name: np.nan for name in wanted}, level)


def _within(error: Mapping[str, float], wanted: Mapping[str, float]) -> bool:
    return all(error[name] <= SHARE * wanted[name] for name in wanted)


def _loosest(
    pilots: Pilots,
    gone: Sequence[Effect],
    wanted: Mapping[str, float],
    integrator: str,
    tried: Sequence[float],
    reference: float,
    level: int | None,
) -> Chosen:
    """The loosest of the tolerances that is good enough beside the reference, which stands for itself."""
    there = pilots.point(gone, level=level, integrator=integrator, rtol=reference)
    error = dict.fromkeys(wanted, np.nan)
    tried = [rtol for rtol in tried if rtol > reference]
    for rtol in tried:
        apart = pilots.between(pilots.point(gone, level=level, integrator=integrator, rtol=rtol), there)
        error = {name: i.difference for name, i in apart.items()}
        if _within(error, wanted):
            return Chosen(integrator, rtol, error, level)
    if not tried:
        return Chosen(integrator, reference, error, level)
    # errors fall at least as the tolerance to the power 1/2
    fall = float(np.sqrt(reference / tried[-1]))
    return Chosen(integrator, reference, {name: fall * value for name, value in error.items()}, level)
