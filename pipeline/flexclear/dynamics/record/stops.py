"""Recorded wrenches of stops on the two frames of their joints."""

from __future__ import annotations

import numpy as np

from flexclear.dynamics.equations.observation import Observed
from flexclear.dynamics.model.model import Model
from flexclear.dynamics.model.stops import End


def on_stopped_frames(model: Model, seen: Observed) -> list[tuple[str, np.ndarray, np.ndarray]]:
    """Return all ends' wrenches on both frames: frame, moment about the mechanism's origin, force; (time, 3) each."""
    acting, numbering = [], model.numbering
    for c, (_, end, outer, inner) in enumerate(model.contacts):
        if not isinstance(end, End):
            continue
        a, b = (seen.sites[:, numbering.site(site)] for site in (outer, inner))
        moment, force = end.coordinate.wrench(a, b, -end.sense * seen.touch["normal_force"][:, c])
        acting += [(frame, sign * moment, sign * force) for frame, sign in zip(end.between, (-1.0, 1.0), strict=True)]
    return acting
