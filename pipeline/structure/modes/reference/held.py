"""The body frame is held by motions of named frames, which vanish in every normal mode.

Source: Shabana, *Dynamics of Multibody Systems*, ch. 5 (reference conditions).
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from flexclear.pipeline.core.scene.registry import suggestion
from flexclear.pipeline.core.system.errors import InputError
from flexclear.pipeline.structure.fe.model import DIRECTIONS, Interface, Model, rows
from flexclear.pipeline.structure.modes.condition import WHERE, Condition, Given, different, in_own_axes, joined


def cantilever(model: Model, given: Given) -> Condition:
    """Normal modes with the first interface clamped; InputError without one."""
    first = joined(given, 1, "a cantilever is clamped at an interface")[0]
    return _holding(first.motion, f"the body frame rides on '{first.name}', where all shapes vanish")


def craig_bampton(model: Model, given: Given) -> Condition:
    """Normal modes with all interfaces clamped, and six constraint modes per interface beyond the first.

    The static response to forces and moments at the interfaces is exact with any number of normal modes.
    Raises InputError without interfaces, and when two are the same.
    Source: Craig & Bampton (1968), AIAA Journal 6, 1313-1319.
    """
    different(joined(given, 1, "a Craig-Bampton basis needs at least one interface"))
    held = rows(given.interfaces, model.size)
    first = given.interfaces[0].name
    note = f"the body frame rides on '{first}', where all shapes vanish; no rigid motion is left"
    return _holding(held, note, moved=np.arange(6, held.shape[0]))


def fixed_fixed(model: Model, given: Given) -> Condition:
    """Normal modes between clamped ends: of a beam its ends, of a solid its first interfaces, wherever the joints are.

    Both ends stay rigid, so joints there see no compliance at all (which is the truth of this basis).
    Raises InputError when there are no ends, or nothing is free between them.
    Source: Wang & Wang (2019), eq. (6), sec. 3.4 and Table 4.
    """
    if len(model.ends) < 2:
        raise InputError(WHERE, "a fixed-fixed basis clamps two ends", "name two interfaces in the recipe")
    if model.size <= 6 * len(model.ends):
        raise InputError(WHERE, "one element has no coordinate between two clamped ends", "use at least 2")
    names = " and ".join(f"'{end.name}'" for end in model.ends)
    note = f"the body frame rides on the clamped {names}; no rigid motion is left"
    return _holding(rows(model.ends, model.size), note)


def pinned_pinned(model: Model, given: Given) -> Condition:
    """Normal modes between two pins: a simply supported body.

    Six conditions: the first interface does not move and does not turn about the line to the second; the second moves
    along that line only.  Raises InputError without two interfaces at different points.
    """
    first, second = joined(given, 2, "a pinned-pinned basis needs two interfaces")[:2]
    line = second.position - first.position
    length = float(np.linalg.norm(line))
    if length <= 1e-9 * np.ptp(model.position, axis=0).max():
        problem = f"'{first.name}' and '{second.name}' coincide"
        raise InputError("modes.interfaces", problem, "pin the body at two different points")
    along, *across = _triad(line / length)
    turning = sp.csr_array(along[None, :]) @ first.motion[3:]
    held = sp.vstack([first.motion[:3], turning, sp.csr_array(np.array(across)) @ second.motion[:3]], format="csr")
    held.eliminate_zeros()
    note = f"the body frame rides on the pins '{first.name}' and '{second.name}'; no rigid motion is left"
    return _holding(sp.csr_array(held), note)


def constrained(model: Model, given: Given) -> Condition:
    """Normal modes with the motions ``frame.direction`` of `given.held` at zero; InputError for unknown ones."""
    if not given.held:
        raise InputError("modes.held", "no motion is held", 'list at least six, as held = ["top.x", "top.rz", ...]')
    held = sp.csr_array(sp.vstack([_functional(model.interfaces, name) for name in given.held], format="csr"))
    return _holding(held, f"the body frame is fixed by {', '.join(given.held)}")


def _holding(held: sp.csr_array, note: str, moved: np.ndarray | None = None) -> Condition:
    """Normal modes with some functionals held, and constraint modes for `moved` ones."""
    none = sp.csr_array((0, held.shape[1]))
    return Condition(held, note, np.empty(0, dtype=int) if moved is None else moved, none)


def _functional(frames: tuple[Interface, ...], name: str) -> sp.csr_array:
    """The motion ``frame.direction`` in axes of the frame, shape (1, ndof); InputError for unknown names."""
    frame_name, _, direction = name.partition(".")
    known = {frame.name: frame for frame in frames}
    if frame_name not in known:
        raise InputError("modes.held", f"the mesh has no frame called '{frame_name}'", suggestion(frame_name, known))
    if direction not in DIRECTIONS:
        remedy = f"after the frame comes one of {', '.join(DIRECTIONS)}"
        raise InputError("modes.held", f"'{name}' names no direction", remedy)
    return sp.csr_array(in_own_axes(known[frame_name])[[DIRECTIONS.index(direction)]])


def _triad(along: np.ndarray) -> np.ndarray:
    """Rows: the direction and two across it, parallel to axes of the mesh frame where it is."""
    k = int(np.argmin(np.abs(along)))
    second = np.cross(along, np.eye(3)[k])
    second /= np.linalg.norm(second)
    triad = np.array([along, second, np.cross(along, second)])
    return np.where(np.abs(triad) < 1e-15, 0.0, triad)
