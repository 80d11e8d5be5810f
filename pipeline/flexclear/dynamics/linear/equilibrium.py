r"""Poses in balance: static equilibrium, where the forces along all free motions vanish, and steady motion, where they
balance, those of inertia included, while the drives keep their speed.

Static equilibrium by Newton's method in the metric of the mass. The stiffness enters by the magnitude of its
eigenvalues, so that a step also descends where a mechanism is about to tip over; its length is limited, and a
line search on the power of the unbalanced force along the step halves it until it no longer overshoots the
balance. It uses the power, not an energy, because a force need not have a potential. A ball reaches its socket's floor,
where the stiffness jumps from zero to 1e8 N/m, in some thirty steps.

Steady motion by full steps, because it need not be a minimum: above its critical speed an unbalanced rotor
is held by gyroscopic forces in a pose from which the forces alone push away (self-centring). Where a single start does
not lead there, the speed grows in strides from rest, each starting from the pose before; a stride may pass a critical
speed, at which an undamped rotor has no steady motion. Stability is judged afterwards, by the eigenvalues.

Source: line search by the power: Crisfield, *Non-linear Finite Element Analysis*, vol. 1, sec. 9.2; strides: Allgower &
Georg (2003), Introduction to Numerical Continuation Methods, ch. 2; self-centring: Genta (2005), Dynamics of Rotating
Systems, sec. 2.4.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from flexclear.artifacts.labelled import Labelled
from flexclear.dynamics.linear.bench import (
    Bench,
    advance_drives,
    approach_in_steps,
    balance,
    close,
    hold,
    set_drives,
)
from flexclear.dynamics.linear.floquet import PROBE, small_motions
from flexclear.dynamics.linear.tangent import EPSILON, Tangent, stiffness, tangent
from flexclear.dynamics.linear.vibrations import ZERO_EIGENVALUE, Vibrations, is_symmetric, vibrations
from flexclear.dynamics.model.model import Model
from flexclear.dynamics.run.evaluation.closure_rows import row_units
from flexclear.scene.loads import Bushing
from flexclear.scene.schema import Scene
from flexclear.system.errors import SolverError
from flexclear.system.progress import Progress

#: largest number of iterations
MOST_MOVES = 200
#: longest step, as a fraction of the mechanism's size or of a radian
LONGEST_MOVE = 0.2
#: balanced: unbalanced force below this fraction of the balancing forces (or of the weight), or step below this length
BALANCED, SHORT_MOVE = 1e-12, 1e-14
#: relative unbalanced force that counts as rounding when iterations stop improving
STALLED = 1e-8
#: eigenvalues of the stiffness below this fraction of the largest count as zero
NO_STIFFNESS = 1e-12
#: corrections of one pose; each must be at most this fraction of the one before, else the step of the speed is halved
CORRECTIONS, CONTRACTION = 20, 0.5
#: corrections below this fraction of the mechanism's size, or of a radian, that stop shrinking are rounding
STALLED_CORRECTION = 1e-8
#: smallest step, as a fraction of the drives' speed: narrow compared to the distance of two critical speeds
SHORTEST = 1.0 / 256.0
#: relative speeds of the loops, and relative change of the forces along the drives' motion, that steady motion may have
STEADY = 1e-9


@dataclass(frozen=True)
class Equilibrium:
    """A pose in balance. residual: largest unbalanced force, moments divided by the mechanism's size [N]."""

    at: Tangent
    residual: float
    iterations: int


def descend(bench: Bench, q: np.ndarray) -> Equilibrium:
    """Return the equilibrium close to positions q (loops closed); raise SolverError when the search fails.

    Motions that nothing holds there, such as that of a roller about its pin, end where they began.
    """
    rest = _follow_forces(bench, tangent(bench, q))
    # 4: returns of unheld motions to where they began, which converge quadratically
    for _ in range(4):
        at = rest.at
        K, _ = stiffness(bench, at, at.Z)
        k, axes = np.linalg.eigh(0.5 * (K + K.T))
        free = at.Z @ axes[:, np.abs(k) <= NO_STIFFNESS * np.max(np.abs(k), initial=0.0)]
        back = free @ (free.T @ at.mass @ np.linalg.lstsq(at.moves, q - at.q, rcond=None)[0])
        if not SHORT_MOVE < np.max(np.abs(back) / bench.model.speed_scales, initial=0.0) < LONGEST_MOVE:
            break
        rest = _follow_forces(bench, tangent(bench, close(bench, at.q + at.moves @ back)))
    return rest


def _follow_forces(bench: Bench, at: Tangent) -> Equilibrium:
    """Return the equilibrium to which forces lead from a pose."""
    best, since = np.inf, 0
    for iteration in range(MOST_MOVES):
        size = float(np.linalg.norm(at.unbalanced))
        largest = max(weight(bench), at.magnitude(bench.model.speed_scales))
        since = 0 if size < 0.5 * best else since + 1
        best = min(best, size)
        if size <= BALANCED * largest or (since > 3 and size <= STALLED * largest):
            return Equilibrium(at, residual(bench, at), iteration)
        step = _step(bench, at, BALANCED * largest)
        if float(np.max(np.abs(at.Z @ step) / bench.model.speed_scales)) <= SHORT_MOVE:
            return Equilibrium(at, residual(bench, at), iteration)
        at = _search(bench, at, step)
    loose = _dominant_part(bench.model, at.Z @ at.unbalanced, at.mass)
    raise SolverError(
        f"the search for a static equilibrium close to this pose failed in {MOST_MOVES} iterations: "
        f"a force of {residual(bench, at):.3g} N stays unbalanced, most of it at {loose}; "
        "restrain that motion by a joint, a drive or a spring"
    )


def weight(bench: Bench) -> float:
    """Return the norm of gravity's force in the metric of the mass, as if all bodies fell [kg^0.5 m/s^2]."""
    mass = sum(link.mass for link in bench.model.links)
    return float(np.sqrt(mass) * np.linalg.norm(bench.model.gravity))


def residual(bench: Bench, at: Tangent) -> float:
    """Return the largest unbalanced force of a coordinate, moments divided by the mechanism's size [N]."""
    forces = at.mass @ at.Z @ at.unbalanced
    return float(np.max(np.abs(forces) * bench.model.speed_scales, initial=0.0)) / bench.model.length


def _step(bench: Bench, at: Tangent, negligible: float) -> np.ndarray:
    """Return the displacement along the free motions, towards balance."""
    K, error = stiffness(bench, at, at.Z)
    k, axes = np.linalg.eigh(0.5 * (K + K.T))
    force = axes.T @ at.unbalanced
    floor = max(NO_STIFFNESS * float(np.max(np.abs(k))), 1e-30)
    along = np.where(np.abs(force) > negligible / len(k), -force / np.maximum(np.abs(k), floor), 0.0)
    size = bench.model.speed_scales[:, None]
    reach = np.max(np.abs(at.Z @ axes) / size, axis=0)
    along = np.clip(along, -LONGEST_MOVE / reach, LONGEST_MOVE / reach)
    step = axes @ along
    if not is_symmetric(K, error):  # forces across the displacement, which may exceed those along it
        whole = -np.linalg.lstsq(K, at.unbalanced, rcond=NO_STIFFNESS)[0]
        step = whole if whole @ at.unbalanced < 0.0 else step
    return step * min(1.0, LONGEST_MOVE / max(float(np.max(np.abs(at.Z @ step) / size[:, 0])), 1e-300))


def _search(bench: Bench, at: Tangent, step: np.ndarray) -> Tangent:
    """Return the pose after the step or a part of the step."""
    direction = at.Z @ step
    fraction, power = 1.0, -float(step @ at.unbalanced)
    for _ in range(80):
        try:
            new = tangent(bench, close(bench, at.q + fraction * (at.moves @ direction)))
        except SolverError:
            fraction *= 0.5
            continue
        # largest fraction of the starting power that may act against the step at its end
        if -float((new.Z.T @ (at.mass @ direction)) @ new.unbalanced) >= -0.5 * power:
            return new
        fraction *= 0.5
    raise SolverError(f"at t = {bench.time:.6g} s: no step towards static equilibrium is possible from this pose")


def _dominant_part(model: Model, motion: np.ndarray, mass: np.ndarray) -> str:
    """Name the joint, body without joint, or deformation with most of the kinetic energy of a motion.

    motion: speeds, shape (nv,).
    """
    energy, fractions = motion * (mass @ motion), dict[str, float]()
    for i, link in enumerate(model.links[1:], start=1):
        edge, coordinates = link.branch.edge, model.numbering.coordinates[i]
        name = f"joint {edge.name}" if edge is not None else f"body {link.group.host}"
        if not link.drives:
            fractions[name] = fractions.get(name, 0.0) + float(energy[coordinates].sum())
        if link.flexible:
            fractions[f"deformation of {link.flexible}"] = float(energy[model.numbering.modal_coordinates[i]].sum())
    return max(fractions, key=lambda name: fractions[name])


def bench_in_equilibrium(
    scene: Scene,
    bundles: Mapping[str, Labelled],
    progress: Progress,
    time: float | None = None,
    drives: Mapping[str, float] | None = None,
    moving: bool = False,
) -> tuple[Bench, Equilibrium, Vibrations | None]:
    """Return the bench of a scene, its equilibrium or steady motion, and for the latter the vibrations about it.

    For the arguments see `dynamics.analyses.equilibrium`.
    """
    bench, q = hold(scene, bundles, progress, time, drives, moving)
    progress(None, f"Computing the {'steady motion' if moving else 'equilibrium'}")
    return (bench, *steady_near(bench, q)) if moving else (bench, descend(bench, q), None)


def steady_near(bench: Bench, q: np.ndarray) -> tuple[Equilibrium, Vibrations]:
    """Return the steady motion near positions q (loops closed), and the vibrations about it.

    Where Newton's method reaches an unstable one, a stable one from the equilibrium search is preferred, as for a
    governor whose arms rise.  Raises SolverError when none is found, or when the motion is not steady.
    """
    reached, failure = list[tuple[Equilibrium, Vibrations]](), None
    # angles with their full turns, which the search tracks, belong to the pose
    internal, kept = bench.internal.copy(), list[np.ndarray]()
    for find in (_steady_motion, descend) if np.any(bench.drives[:, 1]) else (descend,):
        bench.internal[:] = internal
        try:
            rest = find(bench, q)
            steady = _is_steady(bench, rest.at)
            reached.append((rest, small_motions(bench, rest.at) if steady else vibrations(bench, rest.at)))
            kept.append(bench.internal.copy())
        except SolverError as error:
            failure = failure or error
            continue
        if reached[-1][1].stable:
            break
    if not reached:
        assert failure is not None
        bench.internal[:] = internal
        _require_turning_frames(bench)
        raise failure
    best = next((k for k, (_, small) in enumerate(reached) if small.stable), 0)
    bench.internal[:] = kept[best]
    if not _is_steady(bench, reached[best][0].at):
        _require_turning_frames(bench)
        raise SolverError(
            f"at t = {bench.time:.6g} s: the drives' motion is not steady: the forces on the free coordinates change "
            "with the drives; hold the drives instead"
        )
    return reached[best]


def _steady_motion(bench: Bench, q: np.ndarray) -> Equilibrium:
    """Return the steady motion by Newton's method, at once or with the drives' speed increased from rest."""
    internal = bench.internal.copy()
    try:
        return newton(bench, q)
    except SolverError:
        bench.internal[:] = internal

    def at(fraction: float, before: Equilibrium) -> Equilibrium:
        set_drives(bench, bench.drives * [1.0, fraction])
        internal = bench.internal.copy()
        try:
            return newton(bench, before.at.q)
        except SolverError:
            bench.internal[:] = internal
            raise

    try:
        set_drives(bench, bench.drives * [1.0, 0.0])
        return approach_in_steps(at, descend(bench, q), 1.0, SHORTEST)
    finally:
        set_drives(bench, bench.drives)


def newton(bench: Bench, q: np.ndarray) -> Equilibrium:
    """Return the pose that full Newton steps reach from q; raise SolverError where they do not contract."""
    at, last, iteration = tangent(bench, q), np.inf, 0
    size = bench.model.speed_scales
    for iteration in range(1, CORRECTIONS + 1):
        step = _correction(bench, at, BALANCED * at.magnitude(size))
        length = float(np.max(np.abs(step) / size, initial=0.0))
        if length <= SHORT_MOVE or (length <= STALLED_CORRECTION and length > CONTRACTION * last):
            return Equilibrium(at, residual(bench, at), iteration)
        if not length <= min(LONGEST_MOVE, CONTRACTION * last):
            break
        at, last = tangent(bench, close(bench, at.q + at.moves @ step)), length
    raise SolverError(
        f"at t = {bench.time:.6g} s: no steady motion was reached from this pose in {iteration} corrections; a force "
        f"of {residual(bench, at):.3g} N stays unbalanced"
    )


def _correction(bench: Bench, at: Tangent, negligible: float) -> np.ndarray:
    """Return Newton's step of all coordinates, shape (nv,), without motions that have no stiffness."""
    if not at.Z.shape[1]:
        return np.zeros(len(at.bias))
    first, _ = stiffness(bench, at, at.Z)
    # along the principal motions, rounding of stiff ones does not hide soft ones
    motions = at.Z @ np.linalg.svd(first)[2].T
    K, error = stiffness(bench, at, motions)
    size, forces = np.linalg.norm(K, axis=0), motions.T @ at.bias
    firm = size > np.maximum(ZERO_EIGENVALUE * error, np.finfo(float).tiny)
    along = -np.linalg.lstsq(K[:, firm] / size[firm], forces, rcond=None)[0] / size[firm]
    left = float(np.linalg.norm(forces + K[:, firm] @ along))
    if left > max(negligible, STALLED_CORRECTION * float(np.linalg.norm(forces))):
        raise SolverError(
            f"at t = {bench.time:.6g} s: a motion has no stiffness against a force of {residual(bench, at):.3g} N"
        )
    return motions[:, firm] @ along


def _is_steady(bench: Bench, at: Tangent) -> bool:
    """Return True when balance and closed loops persist while the drives move on."""
    fastest = bench.fastest
    if fastest == 0.0:
        return True
    model, before = bench.model, balance(bench, at.q)
    forces = before.moment
    units = row_units(model, bench.engine.h, model.length)
    loops = float(np.max(np.abs(before.slip) / units, initial=0.0))
    if loops > STEADY * fastest:
        return False
    with advance_drives(bench, PROBE / fastest) as later:
        after = balance(later, at.q)
        forces = max(forces, after.moment)
    change = float(np.max(np.abs(after.bias - before.bias) * model.speed_scales, initial=0.0))
    return change <= STEADY * forces + _rounding_moment(bench, at)


def _rounding_moment(bench: Bench, at: Tangent) -> float:
    """Return the effect of position rounding on stiff balancing forces along the free motions, as moments [N m]."""
    K, _ = stiffness(bench, at, at.Z)
    forces = at.mass @ at.Z @ K @ at.Z.T @ at.mass
    size = bench.model.speed_scales
    return EPSILON * float(np.max(size * (np.abs(forces) @ size), initial=0.0))


def _require_turning_frames(bench: Bench) -> None:
    """Raise SolverError for a body with bushings only: its coordinates do not move with the drives."""
    loose = {name for link in bench.model.links[1:] if link.branch.edge is None for name in link.placements}
    fixed = {name for name, body in bench.scene.body.items() if body.type == "ground"}
    for name, load in bench.scene.forces().items():
        if not isinstance(load, Bushing):
            continue
        bodies = {frame.partition(".")[0] for frame in load.between}
        for body in loose & bodies if not bodies & fixed else ():
            raise SolverError(
                f"at t = {bench.time:.6g} s: {body} has no joint: its coordinates do not follow the drives, so "
                f"that none of its poses is steady; give it a joint of type `free` with the frames of bushing {name}: "
                f'between = ["{load.between[0]}", "{load.between[1]}"]'
            )
