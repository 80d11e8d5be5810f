"""Motions that end at a singular pose: a drive that pulls a loop further than it reaches, a rest in the pose, and
speeds too large to follow a branch.

A drive that leads a loop with ideal joints out of reach ends the run there. With clearance the contact gives way
instead, in ever shorter steps, possibly millions because of friction's slope at rest. Geometry alone decides the
outcome: the least depth at the drives' positions, over all free coordinates. The search follows that depth from the
present pose along the drives' laws.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

import numpy as np

from flexclear.dynamics import memory as m
from flexclear.dynamics.integrate import recording
from flexclear.dynamics.model import selection
from flexclear.dynamics.run.evaluation import closure_rows
from flexclear.dynamics.run.evaluation.engine import Engine
from flexclear.dynamics.run.evaluation.start import per_speed, project
from flexclear.system.errors import SolverError

#: least singular values of the closures, as fractions of the largest, above which a pose is not at the end of reach,
#: and not singular
END_OF_REACH, SINGULAR = 0.1, 1e-3
#: a rest: least part of a row in the dependent combination, and largest speeds as fraction of the largest before
REST_FRACTION, DYING = 0.1, 0.1
#: a search uses at most so many boxes of one of these half widths, in fractions of the mechanism's size or in rad: the
#: coordinates of a box are those of the loops' tangents in its middle
BOXES, HALF_WIDTHS = 60, (0.1, 0.05, 0.025, 0.0125)
#: tolerance of the search in a box; depths are fractions of that in its middle, independent of the mechanism's size
OPTIONS: Any = {"eps": 1e-6}


@contextmanager
def restore_work_array(engine: Engine) -> Iterator[None]:
    """Restore the work array afterwards."""
    saved = engine.w.copy(), engine.n.copy()
    try:
        yield
    finally:
        engine.w[:], engine.n[:] = saved


def beyond_reach(engine: Engine) -> str:
    """Return time, drive and joint, in words, when a loop's reach ends at the stepper's state; else nothing.

    In a singular pose that a motion passes, the dependent combination of closures does not constrain the drives; at the
    end of a loop's reach it demands that they stand still.  Loops with flexible bodies are not judged, since their
    modes give way.  The engine is not changed.
    """
    model = engine.model
    if not model.drives or not model.closures or not model.mechanism.all_rigid:
        return ""
    with restore_work_array(engine):
        return _pulled_too_far(engine, float(engine.control[m.TIME]), engine.view(m.Y).copy())


def require_shallow(engine: Engine) -> None:
    """Raise SolverError for a contact that is pressed through its socket at the stepper's state.

    Contacts give way where ideal joints do not, so a drive leads a loop with clearance beyond its reach in ever shorter
    steps, to a run that would be refused at its end.  The engine is not changed.
    """
    from flexclear.dynamics.contact.validity import SHALLOW, pressed_through

    model, t = engine.model, float(engine.control[m.TIME])
    with restore_work_array(engine):
        engine.attempt(engine.view(m.Y).copy(), t)
        depths, drive = -engine.table(m.TOUCH)["gap"], _strongest_drive(engine)
    pulled = drive is not None
    away = f"drive {drive} leads out of reach: {_shorten(drive or '')}"
    for k, (contact, depth) in enumerate(zip(model.contacts, depths, strict=True)):
        if text := pressed_through(contact.words, contact.joint, float(depth)):
            remedy = "choose a stiffer contact, a slower impact or smaller loads"
            raise SolverError(f"at t = {t:.6g} s: {text}: {f'{away}; else {remedy}' if pulled else remedy}")
        shallow = SHALLOW * contact.joint.radius
        if not (pulled and model.mechanism.all_rigid and depth > shallow > 0.0):
            continue
        with restore_work_array(engine):
            time, least = forced_depth(engine, k, shallow)
        if least:
            raise SolverError(
                f"at t = {t:.6g} s: {contact.words}: the penetration is {depth:.3g} m, and at t = "
                f"{time:.6g} s the drive forces it to at least {least:.3g} m, more than the inner surface's "
                f"radius ({contact.joint.radius:.3g} m), in every pose of the mechanism: {away}"
            )


def end_in_pose(engine: Engine, rows: np.ndarray) -> str:
    """Return why the motion ends in a singular pose at the stepper's state, in words; nothing without such a pose.

    rows: the record so far, for comparison with the speeds at the stepper's state.
    """
    model, t, y = engine.model, float(engine.control[m.TIME]), engine.view(m.Y).copy()
    with restore_work_array(engine):
        engine.attempt(y, t)
        J = closure_rows.natural(model, engine.h, engine.jacobian)
        where = closure_rows.diagnosis(engine) if J.size else ""
    U, values, _ = np.linalg.svd(J) if J.size else (np.eye(1), np.ones(1), None)
    if not J.size or values[-1] > SINGULAR * values[0]:
        return ""
    moving = selection.coordinates_of_rows(model, engine.h, np.abs(U[:, len(values) - 1]) > REST_FRACTION)
    states = recording.record(rows, len(model.contacts)).state
    before, now = (np.abs(s[..., model.speeds] / model.speed_scales)[..., moving] for s in (states, y))
    if np.max(now, initial=0.0) > DYING * np.max(before, initial=0.0):
        return _too_fast(engine, t, where)
    return describe_rest(t, where)


def describe_rest(t: float, where: str) -> str:
    """Describe a rest in a singular pose."""
    return (
        f"at t = {t:.6g} s: the mechanism comes to rest in a singular pose ({where}), where it can continue in several "
        "ways and no motion selects one: let it pass the pose at speed, or stop elsewhere"
    )


def _too_fast(engine: Engine, t: float, where: str) -> str:
    """Return what prevents a smooth pass at speed, in words; nothing when the pass is smooth."""
    model = engine.model
    closed = [contact.name for contact, mode in zip(model.contacts, engine.modes, strict=True) if mode]
    flexible = [name for link in model.links if link.flexible for name in link.placements]
    causes, remedies = list[str](), list[str]()
    if closed:
        causes.append(f"the closed contact of {', '.join(closed)}")
        remedies.append("soften or damp the contact")
    if flexible:
        causes.append(f"the vibration of {', '.join(flexible)}")
        remedies.append("use fewer modes, or modes in which the body can change its length (craig-bampton)")
    if not causes:
        return ""
    return (
        f"at t = {t:.6g} s: the mechanism passes a singular pose ({where}), where it can continue in several ways, and "
        f"{' and '.join(causes)} is too fast there for its branch to be determined: {', or '.join(remedies)}"
    )


def _pulled_too_far(engine: Engine, t: float, y: np.ndarray) -> str:
    model, still = engine.model, y.copy()
    engine.attempt(y, t)
    drive = _strongest_drive(engine) or model.drives[0]
    still[model.speeds] = 0.0
    engine.attempt(still, t)
    U, values, _ = np.linalg.svd(closure_rows.natural(model, engine.h, engine.jacobian))
    pulled = engine.view(m.RESIDUAL_RATE)[selection.selected_indices(model, engine.h)]
    pulled = pulled / closure_rows.row_units(model, engine.h, model.length)
    if values[-1] > END_OF_REACH * values[0]:
        return ""
    # 40.0: at the end of reach speeds grow without bound: elsewhere no loop moves faster than the drives by this factor
    if not abs(U[:, len(values) - 1] @ pulled) > 40.0 * values[-1] * np.linalg.norm(pulled) > 0.0:
        return ""
    joint = closure_rows.worst_joint(engine, U[:, len(values) - 1])
    return (
        f"at t = {t:.6g} s: drive {drive} leads out of reach: the loop closed at joint {joint} is fully stretched or "
        f"folded; {_shorten(drive)}"
    )


def _strongest_drive(engine: Engine) -> str | None:
    """Return the drive with the largest power in the state evaluated last; None when no drive has power."""
    powers = np.abs(engine.view(m.DRIVE_FORCE) * engine.view(m.U)[engine.model.nv :])
    return engine.model.drives[int(np.argmax(powers))] if np.any(powers > 0.0) else None


def _shorten(drive: str) -> str:
    return f"shorten the travel in [drive.{drive.partition('.')[0]}], or change lengths"


def forced_depth(engine: Engine, contact: int, shallow: float) -> tuple[float, float]:
    """Return when a contact must be deeper [m] than its inner radius, and how deep then; else (inf, 0).

    The prediction starts at the stepper's state if the contact is already deeper than `shallow` [m], with rigid bodies
    only, since others bend. Searches are local, as the motion is.  The engine is changed.
    """
    model, t = engine.model, float(engine.control[m.TIME])
    radius, y = model.contacts[contact].joint.radius, engine.view(m.Y).copy()
    try:
        # 60: number of times ahead at which the least depth is computed
        for time in np.linspace(t, engine.end, 60 + 1)[:-1]:
            y, depth = _shallowest(replace(engine, start=float(time)), y, contact, shallow)
            if depth > radius:
                return float(time), depth
    except SolverError:
        pass  # other loops do not reach this position either: the run will show it
    return np.inf, 0.0


def _shallowest(engine: Engine, y: np.ndarray, contact: int, enough: float) -> tuple[np.ndarray, float]:
    """Return a nearby state with the least depth of the contact, or one of at most `enough`; and the depth [m].

    Drives have their positions at the engine's start.
    """
    y = project(engine, y)
    depth = _depth(engine, y, contact)
    for _ in range(BOXES):
        if depth <= enough:
            break
        there, less = _shallower(engine, y, contact, depth)
        # 1e-3: a depth is the least when another box reduces it by less than this fraction
        if not less < (1.0 - 1e-3) * depth:
            break
        y, depth = there, less
    return y, depth


def _shallower(engine: Engine, y: np.ndarray, contact: int, depth: float) -> tuple[np.ndarray, float]:
    """Search for the least depth in a box about a state; the box shrinks when other loops cannot follow."""
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
    raise SolverError("other loops do not reach this position")


def _depth(engine: Engine, y: np.ndarray, contact: int) -> float:
    """Return the depth of the contact [m]."""
    engine.attempt(y, engine.start)
    return -float(engine.table(m.TOUCH)["gap"][contact])
