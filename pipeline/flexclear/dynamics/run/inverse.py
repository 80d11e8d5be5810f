r"""Inverse dynamics: the forces of named actuators that move a frame along its path.

Two runs are needed. The first one prescribes the path itself; whatever it leaves free moves by the equations of motion.
The second one prescribes the actuators' coordinates as they moved; its drive forces, joint forces and works are those
of the mechanism without external help.

Both runs have the same motion if the actuators can supply the path's forces: with the admissible speeds
:math:`v = N z`, :math:`N_P z` those of the path and :math:`N_B z` those of the actuators, every
generalised force :math:`N_P^T\mu` must be some :math:`N_B^T\tau`, and :math:`\tau` is unique if the
rows of :math:`N_B` are independent.

With more actuators than freedoms, as many actuators as freedoms produce the motion alone in a second run, with the
forces :math:`\tau_S`. With the rates of all :math:`\dot q = T \dot q_S`, any :math:`\tau` with
:math:`T^T\tau = \tau_S` produces it, too, and :math:`T (T^T T)^{-1} \tau_S` is the least of them. In a third run the
other actuators act as loads, linear between two outputs, so that joint forces and works belong to this distribution.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy.linalg import null_space, qr

from flexclear.artifacts.labelled import Labelled
from flexclear.dynamics import memory as m
from flexclear.dynamics.drives.pieces import Piece, Pieces
from flexclear.dynamics.equations.observation import Observed
from flexclear.dynamics.joints.coordinate import Coordinate
from flexclear.dynamics.model.driving import coordinate_of
from flexclear.dynamics.model.laws import NO_LAWS
from flexclear.dynamics.model.mechanism import build
from flexclear.dynamics.model.model import tabulate
from flexclear.dynamics.run.coordinates import joint_coordinates, label
from flexclear.dynamics.run.evaluation import closure_rows
from flexclear.dynamics.run.evaluation.engine import Engine, prepare
from flexclear.dynamics.run.evaluation.matrices import Matrices
from flexclear.dynamics.run.evaluation.observation import observe
from flexclear.dynamics.run.evaluation.start import consistent_start
from flexclear.dynamics.run.trajectory import Trajectory, integrate
from flexclear.dynamics.vectors import ZERO, Wrench
from flexclear.scene.drives import JointDrive, PathDrive
from flexclear.scene.laws import Constant
from flexclear.scene.loads import JointForce
from flexclear.scene.schema import Scene
from flexclear.system.errors import InputError
from flexclear.system.progress import Progress

#: singular values below this fraction of the largest are zero
RANK_TOLERANCE = 1e-8


def scene_with_actuators(
    scene: Scene, bundles: Mapping[str, Labelled], progress: Progress
) -> tuple[Scene, dict[str, Pieces]]:
    """Return the scene with driven actuators instead of driven paths, and the actuators' laws of motion.

    Raises InputError when the actuators cannot produce the motion, or could in more than one way.
    """
    requested, names = _actuators(scene)  # all of them can be named, before anything is compiled
    engine, start = _consistent_engine(scene, bundles, progress)
    alone = enough(engine, start)
    trajectory, *sides = _run(engine, start, progress)
    before, after = (joint_coordinates(engine.model, seen) for seen in sides)
    laws = {}
    for name in alone:
        joint, k, _ = _coordinate(scene, name)
        series = label(joint, scene.joint[joint].type, k)
        laws[name] = hermite(trajectory.time, np.array(before[series]), np.array(after[series]))
    other = _with_drives(scene, requested, alone)
    return (
        (other, laws) if len(alone) == len(names) else _with_actuators_as_loads(other, laws, names, bundles, progress)
    )


def _actuators(scene: Scene) -> tuple[dict[str, PathDrive], list[str]]:
    """Return the paths that actuators produce, and the actuators; raise InputError for one that cannot be named."""
    requested = {n: d for n, d in scene.drive.items() if isinstance(d, PathDrive) and d.actuators is not None}
    names = [a for path in requested.values() for a in path.actuators or ()]
    _with_drives(scene, requested, names)
    return requested, names


def _consistent_engine(
    scene: Scene, bundles: Mapping[str, Labelled], progress: Progress, laws: Mapping[str, Pieces] = NO_LAWS
) -> tuple[Engine, np.ndarray]:
    """Return an engine and its consistent start."""
    engine = prepare(tabulate(build(scene, bundles), laws), progress)
    return engine, consistent_start(engine)


def _run(engine: Engine, start: np.ndarray, progress: Progress) -> tuple[Trajectory, Observed, Observed]:
    """Return a run, and its outputs right before and right after each time."""
    trajectory = integrate(engine, start, progress)
    return trajectory, observe(engine, trajectory.rows), observe(engine, trajectory.rows, after=True)


def hermite(time: np.ndarray, before: np.ndarray, after: np.ndarray) -> Pieces:
    """Return quintics through value, rate and second rate, (3, times) each, left and right of every time."""
    pieces = []
    for k, h in enumerate(np.diff(time)):
        (x, v, a), (y, w, b) = after[:, k], before[:, k + 1]
        d, e, g = y - x - v * h - 0.5 * a * h * h, w - v - a * h, b - a
        c3 = (10.0 * d - 4.0 * e * h + 0.5 * g * h * h) / h**3
        c4 = (-15.0 * d + 7.0 * e * h - g * h * h) / h**4
        c5 = (6.0 * d - 3.0 * e * h + 0.5 * g * h * h) / h**5
        pieces.append(Piece(float(time[k]), (x, v, 0.5 * a, c3, c4, c5)))
    return Pieces(tuple(pieces))


def _coordinate(scene: Scene, actuator: str, path: str = "[drive]") -> tuple[str, int, Coordinate]:
    """Return the joint of an actuator, ``joint`` or ``joint.coordinate``; index and declaration of its coordinate."""
    joint, _, coordinate = actuator.partition(".")
    return coordinate_of(scene, joint, coordinate or None, path)


def _with_drives(scene: Scene, requested: Mapping[str, PathDrive], names: list[str]) -> Scene:
    """Return the scene with a drive of the same name for each actuator, whose law is given later."""
    others = {n: d for n, d in scene.drive.items() if n not in requested}
    made = {}
    for path, drive in requested.items():
        for name in (a for a in drive.actuators or () if a in names):
            where = f"[drive.{path}.actuators]"
            if name in others or name in made or name in scene.load:
                raise InputError(where, f"the name '{name}' is already in use", "name each actuator once")
            joint, _, _ = _coordinate(scene, name, where)
            made[name] = JointDrive(joint=joint, coordinate=_coordinate_name(name), law=Constant(type="constant"))
    return scene.model_copy(update={"drive": {**others, **made}})


def _coordinate_name(actuator: str) -> str | None:
    """Return the coordinate in an actuator's name, if any."""
    return actuator.partition(".")[2] or None


def enough(engine: Engine, start: np.ndarray) -> list[str]:
    """Select as many actuators as there are freedoms at the start: all, unless the scene allows redundant ones.

    Raises InputError when the actuators cannot produce the motion, or could in more than one way.
    """
    scene, nv, drives = engine.model.scene, engine.model.nv, engine.model.drives
    requested, names = _actuators(scene)
    if not names:
        return []
    closure_rows.evaluate(engine, start, engine.start)
    found = Matrices(engine, every_row=True)
    free = null_space(found.jacobian, rcond=RANK_TOLERANCE)
    known = [k for k, name in enumerate(drives) if name.partition(".")[0] in requested]
    held = [k for k in range(len(drives)) if k not in known]
    if held:  # other drives continue as they do
        free = free @ null_space(free[[nv + k for k in held]], rcond=RANK_TOLERANCE)
    of_path = free[[nv + k for k in known]]
    of_actuators = np.array([_rate(found, engine, scene, name) @ free for name in names])
    where = f"[drive.{next(iter(requested))}.actuators]"
    rank, both = _rank(of_actuators), _rank(np.vstack([of_actuators, of_path]))
    if both > rank:
        raise InputError(
            where,
            f"{', '.join(names)} cannot produce this motion: with them held, {both - rank} of its freedoms remain",
            "name further actuators",
        )
    if rank == len(names):
        return names
    if any(path.allocation == "unique" for path in requested.values()):
        raise InputError(
            where,
            f"{len(names)} actuators act on {rank} freedoms: their forces are not unique",
            f'name {rank} of them, or choose allocation = "least-norm"',
        )
    pivots = qr(of_actuators.T, mode="r", pivoting=True)[1]
    return [name for k, name in enumerate(names) if k in pivots[:rank]]


def _rank(matrix: np.ndarray) -> int:
    values = np.linalg.svd(matrix, compute_uv=False)
    return int(np.sum(values > RANK_TOLERANCE * max(values.max(initial=0.0), 1e-300)))


def _rate(found: Matrices, engine: Engine, scene: Scene, actuator: str) -> np.ndarray:
    """Return the rate of an actuator's coordinate per speed of the mechanism, free ones first, then prescribed."""
    model, (joint, k, coordinate) = engine.model, _coordinate(scene, actuator)
    rates = np.zeros(model.nv + len(model.drives))
    for i, link in enumerate(model.links):
        if link.branch.edge is not None and link.branch.edge.name == joint and k in link.joint.positions:
            rates[model.numbering.coordinates[i][link.joint.positions.index(k)]] = link.joint.sign
            return rates
    row = model.arrays.table(m.CLOSURES)[[closure.name for closure in model.closures].index(joint)]
    a, b = (found.mechanism.frames[row[site]] for site in ("site_a", "site_b"))
    along = found.motion(b if coordinate.side else a).R_WB.column(coordinate.axis)
    return found.moved_by(a, b, [Wrench(along, ZERO) if coordinate.turning else Wrench(ZERO, along)])[0]


def _with_actuators_as_loads(
    scene: Scene, laws: dict[str, Pieces], names: list[str], bundles: Mapping[str, Labelled], progress: Progress
) -> tuple[Scene, dict[str, Pieces]]:
    """Return the scene in which the actuators without a law act as loads, and the laws of all actuators.

    laws: of the actuators that produce the scene's motion alone.
    """
    engine, start = _consistent_engine(scene, bundles, progress, laws)
    trajectory, *sides = _run(engine, start, progress)
    before, after = (_least_forces(engine, scene, trajectory.time, seen, names, list(laws)) for seen in sides)
    loads, shared = {}, dict(laws)
    for k, name in enumerate(names):
        if name in laws:
            continue
        force = Constant(type="constant")
        joint, _, _ = _coordinate(scene, name)
        loads[name] = JointForce(type="joint-force", joint=joint, coordinate=_coordinate_name(name), force=force)
        shared[f"load.{name}"] = _linear(trajectory.time, before[:, k], after[:, k])
    return scene.model_copy(update={"load": {**scene.load, **loads}}), shared


def _least_forces(
    engine: Engine, scene: Scene, time: np.ndarray, seen: Observed, names: list[str], alone: list[str]
) -> np.ndarray:
    """Return the least forces of all actuators, (times, actuators); alone: those that produce the motion alone."""
    model = engine.model
    made = [model.drives.index(name) for name in alone]
    forces = seen.drive_force[:, made] * model.drive_signs[made]
    own = [names.index(name) for name in alone]
    least = []
    for t, state, force in zip(time, seen.state, forces, strict=True):
        engine.select_pieces_after(min(t + 1e-9 * (time[-1] - time[0]), 0.5 * (time[-1] + time[-2])))
        closure_rows.evaluate(engine, state, float(t))
        found = Matrices(engine, every_row=True)
        free = null_space(found.jacobian, rcond=RANK_TOLERANCE)
        rates = np.array([_rate(found, engine, scene, name) @ free for name in names])
        T = rates @ np.linalg.pinv(rates[own], rcond=RANK_TOLERANCE)
        least.append(T @ np.linalg.solve(T.T @ T, force))
    return np.array(least)


def _linear(time: np.ndarray, before: np.ndarray, after: np.ndarray) -> Pieces:
    """Return straight lines from the value right of each time to the value left of the next."""
    slopes = (before[1:] - after[:-1]) / np.diff(time)
    return Pieces(tuple(Piece(float(t), (float(x), float(s))) for t, x, s in zip(time, after, slopes, strict=False)))
