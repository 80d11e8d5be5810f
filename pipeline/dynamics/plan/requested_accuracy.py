"""What an accuracy means in a scene: the largest errors that a plan may make, in SI units."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from flexclear.pipeline.core.artifacts import effect_size
from flexclear.pipeline.core.artifacts.points import Point
from flexclear.pipeline.core.scene.quantity import KINDS, OF_CLEARANCE, Quantity
from flexclear.pipeline.core.scene.schema import Scene
from flexclear.pipeline.core.system.errors import InputError, SolverError

#: peaks of forces between flexible bodies are at least this fraction of those between rigid ones
SOFTER = 0.5


def requested_in(
    scene: Scene, quantities: Sequence[Quantity], ideal: Point, rigid: Callable[[], Point]
) -> dict[str, float]:
    """What is requested by quantity [SI]; relative to the size that it has in the ideal mechanism, of contacts with
    rigid bodies, half of it where bodies are flexible.

    rigid: runs the scene with clearance and rigid bodies.
    Raises InputError where a quantity never changes, or everything asked for is above what the quantities do;
    SolverError where the mechanism with rigid bodies cannot be run.
    """
    accuracies, sizes = {}, {}
    where = f"{scene.path or scene.name} [accuracy]"
    assert scene.accuracy is not None
    for q in quantities:
        of_contact = any(KINDS[term.kind].owner in OF_CLEARANCE for term in q.terms())
        point = rigid() if of_contact else ideal
        if point.refused:
            raise SolverError(f"{scene.name}: the mechanism with rigid bodies cannot be run: {point.refused}")
        sizes[q.name] = effect_size.size(point, q) * (SOFTER if of_contact and scene.flexible() else 1.0)
        want = scene.accuracy.quantities[q.name]
        accuracies[q.name] = want.absolute if want.absolute is not None else (want.relative or 0.0) * sizes[q.name]
        if not accuracies[q.name] > 0.0:
            raise InputError(
                f"{where} {q.name}",
                "a relative accuracy of a quantity that never changes in the ideal mechanism",
                "give an absolute one, with a unit",
            )
    if all(accuracies[name] >= most for name, most in sizes.items()):
        # forces and rates may come from impacts alone
        more = rigid() if scene.contacts() or scene.stop else ideal
        sizes = {q.name: max(sizes[q.name], 0.0 if more.refused else effect_size.size(more, q)) for q in quantities}
    if all(accuracies[name] >= most for name, most in sizes.items()):
        q = quantities[0]
        raise InputError(
            f"{where} {q.name}",
            f"{accuracies[q.name]:.3g} {q.unit} is more than it changes ({sizes[q.name]:.3g} {q.unit}), "
            "and so are all other accuracies that are asked for: the plan would leave out everything, even the motion",
            "ask for an accuracy below what the quantity does",
        )
    return accuracies
