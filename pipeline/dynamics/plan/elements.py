"""How many finite elements a flexible body calls for, from its reduction on a finer mesh.

A run does not know the elements: they cost time once, when the body is reduced, and decide how right its frequencies
and its compliance are. So the reduction on twice as many elements is enough: by how much frequencies and
compliance change, and by how much at most what bending does to a quantity changes with them. Errors of beam elements
fall as the fourth power of their length (Strang and Fix, *An Analysis of the Finite Element Method*, ch. 1.6 and 6),
so the number that an accuracy calls for follows.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import xarray as xr

from flexclear.pipeline.core.artifacts.labelled import Labelled
from flexclear.pipeline.core.scene.plan_decisions import Mesh

#: twice as many elements are compared with; errors fall with this power of their length
TWICE, ORDER = 2, 4
#: fraction of the requested accuracy that the mesh may err by
FRACTION = 0.1
#: vibrations whose phase has gone wrong by more than this differ by twice their amplitude [rad]
TURNED = 2.0


def mesh(
    given: int,
    bundle: Labelled,
    finer: xr.Dataset,
    bending: Mapping[str, float],
    requested: Mapping[str, float],
    duration: float,
) -> Mesh:
    """The elements of a body.

    given: its number of elements.  bundle, finer: reduced from these and from twice as many.  bending: what its
    flexibility does to each quantity, at most.  duration: of the run [s], over which phases of vibrations part.
    """
    beyond = 1.0 / (1.0 - TWICE ** -float(ORDER))  # what twice as many elements lack still
    frequency, phase = _frequencies(bundle, finer, duration)
    compliance = _compliance(bundle, finer)
    fraction = beyond * max(compliance, min(TURNED, phase))
    error = {name: fraction * bending.get(name, np.inf) for name in requested}
    most = max(error[name] / (FRACTION * requested[name]) for name in requested)
    called_for = given * max(most, np.finfo(float).tiny) ** (1.0 / ORDER) if np.isfinite(most) else given
    return Mesh(given, max(1, int(np.ceil(called_for))), beyond * frequency, beyond * compliance, error)


def _frequencies(bundle: Labelled, finer: xr.Dataset, duration: float) -> tuple[float, float]:
    """Largest change of a frequency, as a fraction, and phase by which the lowest vibration is off in the end [rad]."""
    one, two = (np.sort(b["frequency"].values) for b in (bundle, finer))
    there = min(len(one), len(two))
    one, two = one[:there], two[:there]
    firm = two > 0.0
    if not firm.any():
        return 0.0, 0.0
    change = np.abs(one[firm] - two[firm])
    return float((change / two[firm]).max()), float(2.0 * np.pi * change[0] * duration)


def _compliance(bundle: Labelled, finer: xr.Dataset) -> float:
    """Largest change of an entry of the frames' compliance, as a fraction of those of its two directions."""
    one, two = (_matrix(b) for b in (bundle, finer))
    scale = np.sqrt(np.abs(np.outer(np.diag(two), np.diag(two))))
    least = np.finfo(float).eps * scale.max(initial=0.0)
    return float((np.abs(one - two)[scale > least] / scale[scale > least]).max(initial=0.0))


def _matrix(bundle: Labelled) -> np.ndarray:
    """Motions of all frames under unit loads there, shape (6 frames, 6 frames), in the body frame."""
    shapes = np.concatenate([bundle["frame_translation_shape"].values, bundle["frame_rotation_shape"].values], axis=1)
    moved = shapes.reshape(-1, shapes.shape[-1])
    compliance: np.ndarray = moved @ np.linalg.solve(bundle["modal_stiffness"].values, moved.T)
    return compliance
