"""Motions that no mass resists: a rod without inertia about its axis that is free to spin, a point on a ball joint."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy.linalg

from pipeline.core.errors import InputError
from pipeline.dynamics.model.assembly import LEAST_GYRATION
from pipeline.dynamics.model.merge import Placement
from pipeline.dynamics.model.model import Model

#: a motion has no mass when it has this share of what it would have if every body resisted turning about all axes alike
ZERO = 1e-14
#: share of the largest by which a link takes part in such a motion
TAKES_PART = 1e-3


def refuse(model: Model, poses: Sequence[Placement], twists: np.ndarray, free: np.ndarray) -> None:
    """InputError when rigid bodies can move without any of their masses moving.

    twists: unit motions of every column of the numbering, (columns, 6); free: those of them that open no closure,
    (nv, mobility).  Flexible bodies are left to the engine, whose mass matrix knows their modes.
    """
    links, nv, L = model.mechanism.links, model.numbering.nv, model.mechanism.length
    if any(link.flexible for link in links):
        return
    moved = np.zeros((len(links), 6, nv))
    own, even = np.zeros((nv, nv)), np.zeros((nv, nv))
    for i, link in enumerate(links[1:], start=1):
        for coordinate, column in model.numbering.joint_route(i):
            if coordinate < nv:
                moved[i, :, coordinate] = twists[column] / ([1.0] * 3 + [L] * 3)
        if link.inertia is not None:
            m, com, inertia = link.inertia
            turning, R = moved[i, :3], poses[i].R
            moving = moved[i, 3:] + np.cross(turning, poses[i].of(Placement(com)).p / L, axis=0)
            most = np.linalg.eigvalsh(inertia)[-1] / L**2 + m * LEAST_GYRATION**2
            own += m * moving.T @ moving + turning.T @ (R @ inertia @ R.T / L**2) @ turning
            even += m * moving.T @ moving + most * turning.T @ turning
    motion = _without_mass(free.T @ own @ free, free.T @ even @ free)
    if motion is not None:
        _refuse(model, moved @ (free @ motion))


def _without_mass(own: np.ndarray, even: np.ndarray) -> np.ndarray | None:
    """A motion for which a mass matrix has nothing of what another one has, or None."""
    sizes = np.sqrt(even.diagonal())
    scaled = even / np.outer(sizes, sizes) if sizes.all() else np.zeros_like(even)
    if not np.linalg.eigvalsh(scaled)[0] > ZERO:
        return None  # of links within a joint, which have no mass, in a singular pose: the engine says so
    values, vectors = scipy.linalg.eigh(own / np.outer(sizes, sizes), scaled)
    return vectors[:, 0] / sizes if values[0] <= ZERO else None


def _refuse(model: Model, twists: np.ndarray) -> None:
    """twists: of every link in the motion, (links, 6)."""
    sizes = np.abs(twists).max(axis=1)
    links = [link for link, size in zip(model.mechanism.links, sizes, strict=True) if size > TAKES_PART * sizes.max()]
    names = sorted({name for link in links for name in link.places})
    raise InputError(
        f"[body.{names[0]}.inertia]",
        f"nothing resists a motion of {', '.join(names)}: about some axis about which the joints let it turn "
        "it has no inertia, so that its acceleration is not determined",
        "give it an inertia about every axis, or a joint that stops this motion",
    )
