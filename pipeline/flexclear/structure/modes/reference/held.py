"""Reference conditions that hold motions of named frames; the held motions vanish in every normal mode.

Source: Shabana, *Dynamics of Multibody Systems*, ch. 5 (reference conditions).
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from flexclear.scene.registry import suggestion
from flexclear.structure.fe.model import DIRECTIONS, Interface, Model, rows
from flexclear.structure.modes.condition import WHERE, Condition, Given, distinct, in_own_axes, interfaces_of
from flexclear.system.errors import InputError

#: given shapes depend on each other where a combination of them has this fraction of the largest mass
DEPENDENT = 1e-10


def cantilever(model: Model, given: Given) -> Condition:
    """Return the condition for normal modes with the first interface clamped; raise InputError without interfaces."""
    first = interfaces_of(given, 1, "a cantilever is clamped at an interface")[0]
    return _held_condition(first.motion, f"the body frame moves with '{first.name}', where all shapes vanish")


def craig_bampton(model: Model, given: Given) -> Condition:
    """Return the condition for normal modes with clamped interfaces, and constraint modes of all but the first.

    There are six constraint modes per interface. They make the static response to interface loads exact.
    Raises InputError without interfaces, and when two interfaces are the same.
    Source: Craig & Bampton (1968), AIAA Journal 6, 1313-1319.
    """
    distinct(interfaces_of(given, 1, "a Craig-Bampton basis needs at least one interface"))
    held = rows(given.interfaces, model.size)
    first = given.interfaces[0].name
    note = f"the body frame moves with '{first}', where all shapes vanish; no rigid motion is left"
    return _held_condition(held, note, moved=np.arange(6, held.shape[0]))


def given_shapes(model: Model, given: Given) -> Condition:
    """Return the condition for shapes that came with the body, in all combinations that leave the first interface at
    rest; raise InputError without them or without an interface.

    Such a basis, as Craig and Bampton's with constraint modes of every interface, contains the rigid motions, which the
    body frame takes over.
    """
    first = interfaces_of(given, 1, "the body frame moves with the first interface")[0]
    if model.given is None:
        raise InputError(WHERE, "the recipe gives no shapes", "name their file as `basis` of its [shape]")
    vectors = np.hstack([model.rigid, model.given])
    size = np.sqrt(np.einsum("ij,ij->j", vectors, model.mass @ vectors))
    if not size.all():
        raise InputError(WHERE, f"column {int(np.argmin(size[6:])) + 1} of `basis` is zero", "remove it")
    vectors = vectors / size
    values, turned = np.linalg.eigh(vectors.T @ (model.mass @ vectors))
    independent = values > DEPENDENT * values[-1]
    vectors = vectors @ (turned[:, independent] / np.sqrt(values[independent]))
    still = np.linalg.svd(first.motion @ vectors)[2][6:].T
    note = f"the body frame moves with '{first.name}', where all given shapes vanish"
    none = sp.csr_array((0, model.size))
    return Condition(none, note, np.empty(0, dtype=int), none, shapes=vectors @ still)


def fixed_fixed(model: Model, given: Given) -> Condition:
    """Return the condition for normal modes between clamped ends: a beam's ends, or a solid's first two interfaces.

    The basis has no compliance at the ends, and joints there see none.
    Raises InputError without two ends, or without coordinates between them.
    Source: Wang & Wang (2019), eq. (6), sec. 3.4 and Table 4.
    """
    if len(model.ends) < 2:
        raise InputError(WHERE, "a fixed-fixed basis clamps two ends", "name two interfaces in the recipe")
    if model.size <= 6 * len(model.ends):
        raise InputError(WHERE, "one element has no coordinate between two clamped ends", "use at least 2")
    names = " and ".join(f"'{end.name}'" for end in model.ends)
    note = f"the body frame moves with the clamped {names}; no rigid motion is left"
    return _held_condition(rows(model.ends, model.size), note)


def pinned_pinned(model: Model, given: Given) -> Condition:
    """Return the condition for normal modes between two pins: a simply supported body.

    Six conditions: the first interface does not move and does not turn about the line to the second; the second moves
    along that line only.  Raises InputError unless two interfaces are at different points.
    """
    first, second = interfaces_of(given, 2, "a pinned-pinned basis needs two interfaces")[:2]
    line = second.position - first.position
    length = float(np.linalg.norm(line))
    if length <= 1e-9 * np.ptp(model.position, axis=0).max():
        problem = f"'{first.name}' and '{second.name}' coincide"
        raise InputError("modes.interfaces", problem, "pin the body at two different points")
    along, *across = _triad(line / length)
    turning = sp.csr_array(along[None, :]) @ first.motion[3:]
    held = sp.vstack([first.motion[:3], turning, sp.csr_array(np.array(across)) @ second.motion[:3]], format="csr")
    held.eliminate_zeros()
    note = f"the body frame moves with the pins '{first.name}' and '{second.name}'; no rigid motion is left"
    return _held_condition(sp.csr_array(held), note)


def hold_motions(model: Model, given: Given) -> Condition:
    """Return the condition that holds motions ``frame.direction`` of `given.held`; raise InputError if unknown."""
    if not given.held:
        raise InputError("modes.held", "no motion is held", 'list at least six, as held = ["top.x", "top.rz", ...]')
    held = sp.csr_array(sp.vstack([_functional(model.interfaces, name) for name in given.held], format="csr"))
    return _held_condition(held, f"the body frame is fixed by {', '.join(given.held)}")


def _held_condition(held: sp.csr_array, note: str, moved: np.ndarray | None = None) -> Condition:
    """Return the condition with some functionals held, and constraint modes for the `moved` ones."""
    none = sp.csr_array((0, held.shape[1]))
    return Condition(held, note, np.empty(0, dtype=int) if moved is None else moved, none)


def _functional(frames: tuple[Interface, ...], name: str) -> sp.csr_array:
    """Return the motion ``frame.direction`` in the frame's axes, (1, ndof); raise InputError for unknown names."""
    frame_name, _, direction = name.partition(".")
    known = {frame.name: frame for frame in frames}
    if frame_name not in known:
        raise InputError("modes.held", f"the mesh has no frame called '{frame_name}'", suggestion(frame_name, known))
    if direction not in DIRECTIONS:
        remedy = f"after the frame give one of {', '.join(DIRECTIONS)}"
        raise InputError("modes.held", f"'{name}' has no valid direction", remedy)
    return sp.csr_array(in_own_axes(known[frame_name])[[DIRECTIONS.index(direction)]])


def _triad(along: np.ndarray) -> np.ndarray:
    """Return the direction and two across it as rows; they are parallel to mesh axes where the direction is."""
    k = int(np.argmin(np.abs(along)))
    second = np.cross(along, np.eye(3)[k])
    second /= np.linalg.norm(second)
    triad = np.array([along, second, np.cross(along, second)])
    return np.where(np.abs(triad) < 1e-15, 0.0, triad)
