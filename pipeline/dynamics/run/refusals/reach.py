"""Ends of a motion at a singular pose: a drive that pulls a loop further than it reaches, a rest in the pose, and what
moves too fast there for a branch to be followed.

A drive that leads a loop with ideal joints out of reach ends the run there. With clearance the contact gives way
instead, in ever shorter steps, millions of which friction's slope at rest may ask for. What it must come to is a matter
of geometry: the least depth at the drives' positions, over all that they leave free. It is followed from the pose that
the run has come to along the drives' laws.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

import numpy as np

from flexclear.pipeline.core.system.errors import SolverError
from flexclear.pipeline.dynamics import memory as m
from flexclear.pipeline.dynamics.integrate import recording
from flexclear.pipeline.dynamics.model import selection
from flexclear.pipeline.dynamics.run.evaluation import closure_rows
from flexclear.pipeline.dynamics.run.evaluation.engine import Engine
from flexclear.pipeline.dynamics.run.evaluation.start import per_speed, project

#: least singular value of the closures, as fraction of the largest, above which a pose is not yet at the end of reach;
#: and above which it is not singular
END_OF_REACH, SINGULAR = 0.1, 1e-3
#: a rest: fraction of a row in what depends, and speeds as fraction of the largest before
REST_FRACTION, DYING = 0.1, 0.1
#: at the end of reach speeds grow beyond bounds: so much faster than the drives' a loop does not move elsewhere
FASTER = 40.0
#: times ahead at which the least depth is searched for
TIMES_AHEAD = 60
#: a search proceeds in so many boxes of one of these half widths, in fractions of the mechanism's size or in rad:
#: coordinates of a box are those of the loops' tangents in its middle
BOXES, HALF_WIDTHS = 60, (0.1, 0.05, 0.025, 0.0125)
#: a depth is the least when another box takes off less than this fraction of it
LEAST_GAIN = 1e-3
#: of the search in a box, in which depths are fractions of that in its middle, so that no size of a mechanism matters
OPTIONS: Any = {"eps": 1e-6}


@contextmanager
def preserved(engine: Engine) -> Iterator[None]:
    """The work space is afterwards as it was."""
    saved = engine.w.copy(), engine.n.copy()
    try:
        yield
    finally:
        engine.w[:], engine.n[:] = saved


def beyond_reach(engine: Engine) -> str:
    """When, which drive, and at which joint, in words; nothing where reach is not what ends at the stepper's state.

    In a singular pose that a motion passes, the combination of closures that becomes dependent asks nothing of the
    drives; at the end of a loop's reach it asks them not to move.  Of loops with flexible
    bodies, whose modes give way, this says nothing.  The memory stays as it is.
    """
    model = engine.model
    if not model.drives or not model.closures or not model.mechanism.all_rigid:
        return ""
    with preserved(engine):
        return _pulled_too_far(engine, float(engine.control[m.TIME]), engine.view(m.Y).copy())


def require_shallow(engine: Engine) -> None:
    """SolverError for a contact that is pressed through its socket at the stepper's state.

    Contacts give way where ideal joints do not, so that a drive leads a loop with clearance beyond its reach in ever
    shorter steps: the run would be refused at its end, if it ever came there.  The memory stays as it is.
    """
    from flexclear.pipeline.dynamics.contact.validity import SHALLOW, pressed_through

    model, t = engine.model, float(engine.control[m.TIME])
    with preserved(engine):
        engine.attempt(engine.view(m.Y).copy(), t)
        depths, drive = -engine.table(m.TOUCH)["gap"], _pulling(engine)
    pulled = drive is not None
    away = f"drive {drive} leads out of reach: {_shorten(drive or '')}"
    for k, (contact, depth) in enumerate(zip(model.contacts, depths, strict=True)):
        if text := pressed_through(contact.words, contact.joint, float(depth)):
            remedy = "choose a stiffer contact, a slower impact or smaller loads"
            raise SolverError(f"at t = {t:.6g} s: {text}: {f'{away}; else {remedy}' if pulled else remedy}")
        shallow = SHALLOW * contact.joint.radius
        if not (pulled and model.mechanism.all_rigid and depth > shallow > 0.0):
            continue
        with preserved(engine):
            time, least = forced_depth(engine, k, shallow)
        if least:
            raise SolverError(
                f"at t = {t:.6g} s: {contact.words}: the surfaces are {depth:.3g} m deep in each other, and "
                f"at t = {time:.6g} s they have to be {least:.3g} m deep at the least, more than the inner surface's "
                f"radius ({contact.joint.radius:.3g} m), however the mechanism gives way: {away}"
            )


def end_in_pose(engine: Engine, rows: np.ndarray) -> str:
    """Why the motion ends in a singular pose at the stepper's state, in words; nothing where there is none.

    rows: recorded so far, whose speeds those at the stepper's state are compared with.
    """
    model, t, y = engine.model, float(engine.control[m.TIME]), engine.view(m.Y).copy()
    with preserved(engine):
        engine.attempt(y, t)
        J = closure_rows.natural(model, engine.h, engine.rows(m.JACOBIAN))
        where = closure_rows.diagnosis(engine) if J.size else ""
    U, values, _ = np.linalg.svd(J) if J.size else (np.eye(1), np.ones(1), None)
    if not J.size or values[-1] > SINGULAR * values[0]:
        return ""
    moving = selection.coordinates_of_rows(model, engine.h, np.abs(U[:, len(values) - 1]) > REST_FRACTION)
    states = recording.record(rows, len(model.contacts)).state
    before, now = (np.abs(s[..., model.speeds] / model.speed_scales)[..., moving] for s in (states, y))
    if np.max(now, initial=0.0) > DYING * np.max(before, initial=0.0):
        return _too_fast(engine, t, where)
    return rest(t, where)


def rest(t: float, where: str) -> str:
    """A rest in a singular pose, in words."""
    return (
        f"at t = {t:.6g} s: the mechanism comes to rest in a singular pose ({where}), where it can continue in several "
        "ways and no motion chooses one: let it pass the pose at speed, or stop elsewhere"
    )


def _too_fast(engine: Engine, t: float, where: str) -> str:
    """What keeps a pass at speed from being smooth, in words; nothing where there is nothing of the kind."""
    model = engine.model
    closed = [contact.name for contact, mode in zip(model.contacts, engine.modes, strict=True) if mode]
    flexible = [name for link in model.links if link.flexible for name in link.places]
    causes, remedies = list[str](), list[str]()
    if closed:
        causes.append(f"the closed contact of {', '.join(closed)}")
        remedies.append("soften or damp the contact")
    if flexible:
        causes.append(f"the vibration of {', '.join(flexible)}")
        remedies.append(
            "take fewer modes, or such as let the body become longer (craig-bampton), with which the pose is passed"
        )
    if not causes:
        return ""
    return (
        f"at t = {t:.6g} s: the mechanism passes a singular pose ({where}), where it can continue in several ways, and "
        f"{' and '.join(causes)} is too fast there for its branch to be determined: {', or '.join(remedies)}"
    )


def _pulled_too_far(engine: Engine, t: float, y: np.ndarray) -> str:
    model, still = engine.model, y.copy()
    engine.attempt(y, t)
    drive = _pulling(engine) or model.drives[0]
    still[model.speeds] = 0.0
    engine.attempt(still, t)
    U, values, _ = np.linalg.svd(closure_rows.natural(model, engine.h, engine.rows(m.JACOBIAN)))
    pulled = engine.view(m.RESIDUAL_RATE)[selection.kept_places(model, engine.h)]
    pulled = pulled / closure_rows.row_units(model, engine.h, model.length)
    if values[-1] > END_OF_REACH * values[0]:
        return ""
    if not abs(U[:, len(values) - 1] @ pulled) > FASTER * values[-1] * np.linalg.norm(pulled) > 0.0:
        return ""
    joint = closure_rows.worst_joint(engine, U[:, len(values) - 1])
    return (
        f"at t = {t:.6g} s: drive {drive} leads out of reach: the loop closed at joint {joint} is stretched or folded "
        f"as far as it goes; {_shorten(drive)}"
    )


def _pulling(engine: Engine) -> str | None:
    """The drive with the largest power in the state evaluated last; None where none has any."""
    powers = np.abs(engine.view(m.DRIVE_FORCE) * engine.view(m.U)[engine.model.nv :])
    return engine.model.drives[int(np.argmax(powers))] if np.any(powers > 0.0) else None


def _shorten(drive: str) -> str:
    return f"shorten the travel in [drive.{drive.partition('.')[0]}], or change lengths"


def forced_depth(engine: Engine, contact: int, shallow: float) -> tuple[float, float]:
    """When contact number `contact` must be deeper [m] than its inner radius, and how deep then; else (inf, 0).

    From the stepper's state on, if the contact is deeper than `shallow` [m] already; rigid bodies only, since others
    bend instead. Searches are local, as the motion is.  The memory is not preserved.
    """
    model, t = engine.model, float(engine.control[m.TIME])
    radius, y = model.contacts[contact].joint.radius, engine.view(m.Y).copy()
    try:
        for time in np.linspace(t, engine.end, TIMES_AHEAD + 1)[:-1]:
            y, depth = _shallowest(replace(engine, start=float(time)), y, contact, shallow)
            if depth > radius:
                return float(time), depth
    except SolverError:
        pass  # other loops do not reach so far either: the run will show it
    return np.inf, 0.0


def _shallowest(engine: Engine, y: np.ndarray, contact: int, enough: float) -> tuple[np.ndarray, float]:
    """A state nearby in which the contact is least deep, or no deeper than `enough`; and how deep [m].

    Drives are where they are at the engine's start.
    """
    y = project(engine, y)
    depth = _depth(engine, y, contact)
    for _ in range(BOXES):
        if depth <= enough:
            break
        there, less = _shallower(engine, y, contact, depth)
        if not less < (1.0 - LEAST_GAIN) * depth:
            break
        y, depth = there, less
    return y, depth


def _shallower(engine: Engine, y: np.ndarray, contact: int, depth: float) -> tuple[np.ndarray, float]:
    """The same in the box about a state in which it is so deep; a smaller one where other loops cannot follow."""
    from scipy.optimize import minimize  # slow to import, and few runs come here

    nq, scales = engine.model.nq, engine.model.speed_scales[: engine.model.nv]
    ways = per_speed(engine, y, lambda rates: rates[:nq]) * scales

    def there(x: np.ndarray) -> np.ndarray:
        moved = y.copy()
        moved[:nq] += ways @ x
        return project(engine, moved)

    def fraction(x: np.ndarray) -> float:
        return _depth(engine, there(x), contact) / depth

    for width in HALF_WIDTHS:
        box = [(-width, width)] * len(scales)
        try:
            least = minimize(fraction, np.zeros(len(scales)), method="L-BFGS-B", bounds=box, options=OPTIONS)
        except SolverError:
            continue
        return there(least.x), float(least.fun) * depth
    raise SolverError("other loops do not reach so far")


def _depth(engine: Engine, y: np.ndarray, contact: int) -> float:
    """How deep the contact is [m]."""
    engine.attempt(y, engine.start)
    return -float(engine.table(m.TOUCH)["gap"][contact])
