"""Number of finite elements that a flexible body needs, from its reduction on a finer mesh.

Elements do not enter a run: they cost time once, when the body is reduced, and determine the errors of its frequencies
and its compliance. The reduction on twice as many elements is therefore enough: it gives the changes of frequencies and
compliance, and a bound for the change of the effect of bending on a quantity. Errors of beam elements
fall as the fourth power of their length (Strang and Fix, *An Analysis of the Finite Element Method*, ch. 1.6 and 6),
so the number for a requested accuracy follows.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import xarray as xr

from flexclear.artifacts.labelled import Labelled
from flexclear.scene.plan_decisions import Mesh

#: refinement of the compared mesh; errors decrease with this power of the element length
TWICE, ORDER = 2, 4
#: fraction of the requested accuracy that the error of the mesh may take
FRACTION = 0.1
#: vibrations with a phase error above this differ by twice their amplitude [rad]
TURNED = 2.0


def mesh(
    given: int,
    bundle: Labelled,
    finer: xr.Dataset,
    bending: Mapping[str, float],
    requested: Mapping[str, float],
    duration: float,
) -> Mesh:
    """Return the required number of elements of a body.

    given: its number of elements.  bundle, finer: reduced from these and from twice as many.  bending: bound of its
    flexibility's effect on each quantity.  duration: of the run [s], over which phases of vibrations diverge.
    """
    beyond = 1.0 / (1.0 - TWICE ** -float(ORDER))  # includes the remaining error of twice as many elements
    frequency, phase = _frequencies(bundle, finer, duration)
    compliance = _compliance(bundle, finer)
    fraction = beyond * max(compliance, min(TURNED, phase))
    error = {name: fraction * bending.get(name, np.inf) for name in requested}
    largest = max(error[name] / (FRACTION * requested[name]) for name in requested)
    called_for = given * max(largest, np.finfo(float).tiny) ** (1.0 / ORDER) if np.isfinite(largest) else given
    return Mesh(given, max(1, int(np.ceil(called_for))), beyond * frequency, beyond * compliance, error)


def _frequencies(bundle: Labelled, finer: xr.Dataset, duration: float) -> tuple[float, float]:
    """Return the largest relative change of a frequency, and the final phase error of the lowest vibration [rad]."""
    one, two = (np.sort(b["frequency"].values) for b in (bundle, finer))
    count = min(len(one), len(two))
    one, two = one[:count], two[:count]
    firm = two > 0.0
    if not firm.any():
        return 0.0, 0.0
    change = np.abs(one[firm] - two[firm])
    return float((change / two[firm]).max()), float(2.0 * np.pi * change[0] * duration)


def _compliance(bundle: Labelled, finer: xr.Dataset) -> float:
    """Return the largest change of an entry of the frames' compliance, as a fraction of those of its two directions."""
    one, two = (_matrix(b) for b in (bundle, finer))
    scale = np.sqrt(np.abs(np.outer(np.diag(two), np.diag(two))))
    least = np.finfo(float).eps * scale.max(initial=0.0)
    return float((np.abs(one - two)[scale > least] / scale[scale > least]).max(initial=0.0))


def _matrix(bundle: Labelled) -> np.ndarray:
    """Return motions of all frames under unit loads there, shape (6 frames, 6 frames), in the body frame."""
    shapes = np.concatenate([bundle["frame_translation_shape"].values, bundle["frame_rotation_shape"].values], axis=1)
    moved = shapes.reshape(-1, shapes.shape[-1])
    compliance: np.ndarray = moved @ np.linalg.solve(bundle["modal_stiffness"].values, moved.T)
    return compliance
