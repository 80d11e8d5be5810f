"""Losses of friction in ideal joints, and the explanation for states without a solution."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from flexclear.dynamics import memory as m
from flexclear.dynamics.model.model import Model

if TYPE_CHECKING:
    from flexclear.dynamics.run.evaluation.engine import Engine
    from flexclear.dynamics.run.ledger import Losses

#: reasons of a stop that do not depend on a jam in the last trial
OTHERWISE = (m.CAP_REACHED, m.NOT_A_NUMBER, m.STUCK_EVENT, m.STEPPED_OVER)


def losses(model: Model) -> Losses:
    """Return the loss variables of the joints (`run.ledger.Losses`)."""
    joints = model.scene.joints_with_friction().items()
    sites = [(model.mechanism.site(joint.between[0]), model.mechanism.site(joint.between[1])) for _, joint in joints]
    return "joint_friction_loss", "rubbing", sites, [f"the friction of joint {name}" for name, _ in joints]


def explanation(engine: Engine) -> str | None:
    """Return an explanation when the last evaluation jammed (no loads grow from those without friction), else None."""
    if engine.n[m.EVALUATION] != m.JAMMED or engine.n[m.STATUS] in OTHERWISE:
        return None
    names, gains = list(engine.model.scene.joints_with_friction()), _gains(engine)
    worst = int(np.argmax(gains))
    return (
        f"the friction of joint {names[worst]} increases its own normal force (by {gains[worst]:.3g} of "
        "each newton): the joint jams, and rigid bodies with Coulomb's law then have no motion or several "
        "(Painleve's paradox): use a smaller coefficient, a longer guide or a flexible body next to the joint"
    )


def _gains(engine: Engine) -> np.ndarray:
    """Return the normal force that friction of each joint adds to its own bearings, per normal force there."""
    arrays, size = engine.model.arrays, engine.model.arrays.size(m.SIZES["n_bearings"])
    reactions = engine.table(m.NAMED["reactions"]).reshape(-1, 1 + size)
    levers = arrays.table(m.NAMED["bearing_numbers"])["lever"]
    gains = []
    for row, part in zip(arrays.table(m.NAMED["rubbing"]), reactions, strict=True):
        own = range(row["bearing0"], row["bearing0"] + row["n_bearings"])
        loads = [
            np.linalg.norm(part[1 + e]["force"]) + 2.0 * levers[e] * np.linalg.norm(part[1 + e]["moment"]) for e in own
        ]
        gains.append(max(loads))
    return np.array(gains)
