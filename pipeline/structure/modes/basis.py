"""The shapes of a body under a reference condition: static ones, and as many normal modes as are requested."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from flexclear.pipeline.core.system.errors import InputError
from flexclear.pipeline.core.system.progress import Progress
from flexclear.pipeline.structure.fe.model import Interface, Model
from flexclear.pipeline.structure.modes import compliance, eigen, normal, select
from flexclear.pipeline.structure.modes.condition import Condition
from flexclear.pipeline.structure.modes.normal import Normal
from flexclear.pipeline.structure.modes.select import ModeRequest
from flexclear.pipeline.structure.modes.statics import Flexibility, border

#: normal modes tried first where a fraction decides how many are needed; then twice as many, and so on
FIRST = 16


@dataclass(frozen=True)
class Basis:
    """Independent shapes that respect a reference condition, in any combination and scale.

    vectors: shape (ndof, count).
    rigid_frequency: frequencies [Hz] of rigid-body modes that were found and left out, ascending; may be empty.
    """

    vectors: np.ndarray
    rigid_frequency: np.ndarray


@dataclass(frozen=True)
class Body:
    """A model with its reference condition, the frames that it is joined at, and its statics on demand."""

    model: Model
    condition: Condition
    interfaces: tuple[Interface, ...]
    flexibility: Callable[[], Flexibility]
    progress: Progress

    def normal(self, count: int) -> Normal:
        """The lowest normal modes."""
        return normal.lowest(self.model, self.condition.held, count, self.flexibility, self.progress)


def build(body: Body, requested: ModeRequest) -> Basis:
    """Static shapes and normal modes, rigid motion taken out where the condition says so.

    Raises InputError for a count beyond the mesh or within a cluster, and for shares that no count reaches.
    """
    if requested == ModeRequest() and body.condition.loaded.shape[0]:
        # all normal modes of a free body span what its attachment modes could add
        body = replace(body, condition=replace(body.condition, loaded=body.condition.loaded[:0]))
    static = _static(body)
    free = available(body.model, body.condition)
    if requested.count is not None or requested == ModeRequest():
        count = select.request(requested.count, free, static.shape[1])
        none = Normal(np.empty(0), np.empty((body.model.size, 0)), np.empty(0))
        modes = body.normal(min(count + select.MARGIN, free)) if count else none
        return _joined(body, static, modes, select.whole(modes.values, count, static.shape[1]))
    tried = FIRST
    while True:
        modes = body.normal(min(tried, free))
        # static shapes alone are a basis, no shape at all is none
        ends = [0] * bool(static.shape[1]) + [stop for _, stop in select.clusters(modes.values)]
        _check_first(modes, static, requested)
        # the last cluster may continue beyond what was computed
        for stop in ends if tried >= free else ends[:-1]:
            if _enough(body, static, modes, stop, requested):
                return _joined(body, static, modes, stop)
        if tried >= free:
            raise _unreachable(body, static, modes, requested)
        tried *= 2


def available(model: Model, condition: Condition) -> int:
    """Number of normal modes of a mesh under a reference condition."""
    held = condition.held.shape[0]
    return model.size - (held or 6) - (0 if held else condition.loaded.shape[0])


def _static(body: Body) -> np.ndarray:
    """Constraint modes of the moved functionals, or attachment modes of the loaded ones, shape (ndof, s)."""
    condition = body.condition
    if len(condition.moved):
        body.progress(None, "static shapes")
        return border(body.flexibility(), condition.held).shapes(condition.moved)
    if condition.loaded.shape[0]:
        body.progress(None, "static shapes")
        flexibility = body.flexibility()
        loads = flexibility.balanced(condition.loaded.T.toarray())
        return flexibility.relieved(flexibility.response(loads))
    return np.empty((body.model.size, 0))


def _joined(body: Body, static: np.ndarray, modes: Normal, count: int) -> Basis:
    shapes = modes.shapes[:, :count]
    if body.condition.residual and static.size:
        # what the retained modes answer of a load: phi phi^T f / omega^2, with f = K u
        static = static - shapes @ (shapes.T @ (body.model.mass @ static))
    vectors = np.hstack([static, shapes])
    if body.condition.mean_axes and body.condition.held.shape[0]:
        momentum = body.model.mass @ body.model.rigid
        vectors = vectors - body.model.rigid @ np.linalg.solve(body.model.rigid.T @ momentum, momentum.T @ vectors)
    return Basis(vectors, modes.rigid_frequency)


def _check_first(modes: Normal, static: np.ndarray, requested: ModeRequest) -> None:
    first = float(eigen.frequency(modes.values[:1])[0])
    if requested.up_to is not None and first > requested.up_to and not static.shape[1]:
        problem = f"no mode lies below {requested.up_to:.6g} Hz; the first is at {first:.6g} Hz"
        raise InputError("modes.up_to", problem, "ask for a higher frequency")


def _enough(body: Body, static: np.ndarray, modes: Normal, count: int, requested: ModeRequest) -> bool:
    if requested.up_to is not None:
        following = modes.values[count : count + 1]
        return bool(following.size == 0 or eigen.frequency(following)[0] > requested.up_to)
    basis = _joined(body, static, modes, count)
    if requested.compliance is not None:
        return compliance.least(body.flexibility(), body.interfaces, basis.vectors)[0] >= requested.compliance
    return requested.mass is not None and _mass_fraction(body.model, basis.vectors) >= requested.mass


def _mass_fraction(model: Model, vectors: np.ndarray) -> float:
    """Least fraction, over three directions, of the mass that moves with the basis when the body is translated."""
    momentum = model.mass @ model.rigid[:, :3]
    inner = vectors.T @ (model.mass @ vectors)
    taken = np.einsum("nd,nd->d", vectors.T @ momentum, np.linalg.solve(inner, vectors.T @ momentum))
    return float((taken / np.einsum("nd,nd->d", model.rigid[:, :3], momentum)).min())


def _unreachable(body: Body, static: np.ndarray, modes: Normal, requested: ModeRequest) -> InputError:
    vectors = _joined(body, static, modes, len(modes.values)).vectors
    if requested.compliance is not None:
        fraction, where = compliance.least(body.flexibility(), body.interfaces, vectors)
        problem = f"with every mode of this reference condition the basis has {fraction:.3g} of the compliance {where}"
        return InputError("modes.compliance", problem, 'take one with static shapes, as reference = "craig-bampton"')
    fraction = _mass_fraction(body.model, vectors)
    problem = f"with every mode of this reference condition {fraction:.3g} of the mass moves with the basis"
    return InputError("modes.mass", problem, "shapes without momentum carry no mass: select by count or up_to")
