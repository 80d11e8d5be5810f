"""The integrator and the tolerance of a planned run: the loosest whose error is a small share of what is wanted."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from flexclear.pipeline.core.scene.variants import Effect
from flexclear.pipeline.dynamics.plan.pilots import RTOL, SMOOTH, SMOOTH_RTOL, Pilots

#: share of what is wanted that the integration may err by
SHARE = 0.15
#: tolerances that are tried, loosest first, down to that of the reference
TRIED = (1e-4, 1e-5, 1e-6)
STIFF_TRIED = (1e-3, 1e-4)
DEFAULT, TIGHT = "dop853", 1e-8


def chosen_solver(
    pilots: Pilots, gone: Sequence[Effect], wanted: Mapping[str, float], *, fewer: bool
) -> tuple[str, float, dict[str, float]]:
    """Integrator, tolerance, and estimated errors by quantity [SI] of the scene without what is gone.

    fewer: whether its flexible bodies have fewer modes.
    """
    scene = pilots.variant(gone)
    contacts, flexible = bool(scene.contacts() or scene.stop), bool(scene.flexible())
    if contacts and flexible:
        # that of the pilots with which it was decided; a search would take as long as the run
        return DEFAULT, pilots.loose(scene), {name: np.nan for name in wanted}
    if flexible:
        found = _loosest(pilots, gone, wanted, SMOOTH, STIFF_TRIED, SMOOTH_RTOL, fewer=fewer)
        if found[1] > SMOOTH_RTOL or _within(found[2], wanted):
            return found
        return DEFAULT, TIGHT, {name: np.nan for name in wanted}
    return _loosest(pilots, gone, wanted, DEFAULT, TRIED, pilots.loose(scene) if contacts else RTOL)


def _within(error: Mapping[str, float], wanted: Mapping[str, float]) -> bool:
    return all(error[name] <= SHARE * wanted[name] for name in wanted)


def _loosest(
    pilots: Pilots,
    gone: Sequence[Effect],
    wanted: Mapping[str, float],
    integrator: str,
    tried: Sequence[float],
    reference: float,
    *,
    fewer: bool = False,
) -> tuple[str, float, dict[str, float]]:
    """The loosest of the tolerances that is good enough beside the reference, which stands for itself."""
    there = pilots.point(gone, fewer=fewer, integrator=integrator, rtol=reference)
    error = dict.fromkeys(wanted, np.nan)
    tried = [rtol for rtol in tried if rtol > reference]
    for rtol in tried:
        apart = pilots.between(pilots.point(gone, fewer=fewer, integrator=integrator, rtol=rtol), there)
        error = {name: i.difference for name, i in apart.items()}
        if _within(error, wanted):
            return integrator, rtol, error
    if not tried:
        return integrator, reference, error
    # errors fall at least as the tolerance to the power 1/2
    fall = float(np.sqrt(reference / tried[-1]))
    return integrator, reference, {name: fall * value for name, value in error.items()}
