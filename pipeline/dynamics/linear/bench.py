"""A mechanism on the bench: its drives held, its free coordinates wherever they are put."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
import xarray as xr

from pipeline.core.errors import InputError, SolverError
from pipeline.core.registry import suggestion
from pipeline.core.scene.schema import Scene
from pipeline.dynamics import memory as m
from pipeline.dynamics.drives.pieces import Pieces
from pipeline.dynamics.model import initial, selection
from pipeline.dynamics.model.mechanism import build
from pipeline.dynamics.model.model import tabulate
from pipeline.dynamics.run import singular
from pipeline.dynamics.run.engine import Engine, Progress, observe, prepare

#: impact rate that a contact is given: at rest the hysteresis of an impact long past has no say
NO_IMPACT = 1e300
#: drives reach the wanted pose in strides of this share of the mechanism's size, or this angle
STRIDE = 0.05
#: shortest stride, as a share of the whole way, before the pose counts as out of reach
SHORTEST = 1e-4


@dataclass(frozen=True)
class Bench:
    """An engine with its drives held. drives: position and speed of each, in the tree's sense; shape (known, 2).

    turns: angles that loads follow beyond half a turn [rad]; the one part that changes, with the pose.
    """

    scene: Scene
    engine: Engine
    time: float
    drives: np.ndarray
    turns: np.ndarray

    @property
    def contacts(self) -> int:
        """Number of clearance joints."""
        return self.engine.model.arrays.size(m.N_CONTACTS)


@dataclass(frozen=True)
class Balance:
    """What acts on the coordinates in a state: M dv/dt + bias = J^T multipliers.

    bias: generalised forces with their sign turned, shape (nv,).  mass: (nv, nv).
    jacobian: rows solved for, (rows, nv).
    slip: rates at which the loops open along them, shape (rows,).
    """

    bias: np.ndarray
    mass: np.ndarray
    jacobian: np.ndarray
    slip: np.ndarray


def hold(
    scene: Scene,
    bundles: Mapping[str, xr.Dataset],
    progress: Progress,
    time: float | None,
    drives: Mapping[str, float] | None,
    moving: bool,
) -> tuple[Bench, np.ndarray]:
    """The bench of a scene with its drives as they are at a time, or at given values, and its positions there.

    time: [s], the scene's start when None.  drives: positions [m or rad] by name, instead of the law's.
    moving: whether the drives keep the speed they have at that time.
    Raises InputError for unknown drives, SolverError when the loops cannot be closed there.
    """
    driven, given = scene, dict[str, Pieces]()
    if any(getattr(drive, "actuators", None) for drive in scene.drive.values()):
        from pipeline.dynamics.run.inverse import actuated

        driven, given = actuated(scene, bundles, progress)
    model = tabulate(build(driven, bundles), given)
    arrays = replace(model.arrays, h=model.arrays.h.copy(), f=model.arrays.f.copy())
    engine = prepare(replace(model, arrays=arrays), progress)
    engine.select_pieces(engine.start)
    singular.select_rows(engine, initial.start_state(model), engine.start)
    at = engine.start if time is None else time
    first, last = drive_state(engine, engine.start), drive_state(engine, at)
    if not moving:
        last[:, 1] = 0.0
    for name, value in (drives or {}).items():
        if name not in model.mechanism.drives:
            known = model.mechanism.drives
            remedy = suggestion(name, known) if known else "the scene has no drives"
            raise InputError(f"drive '{name}'", "there is no such drive", remedy)
        k = model.mechanism.drives.index(name)
        last[k, 0] = sense(engine)[k] * value
    engine.n[engine.n[m.MODE] : engine.n[m.MODE] + arrays.size(m.N_CONTACTS)] = 1
    engine.view(m.LATCHED, arrays.size(m.N_CONTACTS))[:] = NO_IMPACT
    first[:, 1] = 0.0
    bench = Bench(scene, engine, at, first, np.zeros(arrays.size(m.N_TURNS)))
    set_drives(bench, first)
    state = initial.start_state(model)
    q = carry(bench, closed(bench, state[: model.numbering.nq]), last[:, 0])
    set_drives(bench, last)
    return replace(bench, drives=last), q


def sense(engine: Engine) -> np.ndarray:
    """+1 per drive, -1 where the tree meets its joint from the second frame."""
    mechanism = engine.model.mechanism
    sign_of = {name: link.stage.sign for link in mechanism.links if link.stage for name in link.drives}
    return np.array([sign_of[name] for name in mechanism.drives])


def drive_state(engine: Engine, time: float) -> np.ndarray:
    """Position and speed of every drive at a time, in the tree's sense, shape (known, 2)."""
    engine.select_pieces(time)
    # the laws say so on their way to any evaluation; the pose does not matter
    engine.evaluate(initial.start_state(engine.model), time)
    nq, nv, known = engine.model.numbering.nq, engine.model.numbering.nv, engine.model.numbering.known
    return np.stack([engine.view(m.X, nq + known)[nq:], engine.view(m.U, nv + known)[nv:]], axis=1)


def set_drives(bench: Bench, drives: np.ndarray) -> None:
    """Replace every drive's law by the straight one through a position, with a speed, at the bench's time."""
    arrays = bench.engine.model.arrays
    for (first, count), (position, speed) in zip(arrays.table(m.LAWS), drives, strict=False):
        straight = np.zeros(1, dtype=m.row_type(m.PIECES))
        straight["start"], straight["coefficients"][:, :2] = bench.time, (position, speed)
        arrays.table(m.PIECES)[first : first + count] = straight
        arrays.table(m.PIECE_HARMONICS, bench.engine.h)["n_harmonics"][first : first + count] = 0
    bench.engine.select_pieces(bench.time)


def carry(bench: Bench, q: np.ndarray, target: np.ndarray) -> np.ndarray:
    """Positions after the drives have gone to `target` in strides, the loops closed after each."""
    origin, share, stride = bench.drives[:, 0], 0.0, 1.0
    if not bench.engine.model.mechanism.closures:
        share = 1.0
    else:
        way = float(np.max(np.abs(target - origin) / bench.engine.model.drive_scales, initial=0.0))
        stride = min(1.0, STRIDE / way) if way > 0.0 else 1.0
    while share < 1.0:
        attempt = min(1.0, share + stride)
        try:
            set_drives(bench, np.stack([origin + attempt * (target - origin), 0.0 * target], axis=1))
            q, share = closed(bench, q), attempt
        except SolverError:
            stride *= 0.5
            if stride < SHORTEST:
                raise
    return q


def state(bench: Bench, q: np.ndarray, v: np.ndarray | None = None) -> np.ndarray:
    """State vector with positions q and speeds v (at rest when None)."""
    y = np.zeros(bench.engine.model.arrays.size(m.NY))
    nq, nv = bench.engine.model.numbering.nq, bench.engine.model.numbering.nv
    y[:nq] = q
    if v is not None:
        y[nq : nq + nv] = v
    y[len(y) - len(bench.turns) :] = bench.turns
    return y


def seen(bench: Bench, states: np.ndarray) -> dict[str, np.ndarray]:
    """What the engine records of states, loops closed first; contacts act as they stand."""
    count, contacts = len(states), bench.contacts
    ahead = [np.full((count, 1), bench.time), np.ones((count, contacts)), np.full((count, contacts), NO_IMPACT)]
    return observe(bench.engine, np.hstack([*ahead, states]), after=True)


def closed(bench: Bench, q: np.ndarray) -> np.ndarray:
    """Positions with the loops closed, loads following their angles; SolverError when that fails."""
    found = seen(bench, state(bench, q)[None, :])
    if found["status"][0, 0] != m.OK:
        raise SolverError(f"at t = {bench.time:.6g} s: the loops cannot be closed in the pose of the drives")
    if len(bench.turns):
        turn = bench.engine.model.arrays.table(m.LOADS)["turns"]
        bench.turns[turn[turn >= 0]] = m.named(m.LOAD, found["load"][0])["value"][turn >= 0]
    return found["state"][0, : len(q)].copy()


def displacement_map(bench: Bench, q: np.ndarray) -> np.ndarray:
    """Change of the positions per small displacement of each coordinate, shape (nq, nv)."""
    nq, nv = bench.engine.model.numbering.nq, bench.engine.model.numbering.nv
    return np.array([bench.engine.evaluate(state(bench, q, e), bench.time)[:nq] for e in np.eye(nv)]).T.reshape(nq, nv)


def balance(bench: Bench, q: np.ndarray, v: np.ndarray | None = None) -> Balance:
    """Forces, mass and closures in a state; SolverError where the equations are singular."""
    engine = bench.engine
    engine.evaluate(state(bench, q, v), bench.time)
    arrays, nv = engine.model.arrays, engine.model.numbering.nv
    L = engine.mass_factor()
    return Balance(
        engine.view(m.BIAS, nv).copy(),
        L @ L.T,
        engine.rows(m.JACOBIAN),
        engine.view(m.RESIDUAL_RATE, arrays.size(m.N_CLOSURE_ROWS))[selection.kept_places(engine.model, engine.h)],
    )
