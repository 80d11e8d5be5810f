r"""More actuators than freedoms: the forces of least norm that make one motion.

Some of the actuators, as many as there are freedoms, make it alone with the forces :math:`\tau_S`.
With the rates of all :math:`\dot q = T \dot q_S`, any :math:`\tau` with :math:`T^T\tau = \tau_S` does too,
and :math:`T (T^T T)^{-1} \tau_S` is the least of them.  The other actuators then act as loads, linear
between two outputs, so that joint forces and works are those of this sharing.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import xarray as xr

from pipeline.core.scene.laws import Constant
from pipeline.core.scene.loads import JointForce
from pipeline.core.scene.schema import Scene
from pipeline.dynamics.drives.pieces import Piece, Pieces
from pipeline.dynamics.model.mechanism import build
from pipeline.dynamics.model.model import tabulate
from pipeline.dynamics.run.engine import Engine, Progress, consistent_start, observe, prepare
from pipeline.dynamics.run.inverse import RANK, free_motions, rate, renamed, scale_of
from pipeline.dynamics.run.trajectory import integrate as step


def share(
    scene: Scene, laws: dict[str, Pieces], names: list[str], bundles: Mapping[str, xr.Dataset], progress: Progress
) -> tuple[Scene, dict[str, Pieces]]:
    """The scene in which the actuators without a law act as loads, and the laws of all.

    laws: motion of the actuators that make the scene's motion alone.
    """
    engine = prepare(tabulate(build(scene, bundles), laws), progress)
    start, _ = consistent_start(engine)
    trajectory = step(engine, start, progress)
    time, alone = trajectory.time, [name for name in names if name in laws]
    sides = []
    for after in (False, True):
        seen = observe(engine, trajectory.rows, after=after)
        sides.append(_least(engine, scene, time, seen, alone, names))
    loads, found = {}, dict(laws)
    for k, name in enumerate(names):
        if name in laws:
            continue
        joint, _, coordinate = name.partition(".")
        loads[name] = JointForce(
            type="joint-force", joint=joint, coordinate=coordinate or None, force=Constant(type="constant")
        )
        found[f"load.{name}"] = _linear(time, sides[0][:, k], sides[1][:, k])
    return renamed(scene, {"load": {**scene.load, **loads}}), found


def _least(
    engine: Engine, scene: Scene, time: np.ndarray, seen: dict[str, np.ndarray], alone: list[str], names: list[str]
) -> np.ndarray:
    """Forces of all actuators at every time, shape (times, actuators)."""
    mechanism = engine.model.mechanism
    signs = {name: link.stage.sign for link in mechanism.links if link.stage for name in link.drives}
    made = [mechanism.drives.index(name) for name in alone]
    forces = seen["drive_force"][:, made] * [signs[name] for name in alone]
    own = [names.index(name) for name in alone]
    scales = np.array([scale_of(engine, scene, name) for name in names])
    found = []
    for t, state, force in zip(time, seen["state"], forces, strict=True):
        engine.select_pieces(min(t + 1e-9 * (time[-1] - time[0]), 0.5 * (time[-1] + time[-2])))
        engine.evaluate(state, float(t))
        free = free_motions(engine)
        rates = np.array([rate(engine, scene, name) @ free for name in names])
        T = scales[:, None] * (rates @ np.linalg.pinv(rates[own], rcond=RANK)) / scales[own]
        found.append(T @ np.linalg.solve(T.T @ T, force))
    return np.array(found)


def _linear(time: np.ndarray, before: np.ndarray, after: np.ndarray) -> Pieces:
    """Straight lines from the value right of each time to the value left of the next."""
    slopes = (before[1:] - after[:-1]) / np.diff(time)
    return Pieces(tuple(Piece(float(t), (float(x), float(s))) for t, x, s in zip(time, after, slopes, strict=False)))
