"""Where frames of flexible bodies are on their links when the run begins."""

from __future__ import annotations

import numpy as np

from flexclear.pipeline.core.numerics.rotations import rotation_vector_to_matrix
from flexclear.pipeline.dynamics.model.flexible_bodies import bow, frame_shapes, shift
from flexclear.pipeline.dynamics.model.mechanism import Mechanism, Site
from flexclear.pipeline.dynamics.model.merge import Placement


def start_place(mechanism: Mechanism, site: Site) -> Placement:
    """A site in the frame of its link, moved by the deformation with which the scene lets its body begin."""
    q, bundle = mechanism.deformation.get(site.link), mechanism.links[site.link].bundle
    if q is None or bundle is None or site.frame is None:
        return site.place
    label = site.frame.partition(".")[2]
    _, moves, turns = frame_shapes(bundle, label)
    rest = np.zeros((1, len(q)))
    shifted, _, _ = shift(moves, bow(mechanism, site.link, label), q[None], rest, rest)
    return Placement(site.place.p + shifted[0], rotation_vector_to_matrix(turns @ q) @ site.place.R)
