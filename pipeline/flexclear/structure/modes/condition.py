"""Reference conditions: the held motions, the static shapes that belong to them, and the removal of rigid motion."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from flexclear.structure.fe.model import Interface, Model, own_dofs
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


def distinct(frames: tuple[Interface, ...]) -> None:
    """Raise InputError when two frames move alike, so that the second one adds nothing."""
    for k, frame in enumerate(frames):
        for other in frames[:k]:
            if abs(frame.motion - other.motion).max() == 0.0:
                problem = f"two interfaces lie on the same node: '{other.name}' and '{frame.name}'"
                raise InputError("modes.interfaces", problem, "remove one of them")


def check(model: Model, condition: Condition) -> None:
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
