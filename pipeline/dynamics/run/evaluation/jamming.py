"""Friction of ideal joints that has no solution, in words."""

from __future__ import annotations

import numpy as np

from flexclear.pipeline.dynamics import memory as m
from flexclear.pipeline.dynamics.run.evaluation.engine import Engine


def jammed(engine: Engine) -> bool:
    """Whether the last evaluation found no loads of the bearings that friction could grow to."""
    return bool(engine.n[m.EVALUATION] == m.JAMMED)


def explanation(engine: Engine) -> str:
    """Why it did not, and what helps."""
    names, gains = list(engine.model.scene.rubbing()), _gains(engine)
    worst = int(np.argmax(gains))
    return (
        f"the friction of joint {names[worst]} presses the joint the more, the more it rubs (by {gains[worst]:.3g} of "
        "each newton): it jams, and rigid bodies with Coulomb's law have no motion there, or several (Painleve's "
        "paradox); a smaller coefficient, a longer guide or a flexible body next to the joint is the remedy"
    )


def _gains(engine: Engine) -> np.ndarray:
    """How much friction of each joint adds to the normal forces of its own bearings, per normal force there."""
    arrays, size = engine.model.arrays, engine.model.arrays.size(m.N_BEARINGS)
    reactions = engine.table(m.REACTIONS).reshape(-1, 1 + size)
    levers = arrays.table(m.BEARING_NUMBERS)["lever"]
    gains = []
    for row, mine in zip(arrays.table(m.RUBBING), reactions, strict=True):
        own = range(row["bearing0"], row["bearing0"] + row["n_bearings"])
        felt = [
            np.linalg.norm(mine[1 + e]["force"]) + 2.0 * levers[e] * np.linalg.norm(mine[1 + e]["moment"]) for e in own
        ]
        gains.append(max(felt))
    return np.array(gains)
