r"""Reference conditions: they tie the body frame to the deforming body, and so define the admissible shapes.

To add one: a function ``(model, given) -> Condition``, and a line in `CONDITIONS`.

Reference conditions that hold motions of named frames; the held motions vanish in every normal mode.

Source: Shabana, *Dynamics of Multibody Systems*, ch. 5 (reference conditions).

Mean axes: the body frame follows the body as a whole, and no shape has linear or angular momentum.

.. math:: \int\rho\, S\,dV = 0, \qquad \int\rho\, (X - X_c)\times S\,dV = 0

Sources: Canavin & Likins (1977), J. Spacecraft 14, 724-732 (Tisserand's or Buckens' frame); Shabana, *Dynamics of
Multibody Systems*, ch. 5; Wang & Wang (2019), sec. 3.4 and Table 5 (free-free modes).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp

from flexclear.scene.registry import lookup, suggestion
from flexclear.structure.fe.model import DIRECTIONS, Interface, Model, own_dofs, rows
from flexclear.system.errors import InputError

WHERE = "modes.reference"
HOLD_ONCE = "hold each motion once; interfaces tied to the same nodes have equal motions"


@dataclass(frozen=True)
class Given:
    """Data that a scene gives for a reference condition, besides its name.

    interfaces: frames at which the body is joined; the first one may carry the body frame.
    held: single motions, ``frame.direction`` in axes of the frame.  of: another condition that this one is based on.
    """

    interfaces: tuple[Interface, ...]
    held: tuple[str, ...] = ()
    of: str | None = None


@dataclass(frozen=True)
class Condition:
    """A reference condition and the kind of shapes that it admits.

    held: functionals that vanish in every normal mode, shape (c, ndof).
    moved: rows of `held`; each gives a constraint mode, in which that functional is one and the others are zero.
    loaded: functionals whose unit loads give attachment modes, shape (s, ndof).
    residual: True to remove the retained normal modes' part from the attachment modes.
    mean_axes: True to remove rigid motion from every shape (Tisserand's condition: no momentum).
    shapes: static shapes that are given, with no normal modes next to them, shape (ndof, s).
    note: text on the removed rigid-body motion and the method.
    """

    held: sp.csr_array
    note: str
    moved: np.ndarray
    loaded: sp.csr_array
    residual: bool = False
    mean_axes: bool = False
    shapes: np.ndarray | None = None

    @property
    def static(self) -> int:
        """Number of static shapes."""
        return len(self.moved) or self.loaded.shape[0] if self.shapes is None else self.shapes.shape[1]


def interfaces_of(given: Given, count: int, needs: str) -> tuple[Interface, ...]:
    """Return the interfaces; raise InputError when there are fewer than `count`.  needs: the requirement in words."""
    if len(given.interfaces) < count:
        raise InputError("modes.interfaces", needs, "name the recipe's frames")
    return given.interfaces


def in_own_axes(frame: Interface) -> sp.csr_array:
    """Return the motion of a frame in its own axes, shape (6, ndof)."""
    # products with the zeros of a rotation would be stored, and a single degree of freedom would look like a mixture
    R = np.where(np.abs(frame.rotation) < 1e-15, 0.0, frame.rotation)
    turned = sp.csr_array(sp.block_diag([R.T, R.T])) @ frame.motion
    turned.eliminate_zeros()
    return sp.csr_array(turned)


def require_distinct_frames(frames: tuple[Interface, ...]) -> None:
    """Raise InputError when two frames move alike, so that the second one adds nothing."""
    for k, frame in enumerate(frames):
        for other in frames[:k]:
            if abs(frame.motion - other.motion).max() == 0.0:
                problem = f"two interfaces lie on the same node: '{other.name}' and '{frame.name}'"
                raise InputError("modes.interfaces", problem, "remove one of them")


def require_definite_condition(model: Model, condition: Condition) -> None:
    """Raise InputError unless the held motions are independent and leave no rigid motion (or are none at all)."""
    held = condition.held
    if held.shape[0] == 0:
        return
    dofs = own_dofs(held)
    if dofs is None:
        rows = held.toarray()
        size = np.linalg.norm(rows, axis=1, keepdims=True)
        if np.any(size == 0.0) or np.linalg.matrix_rank(rows / size, tol=1e-9) < len(rows):
            raise InputError(WHERE, "the held motions are not independent of each other", HOLD_ONCE)
    lengths = np.linalg.norm(model.position - model.position.mean(axis=0), axis=1)
    scale = np.array([1.0, 1.0, 1.0, *[1.0 / max(lengths.max(), 1e-300)] * 3])
    left = 6 - np.linalg.matrix_rank(np.asarray(held @ model.rigid) * scale, tol=1e-9)
    if left:
        problem = f"the held motions leave {left} rigid-body motions of the body free"
        raise InputError(WHERE, problem, 'hold six motions that fix it, or take mean axes: reference = "mean-axis"')


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
    require_distinct_frames(interfaces_of(given, 1, "a Craig-Bampton basis needs at least one interface"))
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


def free_free(model: Model, given: Given) -> Condition:
    """Return the condition for normal modes of the free body; `given` is not used."""
    return _free_condition(model, "the six rigid-body modes below the gap in the free body's frequencies were removed")


def craig_chang(model: Model, given: Given) -> Condition:
    """Return the condition for six inertia-relief attachment modes per interface and normal modes of the free body.

    The attachment modes are responses of the free body to unit forces and moments at the interfaces, balanced by its
    own inertia; with them the static response at the interfaces is exact. Their rigid motion depends on the supports
    of their computation and is removed by mass orthogonality.  Raises InputError without interfaces.
    Source: Craig & Chang (1977), NASA CR-2731; Craig & Kurdila (2006), ch. 17.
    """
    require_distinct_frames(interfaces_of(given, 1, "attachment modes need an interface to load"))
    note = "six rigid-body modes were removed; the attachment modes' rigid motion was removed by mass orthogonality"
    return _free_condition(model, note, rows(given.interfaces, model.size))


def residual_flexibility(model: Model, given: Given) -> Condition:
    """Return the condition for six residual attachment modes per interface and normal modes of the free body.

    A residual attachment mode is the part of the response to a unit load at an interface that the normal modes miss; it
    is orthogonal to them. The space is Craig and Chang's; the shapes stay independent however many normal modes are
    retained.  Raises InputError without interfaces.
    Source: MacNeal (1971), Computers & Structures 1, 581-601; Rubin (1975), AIAA Journal 13, 995-1006.
    """
    return replace(craig_chang(model, given), residual=True)


def mean_axis(model: Model, given: Given) -> Condition:
    """Return the condition that `given.of` names, with linear and angular momentum removed from its shapes."""
    if given.of is None or given.of == "mean-axis":
        problem = "mean-axis changes the shapes of another condition; none is given"
        raise InputError("modes.of", problem, 'name it, as of = "craig-bampton"')

    based: Condition = lookup(CONDITIONS, given.of, kind="reference condition", where="modes.of")(model, given)
    note = f"shapes of {given.of}; their linear and angular momentum was removed"
    return replace(based, mean_axes=True, note=note)


def _free_condition(model: Model, note: str, loaded: sp.csr_array | None = None) -> Condition:
    """Return the condition for normal modes of the free body, and attachment modes for `loaded` functionals."""
    none = sp.csr_array((0, model.size))
    return Condition(none, note, np.empty(0, dtype=int), none if loaded is None else loaded, mean_axes=True)


CONDITIONS: dict[str, Callable[[Model, Given], Condition]] = {
    "free-free": free_free,
    "fixed-fixed": fixed_fixed,
    "cantilever": cantilever,
    "pinned-pinned": pinned_pinned,
    "constrained": hold_motions,
    "mean-axis": mean_axis,
    "craig-bampton": craig_bampton,
    "given": given_shapes,
    "craig-chang": craig_chang,
    "residual-flexibility": residual_flexibility,
}
