"""Ends of a motion at a singular pose: a drive that pulls a loop further than it reaches, and a rest in the pose."""

from __future__ import annotations

import numpy as np

from pipeline.dynamics import memory as m
from pipeline.dynamics.model import selection
from pipeline.dynamics.run import singular
from pipeline.dynamics.run.engine import Engine

#: least singular value of the closures, as share of the largest, above which a pose is not yet at the end of reach
NEAR = 0.1
#: a rest: least singular value, share of a row in what depends, and speeds as share of the largest before
STILL_NEAR, SHARE, DYING = 1e-3, 0.1, 0.1
#: at the end of reach speeds grow beyond bounds: so much faster than the drives' a loop does not move elsewhere
FASTER = 40.0


def beyond_reach(engine: Engine) -> str:
    """When, which drive, and at which joint, in words; nothing where reach is not what ends at the stepper's state.

    In a singular pose that a motion passes, the combination of closures that becomes dependent asks nothing of the
    drives; at the end of a loop's reach it asks them not to move.  Of loops with flexible
    bodies, whose modes give way, this says nothing.  The memory stays as it is.
    """
    numbering, kept_w, kept_n = engine.model.numbering, engine.w.copy(), engine.n.copy()
    control = engine.view(m.CONTROL, m.N_CONTROLS)
    t, y = float(control[m.TIME]), engine.view(m.Y, engine.model.arrays.size(m.NY)).copy()
    try:
        return (
            _told(engine, t, y) if numbering.known and engine.model.mechanism.closures and not numbering.modes else ""
        )
    finally:
        engine.w[:], engine.n[:] = kept_w, kept_n


def at_rest(engine: Engine, rows: np.ndarray) -> str:
    """When and where the mechanism comes to rest in a singular pose, in words; nothing where it does not.

    rows: recorded so far, whose speeds those at the stepper's state are compared with.
    """
    numbering, kept_w, kept_n = engine.model.numbering, engine.w.copy(), engine.n.copy()
    t, first = float(engine.view(m.CONTROL, m.N_CONTROLS)[m.TIME]), 1 + 2 * engine.model.arrays.size(m.N_CONTACTS)
    y = engine.view(m.Y, engine.model.arrays.size(m.NY)).copy()
    engine.attempt(y, t)
    J = singular.dimensionless(engine, engine.rows(m.JACOBIAN))
    where = singular.diagnosis(engine) if J.size else ""
    U, values, _ = np.linalg.svd(J) if J.size else (np.eye(1), np.ones(1), None)
    moving = selection.coordinates_of_rows(engine.model, engine.h, np.abs(U[:, len(values) - 1]) > SHARE)
    engine.w[:], engine.n[:] = kept_w, kept_n
    if not J.size or values[-1] > STILL_NEAR * values[0]:
        return ""
    speeds = slice(first + numbering.nq, first + numbering.nq + numbering.nv)
    known = np.abs(rows[:, speeds] / engine.floors[numbering.nq : numbering.nq + numbering.nv])[:, moving]
    now = np.abs(y[numbering.nq : numbering.nq + numbering.nv] / engine.floors[numbering.nq :][: numbering.nv])[moving]
    if np.max(now, initial=0.0) > DYING * np.max(known, initial=0.0):
        return ""
    return (
        f"at t = {t:.6g} s: the mechanism comes to rest in a singular pose ({where}), where it can go on in several "
        "ways and no motion chooses one: let it pass the pose at speed, or stop elsewhere"
    )


def _told(engine: Engine, t: float, y: np.ndarray) -> str:
    numbering, still = engine.model.numbering, y.copy()
    nq, nv = numbering.nq, numbering.nv
    engine.attempt(y, t)
    powers = np.abs(engine.view(m.DRIVE_FORCE, numbering.known) * engine.view(m.U, nv + numbering.known)[nv:])
    still[nq : nq + nv] = 0.0
    engine.attempt(still, t)
    U, values, _ = np.linalg.svd(singular.dimensionless(engine, engine.rows(m.JACOBIAN)))
    along = singular.built_rows(engine.model, engine.h) == 0
    pulled = engine.view(m.RESIDUAL_RATE, len(engine.kept))[selection.kept_places(engine.model, engine.h)]
    pulled = np.where(along, pulled / engine.model.mechanism.length, pulled)
    if values[-1] > NEAR * values[0]:
        return ""
    if not abs(U[:, len(values) - 1] @ pulled) > FASTER * values[-1] * np.linalg.norm(pulled) > 0.0:
        return ""
    drive = engine.model.mechanism.drives[int(np.argmax(powers))]
    joint = singular.worst_joint(engine, U[:, len(values) - 1])
    return (
        f"at t = {t:.6g} s: drive {drive} leads out of reach: the loop closed at joint {joint} is stretched or folded "
        f"as far as it goes; shorten the travel in [drive.{drive.partition('.')[0]}], or change lengths"
    )
