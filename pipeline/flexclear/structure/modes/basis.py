"""Shapes of a body under a reference condition: static shapes, and the requested number of normal modes.

A cluster of equal frequencies is retained as a whole or not at all.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from flexclear.structure.fe.model import Interface, Model
from flexclear.structure.fe.statics import Flexibility, factorise_border
from flexclear.structure.modes import deficits, normal
from flexclear.structure.modes.normal import WHERE, Normal
from flexclear.structure.modes.reference import Condition
from flexclear.system.errors import InputError
from flexclear.system.progress import Progress

#: normal modes in the first attempt where a fraction decides how many are needed; each further attempt doubles them
FIRST = 16
#: modes computed beyond those requested, to see where the last cluster ends
MARGIN = 8


@dataclass(frozen=True, slots=True)
class ModeRequest:
    """Rule for the number of coordinates; without any entry, all coordinates of the mesh.

    count: elastic coordinates, static ones included.  up_to: highest normal retained frequency [Hz].
    compliance: least fraction of the static compliance between the interfaces, in each direction.
    mass: least fraction of the mass that moves with the basis, in each direction.
    """

    count: int | None = None
    up_to: float | None = None
    compliance: float | None = None
    mass: float | None = None


@dataclass(frozen=True)
class Body:
    """A model with its reference condition, its interface frames, and its static response on demand."""

    model: Model
    condition: Condition
    interfaces: tuple[Interface, ...]
    flexibility: Callable[[], Flexibility]
    progress: Progress

    def normal(self, count: int) -> Normal:
        """Return the lowest normal modes."""
        return normal.lowest_modes(self.model, self.condition.held, count, self.flexibility, self.progress)


def build(body: Body, requested: ModeRequest) -> tuple[np.ndarray, np.ndarray]:
    """Return static shapes and normal modes; rigid motion is removed where the condition requires it.

    Independent shapes that respect the condition, in any combination and scale, (ndof, count); and frequencies [Hz] of
    rigid-body modes that were left out, ascending, maybe none.

    Raises InputError for a count beyond the mesh or within a cluster, and for fractions that no count reaches.
    """
    if requested == ModeRequest() and body.condition.loaded.shape[0]:
        # the normal modes of a free body span all that its attachment modes could add
        body = replace(body, condition=replace(body.condition, loaded=body.condition.loaded[:0]))
    static = _static_shapes(body)
    free = count_normal_modes(body.model, body.condition)
    if body.condition.shapes is not None and requested.count is None and requested != ModeRequest():
        raise InputError(WHERE, "given shapes are taken as they are, all of them", 'write count = "all"')
    if requested.count is not None or requested == ModeRequest():
        count = count_required_modes(requested.count, free, static.shape[1])
        none = Normal(np.empty(0), np.empty((body.model.size, 0)), np.empty(0))
        modes = body.normal(min(count + MARGIN, free)) if count else none
        count = require_whole_clusters(modes.values, count, static.shape[1])
        return _static_and_normal_shapes(body, static, modes, count), modes.rigid_frequency
    tried = FIRST
    while True:
        modes = body.normal(min(tried, free))
        # static shapes alone are a basis; no shape at all is not
        ends = [0] * bool(static.shape[1]) + [stop for _, stop in normal.clusters(modes.values)]
        _check_first(modes, static, requested)
        # the last cluster may continue beyond the computed modes
        for stop in ends if tried >= free else ends[:-1]:
            if _has_enough_modes(body, static, modes, stop, requested):
                return _static_and_normal_shapes(body, static, modes, stop), modes.rigid_frequency
        if tried >= free:
            raise _unreachable_error(body, static, modes, requested)
        tried *= 2


def count_required_modes(count: int | None, available: int, static: int = 0) -> int:
    """Return how many of the `available` normal modes a basis of `count` coordinates needs; None selects all.

    static: constraint modes that the count includes.  Raises InputError for a count that the mesh cannot give.
    """
    if count is None:
        return available
    total = available + static
    if count > total:
        problem = f"{count} modes are requested, but the mesh has {total} elastic coordinates"
        raise InputError(WHERE, problem, f"request at most {total}")
    least = max(static, 1)
    if count < least:
        reason = f": the {static} constraint modes of its interfaces are part of the basis" if static else ""
        raise InputError(WHERE, f"a basis of {count} modes is too small{reason}", f"request at least {least}")
    return count - static


def require_whole_clusters(values: np.ndarray, n: int, static: int = 0) -> int:
    """Return the number n of retained modes; raise InputError when n would cut a cluster of equal frequencies.

    values: ascending eigenvalues [rad^2/s^2] of the normal modes, more than are retained unless all are.
    static: see `count_required_modes`.
    """
    for start, stop in normal.clusters(values):
        if start < n < stop:
            counts = [c + static for c in (start, stop) if c + static > 0]
            hertz = float(normal.eigenvalues_to_hz(values[start : start + 1])[0])
            nearest = f"count is {counts[0]}" if len(counts) == 1 else f"counts are {counts[0]} and {counts[1]}"
            problem = f"{n + static} modes split a cluster of {stop - start} equal frequencies at {hertz:.6g} Hz"
            raise InputError(WHERE, problem, f"the nearest whole {nearest}")
    return n


def count_normal_modes(model: Model, condition: Condition) -> int:
    """Return the number of normal modes of a mesh under a reference condition."""
    if condition.shapes is not None:
        return 0
    held = condition.held.shape[0]
    return model.size - (held or 6) - (0 if held else condition.loaded.shape[0])


def _static_shapes(body: Body) -> np.ndarray:
    """Return constraint modes of the moved functionals, or attachment modes of the loaded ones, shape (ndof, s)."""
    condition = body.condition
    if condition.shapes is not None:
        return condition.shapes
    if len(condition.moved):
        body.progress(None, "static shapes")
        return factorise_border(body.flexibility(), condition.held).shapes(condition.moved)
    if condition.loaded.shape[0]:
        body.progress(None, "static shapes")
        flexibility = body.flexibility()
        loads = flexibility.balance_loads(condition.loaded.T.toarray())
        return flexibility.remove_momentum(flexibility.response(loads))
    return np.empty((body.model.size, 0))


def _static_and_normal_shapes(body: Body, static: np.ndarray, modes: Normal, count: int) -> np.ndarray:
    shapes = modes.shapes[:, :count]
    if body.condition.residual and static.size:
        # response of the retained modes to a load: phi phi^T f / omega^2, with f = K u
        static = static - shapes @ (shapes.T @ (body.model.mass @ static))
    vectors = np.hstack([static, shapes])
    if body.condition.mean_axes and body.condition.held.shape[0]:
        momentum = body.model.mass @ body.model.rigid
        vectors = vectors - body.model.rigid @ np.linalg.solve(body.model.rigid.T @ momentum, momentum.T @ vectors)
    return vectors


def _check_first(modes: Normal, static: np.ndarray, requested: ModeRequest) -> None:
    first = float(normal.eigenvalues_to_hz(modes.values[:1])[0])
    if requested.up_to is not None and first > requested.up_to and not static.shape[1]:
        problem = f"no mode lies below {requested.up_to:.6g} Hz; the first is at {first:.6g} Hz"
        raise InputError("modes.up_to", problem, "request a higher frequency")


def _has_enough_modes(body: Body, static: np.ndarray, modes: Normal, count: int, requested: ModeRequest) -> bool:
    if requested.up_to is not None:
        following = modes.values[count : count + 1]
        return bool(following.size == 0 or normal.eigenvalues_to_hz(following)[0] > requested.up_to)
    vectors = _static_and_normal_shapes(body, static, modes, count)
    if requested.compliance is not None:
        return deficits.least_fraction(body.flexibility(), body.interfaces, vectors)[0] >= requested.compliance
    return requested.mass is not None and _mass_fraction(body.model, vectors) >= requested.mass


def _mass_fraction(model: Model, vectors: np.ndarray) -> float:
    """Return the least fraction, over three directions, of the mass that moves with the basis in a translation."""
    momentum = model.mass @ model.rigid[:, :3]
    inner = vectors.T @ (model.mass @ vectors)
    taken = np.einsum("nd,nd->d", vectors.T @ momentum, np.linalg.solve(inner, vectors.T @ momentum))
    return float((taken / np.einsum("nd,nd->d", model.rigid[:, :3], momentum)).min())


def _unreachable_error(body: Body, static: np.ndarray, modes: Normal, requested: ModeRequest) -> InputError:
    vectors = _static_and_normal_shapes(body, static, modes, len(modes.values))
    if requested.compliance is not None:
        fraction, where = deficits.least_fraction(body.flexibility(), body.interfaces, vectors)
        problem = f"with every mode of this reference condition the basis has {fraction:.3g} of the compliance {where}"
        return InputError("modes.compliance", problem, 'choose one with static shapes, as reference = "craig-bampton"')
    fraction = _mass_fraction(body.model, vectors)
    problem = f"with every mode of this reference condition {fraction:.3g} of the mass moves with the basis"
    return InputError("modes.mass", problem, "shapes without momentum carry no mass: select by count or up_to")
