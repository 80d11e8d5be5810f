"""Recorded wrenches of stops on the two frames of their joints."""

from __future__ import annotations

import numpy as np

from flexclear.dynamics.equations.observation import Observed
from flexclear.dynamics.model.model import Model
from flexclear.dynamics.model.stops import End


def on_stopped_frames(model: Model, seen: Observed) -> list[tuple[str, np.ndarray, np.ndarray]]:
    """Return all ends' wrenches on both frames: frame, moment about the mechanism's origin, force; (time, 3) each."""
    acting, numbering = [], model.numbering
    for c, (_, end, *both, others) in enumerate(model.contacts):
        if not isinstance(end, End):
            continue
        size, sites = -end.sense * seen.touch["normal_force"][:, c], [numbering.site(site) for site in (*both, *others)]
        for k, ((_, coordinate), factor) in enumerate(zip(end.parts, (1.0, -end.ratio), strict=False)):
            here = slice(2 * k, 2 * k + 2)
            a, b = (seen.sites[:, site] for site in sites[here])
            moment, force = coordinate.wrench(a, b, factor * size)
            frames = zip(end.frames[here], (-1.0, 1.0), strict=True)
            acting += [(frame, sign * moment, sign * force) for frame, sign in frames]
    return acting
