r"""Static equilibrium: positions in which the forces along all free motions vanish.

Newton's method on those forces, in the metric of the mass. The stiffness enters by the magnitude of its eigenvalues, so
that a step goes downhill also where a mechanism is about to tip over; it is limited in length, and a line search on the
power of the unbalanced force along the step halves it until it no longer shoots far past the balance. The power, not
an energy, because a force need not have a potential; a ball finds the floor of its socket, where the stiffness jumps
from nothing to 1e8 N/m, in some thirty steps.

Source: line search by the power: Crisfield, *Non-linear Finite Element Analysis*, vol. 1, sec. 9.2.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from flexclear.pipeline.core.artifacts.labelled import Labelled
from flexclear.pipeline.core.scene.schema import Scene
from flexclear.pipeline.core.system.errors import SolverError
from flexclear.pipeline.core.system.progress import Progress
from flexclear.pipeline.dynamics.linear.bench import Bench, closed, hold
from flexclear.pipeline.dynamics.linear.tangent import Tangent, magnitude, stiffness, tangent
from flexclear.pipeline.dynamics.model.model import Model

#: iterations before giving up
MOST_MOVES = 200
#: longest step, as a fraction of the mechanism's size or of a radian
LONGEST_MOVE = 0.2
#: balanced: unbalanced force below this fraction of those in balance (or of the weight), or a step too short to matter
BALANCED, SHORT_MOVE = 1e-12, 1e-14
#: what rounding may leave when iterations no longer gain
STALLED = 1e-8
#: eigenvalues of the stiffness below this fraction of the largest hold nothing
LIMP = 1e-12
#: a step may end with this fraction of the starting power turned against it
OVERSHOOT = 0.5


@dataclass(frozen=True)
class Equilibrium:
    """A pose in balance. residual: largest unbalanced force, moments divided by the mechanism's size [N]."""

    at: Tangent
    residual: float
    iterations: int


def equilibrium(
    scene: Scene,
    bundles: Mapping[str, Labelled],
    progress: Progress,
    time: float | None,
    drives: Mapping[str, float] | None,
) -> tuple[Bench, Equilibrium]:
    """The bench of a scene and its equilibrium, drives held; see `pipeline.dynamics.equilibrium`."""
    bench, q = hold(scene, bundles, progress, time, drives, False)
    progress(None, "Computing the equilibrium")
    return bench, descend(bench, q)


def descend(bench: Bench, q: np.ndarray) -> Equilibrium:
    """The equilibrium close to positions q (loops closed); SolverError when there is none, or the search fails."""
    at = tangent(bench, q)
    best, since = np.inf, 0
    for iteration in range(MOST_MOVES):
        size = float(np.linalg.norm(at.unbalanced))
        largest = max(weight(bench), magnitude(at.Z, at.bias))
        since = 0 if size < 0.5 * best else since + 1
        best = min(best, size)
        if size <= BALANCED * largest or (since > 3 and size <= STALLED * largest):
            return Equilibrium(at, residual(bench, at), iteration)
        step = _step(bench, at, BALANCED * largest)
        if float(np.max(np.abs(at.Z @ step) / bench.model.speed_scales)) <= SHORT_MOVE:
            return Equilibrium(at, residual(bench, at), iteration)
        at = _search(bench, at, step)
    loose = _leading(bench.model, at.Z @ at.unbalanced, at.mass)
    raise SolverError(
        f"the search for a static equilibrium close to this pose failed in {MOST_MOVES} iterations: "
        f"a force of {residual(bench, at):.3g} N stays unbalanced, most of it at {loose}; "
        "hold that motion by a joint, a drive or a spring"
    )


def weight(bench: Bench) -> float:
    """Norm of gravity's force in the metric of the mass, as if all bodies fell [kg^0.5 m/s^2]."""
    mass = sum(link.mass for link in bench.model.links)
    return float(np.sqrt(mass) * np.linalg.norm(bench.model.gravity))


def residual(bench: Bench, at: Tangent) -> float:
    """Largest unbalanced force of a coordinate, moments divided by the mechanism's size [N]."""
    forces = at.mass @ at.Z @ at.unbalanced
    return float(np.max(np.abs(forces) * bench.model.speed_scales, initial=0.0)) / bench.model.length


def _step(bench: Bench, at: Tangent, negligible: float) -> np.ndarray:
    """Displacement along the free motions, towards balance."""
    K, _ = stiffness(bench, at, at.Z)
    k, axes = np.linalg.eigh(0.5 * (K + K.T))
    force = axes.T @ at.unbalanced
    floor = max(LIMP * float(np.max(np.abs(k))), 1e-30)
    along = np.where(np.abs(force) > negligible / len(k), -force / np.maximum(np.abs(k), floor), 0.0)
    size = bench.model.speed_scales[:, None]
    reach = np.max(np.abs(at.Z @ axes) / size, axis=0)
    along = np.clip(along, -LONGEST_MOVE / reach, LONGEST_MOVE / reach)
    step = axes @ along
    return step * min(1.0, LONGEST_MOVE / max(float(np.max(np.abs(at.Z @ step) / size[:, 0])), 1e-300))


def _search(bench: Bench, at: Tangent, step: np.ndarray) -> Tangent:
    """The pose after the step or a part of it."""
    direction = at.Z @ step
    fraction, power = 1.0, -float(step @ at.unbalanced)
    for _ in range(80):
        try:
            new = tangent(bench, closed(bench, at.q + fraction * (at.moves @ direction)))
        except SolverError:
            fraction *= 0.5
            continue
        if -float((new.Z.T @ (at.mass @ direction)) @ new.unbalanced) >= -OVERSHOOT * power:
            return new
        fraction *= 0.5
    raise SolverError(f"at t = {bench.time:.6g} s: no step towards static equilibrium can be made from this pose")


def _leading(model: Model, motion: np.ndarray, mass: np.ndarray) -> str:
    """What has most of the kinetic energy of a motion: a joint, a body held by none, or the deformation of one.

    motion: speeds, shape (nv,).
    """
    energy, fractions = motion * (mass @ motion), dict[str, float]()
    for i, link in enumerate(model.links[1:], start=1):
        edge, mine = link.branch.edge, model.numbering.coordinates[i]
        name = f"joint {edge.name}" if edge is not None else f"body {link.group.host}"
        if not link.drives:
            fractions[name] = fractions.get(name, 0.0) + float(energy[mine].sum())
        if link.flexible:
            fractions[f"deformation of {link.flexible}"] = float(energy[model.numbering.modal_coordinates[i]].sum())
    return max(fractions, key=lambda name: fractions[name])
