"""Stresses of solids: the fields of their bundles times what their factors are in each row.

The factors are modal coordinates, forces and moments of the frames, accelerations of the body frame and of the modes
(`structure/stress/solid.py` says why that is the method of mode acceleration).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from flexclear.pipeline.core.numerics.rotations import skew, von_mises
from flexclear.pipeline.dynamics.record.body_loads import Motion

if TYPE_CHECKING:
    from flexclear.pipeline.core.artifacts.labelled import Labelled

#: components of stress that are held at once; bounds the memory
COMPONENTS_AT_ONCE = 10_000_000


def factors(bundle: Labelled, motion: Motion, moment: np.ndarray, force: np.ndarray) -> np.ndarray:
    """What each field of a solid's bundle is multiplied by, in SI, shape (time, field).

    moment, force: as `body_loads.motion_and_loads` returns them.
    """
    origins = bundle["frame_position"].values + np.einsum(
        "fim,tm->tfi", bundle["frame_translation_shape"].values, motion.q, optimize=True
    )
    loads = np.concatenate([force, moment - np.cross(origins, force)], axis=2)
    W = skew(motion.omega)
    slope = skew(motion.alpha) + W @ W  # acceleration per position in the body
    rows = len(motion.a)
    return np.hstack([motion.q, loads.reshape(rows, -1), motion.a, slope.reshape(rows, 9), motion.du])


def gauge_nodes(bundle: Labelled) -> dict[str, np.ndarray]:
    """Nodes of the whole surface, by the empty name, where stress is none of an artefact; and of each gauge."""
    nodes = {"": np.flatnonzero(bundle["node_doubtful"].values == 0)}
    for k, name in enumerate(bundle["gauge"].values.tolist()):
        nodes[name] = bundle["gauge_node"].values[bundle["gauge_index"].values == k]
    return nodes


def largest(field: np.ndarray, factor: np.ndarray, groups: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Stress of each group at its node of largest von Mises stress (time, group, 6), and that node, (time, group).

    field: shape (node, 6, field).  factor: shape (time, field).
    """
    tensor = np.empty((len(factor), len(groups), 6))
    node = np.empty((len(factor), len(groups)), dtype=np.int64)
    flat = np.ascontiguousarray(field.reshape(-1, field.shape[2]).T)
    step = max(1, COMPONENTS_AT_ONCE // flat.shape[1])
    for start in range(0, len(factor), step):
        part = slice(start, start + step)
        stress = (factor[part] @ flat).reshape(-1, *field.shape[:2])
        size, row = von_mises(stress), np.arange(len(stress))
        for k, nodes in enumerate(groups):
            node[part, k] = nodes[np.argmax(size[:, nodes], axis=1)]
            tensor[part, k] = stress[row, node[part, k]]
    return tensor, node
