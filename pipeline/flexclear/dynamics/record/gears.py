"""Recorded forces of gears along their second coordinates, and their wrenches on the frames of both joints."""

from __future__ import annotations

import numpy as np

from flexclear.artifacts.coordinates import motion
from flexclear.dynamics.equations.observation import Observed, Series
from flexclear.dynamics.joints.conditions import frame_motion, measure
from flexclear.dynamics.model.gears import Coupling, Side
from flexclear.dynamics.model.model import Model
from flexclear.dynamics.vectors import Twist


def gear_series(model: Model, seen: Observed) -> Series:
    """Return the force [N] or torque [N m] of every gear along its second coordinate, on the joint's second body."""
    series = {coupling.gear: _force(model, seen, c, coupling) for c, coupling in _couplings(model)}
    turns = {coupling.gear: coupling.second.coordinate.turning for _, coupling in _couplings(model)}
    for c, contact in enumerate(model.contacts):
        if contact.family == "gear":
            pushed = -contact.joint.sense * seen.touch["normal_force"][:, c]
            series[contact.owner] = series.get(contact.owner, 0.0) + pushed
            turns[contact.owner] = contact.joint.coordinate.turning
    names = list(model.scene.gear)
    return {"gear_force": (("time", "gear"), np.stack([series[name] for name in names], axis=1))}, {
        "gear": names,
        "gear_motion": ("gear", [motion(turns[name]) for name in names]),
    }


def on_geared_frames(model: Model, seen: Observed) -> list[tuple[str, np.ndarray, np.ndarray]]:
    """Return all gears' wrenches on frames: frame, moment about the mechanism's origin, force; (time, 3) each."""
    acting = []
    for c, coupling in _couplings(model):
        size = _force(model, seen, c, coupling)
        for side, factor in coupling.parts:
            moment, push = side.coordinate.wrench(*_sites(model, seen, side), factor * size)
            frames = model.scene.joint[side.joint].between
            acting += [(frame, sign * moment, sign * push) for frame, sign in zip(frames, (-1.0, 1.0), strict=True)]
    return acting


def _couplings(model: Model) -> list[tuple[int, Coupling]]:
    return [(c, closure) for c, closure in enumerate(model.closures) if isinstance(closure, Coupling)]


def _sites(model: Model, seen: Observed, side: Side) -> tuple[np.ndarray, np.ndarray]:
    """Return the frames of both sites of a coordinate, shape (time,)."""
    return seen.sites[:, model.numbering.site(side.a)], seen.sites[:, model.numbering.site(side.b)]


def _force(model: Model, seen: Observed, c: int, coupling: Coupling) -> np.ndarray:
    moment, force = (seen.closure_wrenches[:, c][part].T for part in ("moment", "force"))
    frames = map(frame_motion, _sites(model, seen, coupling.second))
    size: np.ndarray = measure(coupling.second.coordinate.gauge, *frames)[1].on(Twist(moment, force))
    return size
