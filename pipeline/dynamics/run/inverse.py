r"""Inverse dynamics: the forces of named actuators that move a frame along its path.

The run is made twice. First the path itself is prescribed, and whatever it leaves free moves by the
equations of motion. Then the actuators' coordinates are prescribed as they moved, and their drive
forces, all joint forces and works are those of the mechanism without any help from outside.

Both runs have one motion if the actuators can supply what the path did: with the admissible speeds
:math:`v = N z`, :math:`N_P z` those of the path and :math:`N_B z` those of the actuators, every
generalised force :math:`N_P^T\mu` must be some :math:`N_B^T\tau`, and :math:`\tau` is unique if the
rows of :math:`N_B` are independent.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import xarray as xr
from scipy.linalg import qr

from pipeline.core.errors import InputError
from pipeline.core.scene.drives import JointDrive, PathDrive
from pipeline.core.scene.laws import Constant
from pipeline.core.scene.schema import Scene
from pipeline.dynamics import memory as m
from pipeline.dynamics.drives.pieces import Piece, Pieces
from pipeline.dynamics.joints.coordinate import Coordinate
from pipeline.dynamics.model.driving import coordinate_of
from pipeline.dynamics.model.mechanism import build
from pipeline.dynamics.model.model import Model, tabulate
from pipeline.dynamics.run.coordinates import joint_coordinates, label
from pipeline.dynamics.run.engine import Engine, Progress, consistent_start, observe, prepare
from pipeline.dynamics.run.trajectory import integrate as step

#: singular values below this are zero, of matrices between motions in radians and shares of the mechanism's size
RANK = 1e-8


def paths(scene: Scene) -> dict[str, PathDrive]:
    """Paths that actuators shall produce, by name."""
    return {n: d for n, d in scene.drive.items() if isinstance(d, PathDrive) and d.actuators is not None}


def actuated(scene: Scene, bundles: Mapping[str, xr.Dataset], progress: Progress) -> tuple[Scene, dict[str, Pieces]]:
    """The scene with its actuators driven instead of the paths, and the laws by which they move.

    Raises InputError when the actuators cannot produce the motion, or could in more than one way.
    """
    wanted = paths(scene)
    names = [a for path in wanted.values() for a in path.actuators or ()]
    _with_drives(scene, wanted, names)  # all of them can be named, before anything is compiled
    engine = prepare(tabulate(build(scene, bundles)), progress)
    start, _ = consistent_start(engine)
    engine.evaluate(start, engine.start)
    chosen = _enough(engine, scene, wanted, names)
    trajectory = step(engine, start, progress)
    before, after = observe(engine, trajectory.rows), observe(engine, trajectory.rows, after=True)
    sides = [joint_coordinates(engine.model, seen) for seen in (before, after)]
    laws = {}
    for name in chosen:
        series = [np.array(side[_full_name(scene, name)]) for side in sides]
        laws[name] = hermite(trajectory.time, *series)
    other = _with_drives(scene, wanted, chosen)
    if len(chosen) == len(names):
        return other, laws
    from pipeline.dynamics.run.allocation import share

    return share(other, laws, names, bundles, progress)


def hermite(time: np.ndarray, before: np.ndarray, after: np.ndarray) -> Pieces:
    """Quintics through value, rate and second rate, (3, times) each, left and right of every time."""
    pieces = []
    for k, h in enumerate(np.diff(time)):
        (x, v, a), (y, w, b) = after[:, k], before[:, k + 1]
        d, e, g = y - x - v * h - 0.5 * a * h * h, w - v - a * h, b - a
        c3 = (10.0 * d - 4.0 * e * h + 0.5 * g * h * h) / h**3
        c4 = (-15.0 * d + 7.0 * e * h - g * h * h) / h**4
        c5 = (6.0 * d - 3.0 * e * h + 0.5 * g * h * h) / h**5
        pieces.append(Piece(float(time[k]), (x, v, 0.5 * a, c3, c4, c5)))
    return Pieces(tuple(pieces))


def _with_drives(scene: Scene, wanted: Mapping[str, PathDrive], names: list[str]) -> Scene:
    """The scene with a drive per actuator, called like it; its law is given later."""
    kept = {n: d for n, d in scene.drive.items() if n not in wanted}
    made = {}
    for path, drive in wanted.items():
        for name in (a for a in drive.actuators or () if a in names):
            place = f"[drive.{path}.actuators]"
            if name in kept or name in made or name in scene.load:
                raise InputError(place, f"something called '{name}' acts already", "name each actuator once")
            joint, _, coordinate = name.partition(".")
            coordinate_of(scene, joint, coordinate or None, place)
            made[name] = JointDrive(joint=joint, coordinate=coordinate or None, law=Constant(type="constant"))
    return renamed(scene, {"drive": {**kept, **made}})


def renamed(scene: Scene, update: dict[str, object]) -> Scene:
    """The scene with other parts, under its own name."""
    changed = scene.model_copy(update=update)
    changed._name, changed._path = scene.name, scene.path
    return changed


def _full_name(scene: Scene, actuator: str) -> str:
    """The actuator's coordinate as records name it."""
    joint, _, coordinate = actuator.partition(".")
    _, k, _ = coordinate_of(scene, joint, coordinate or None, "[drive]")
    return label(scene, joint, k)


def _enough(engine: Engine, scene: Scene, wanted: Mapping[str, PathDrive], names: list[str]) -> list[str]:
    """As many of the actuators as there are freedoms; all of them, unless the scene allows for more."""
    model = engine.model
    free, nv = free_motions(engine), model.numbering.nv
    known = [k for k, name in enumerate(model.mechanism.drives) if name.partition(".")[0] in wanted]
    held = [k for k in range(model.numbering.known) if k not in known]
    if held:  # other drives go on as they do
        free = free @ _null(free[[nv + k for k in held]])
    of_path = free[[nv + k for k in known]]
    of_actuators = np.array([rate(engine, scene, name) @ free for name in names])
    place = f"[drive.{next(iter(wanted))}.actuators]"
    rank, both = _rank(of_actuators), _rank(np.vstack([of_actuators, of_path]))
    if both > rank:
        raise InputError(
            place,
            f"{', '.join(names)} cannot produce this motion: with them held, {both - rank} of its freedoms remain",
            "name further actuators",
        )
    if rank == len(names):
        return names
    if any(path.allocation == "unique" for path in wanted.values()):
        raise InputError(
            place,
            f"{len(names)} actuators act on {rank} freedoms: their forces are not unique",
            f'name {rank} of them, or ask for allocation = "least-norm"',
        )
    pivots = qr(of_actuators.T, mode="r", pivoting=True)[1]
    return [name for k, name in enumerate(names) if k in pivots[:rank]]


def _rank(matrix: np.ndarray) -> int:
    return int(np.sum(np.linalg.svd(matrix, compute_uv=False) > RANK))


def _null(matrix: np.ndarray) -> np.ndarray:
    """Orthonormal columns that a matrix takes to zero; where it is nothing but rounding these are all."""
    return np.asarray(np.linalg.svd(matrix)[2][_rank(matrix) :].T)


def free_motions(engine: Engine) -> np.ndarray:
    """Speeds that open no closure, free ones first, then prescribed, as orthonormal columns; shape (speeds, motions).

    In radians and shares of the mechanism's size.
    """
    model = engine.model
    J = closure_jacobian(engine) * np.concatenate([model.speed_scales, model.drive_scales])
    return _null(J / model.row_scales[:, None])


def closure_jacobian(engine: Engine) -> np.ndarray:
    """Rates of all closure rows per speed, free ones first, then prescribed; shape (rows, speeds)."""
    model = engine.model
    arrays, nv = model.arrays, model.numbering.nv
    n_rows = arrays.size(m.N_CLOSURE_ROWS)
    rows, columns = engine.view(m.ROWS.place, 6 * n_rows).reshape(-1, 6), _columns(engine)
    J = np.zeros((n_rows, nv + model.numbering.known))
    closures, entries, support = (arrays.table(table) for table in (m.CLOSURES, m.ENTRIES, m.SUPPORT))
    for c in closures:
        mine = slice(c["row0"], c["row0"] + c["n_rows"])
        for slot, col, sign in entries[c["entry0"] : c["entry0"] + c["n_entries"]]:
            J[mine, support["coordinate"][c["support0"] + slot]] += sign * rows[mine] @ columns[col]
    for c, d, col, sign in arrays.table(m.KNOWN_ENTRIES):
        mine = slice(closures["row0"][c], closures["row0"][c] + closures["n_rows"][c])
        J[mine, nv + d] += sign * rows[mine] @ columns[col]
    return J


def _columns(engine: Engine) -> np.ndarray:
    return engine.view(m.COLUMNS.place, 6 * engine.model.numbering.columns).reshape(-1, 6)


def rate(engine: Engine, scene: Scene, actuator: str) -> np.ndarray:
    """Rate of an actuator's coordinate per speed of the system; all in radians or shares of the mechanism's size."""
    model = engine.model
    scales = np.concatenate([model.speed_scales, model.drive_scales])
    joint, _, name = actuator.partition(".")
    _, k, coordinate = coordinate_of(scene, joint, name or None, "[drive]")
    row = np.zeros(model.numbering.nv + model.numbering.known)
    for i, link in enumerate(model.mechanism.links):
        edge, stage = link.branch.edge, link.stage
        if edge is not None and stage is not None and edge.name == joint and k in stage.positions:
            row[model.numbering.c0[i] + stage.positions.index(k)] = stage.sign
            return row
    number = [e.name for e, _, _ in model.mechanism.closures].index(joint)
    closure = model.arrays.table(m.CLOSURES)[list(model.closure_order).index(number)]
    a, b = int(closure["site_a"]), int(closure["site_b"])
    wrench = _unit_wrench(model, engine, a, b, coordinate)
    for site, sign in ((b, 1.0), (a, -1.0)):
        for c, col in model.numbering.route(site):
            row[c] += sign * wrench @ _columns(engine)[col]
    return row * scales / scale_of(engine, scene, actuator)


def scale_of(engine: Engine, scene: Scene, actuator: str) -> float:
    """A radian, or the mechanism's size, as an actuator's coordinate turns or slides."""
    joint, _, name = actuator.partition(".")
    _, _, coordinate = coordinate_of(scene, joint, name or None, "[drive]")
    return 1.0 if coordinate.turning else engine.model.mechanism.length


def _unit_wrench(model: Model, engine: Engine, a: int, b: int, coordinate: Coordinate) -> np.ndarray:
    """Moment about the kernels' origin and force of a unit force along a coordinate, shape (6,)."""
    sites = engine.view(m.SITE_FRAMES.place, m.FRAME.size * model.arrays.size(m.N_SITES)).reshape(-1, m.FRAME.size)
    axes = sites[b if coordinate.side else a, m.FRAME.axes : m.FRAME.axes + 9].reshape(3, 3)
    along = axes[:, coordinate.axis]
    if coordinate.turning:
        return np.concatenate([along, np.zeros(3)])
    return np.concatenate([np.cross(sites[b, m.FRAME.origin : m.FRAME.origin + 3], along), along])
