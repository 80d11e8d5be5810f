"""The paper's scenes with bundles and compiled engines, and the states at which they are evaluated."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np
import xarray as xr

from benchmarks.timing import once
from flexclear.dynamics import memory as m
from flexclear.dynamics.integrate import recording
from flexclear.dynamics.run.evaluation import closure_rows
from flexclear.dynamics.run.evaluation.engine import Engine
from flexclear.dynamics.run.evaluation.start import consistent_start
from flexclear.dynamics.run.run import engine_of, observe_run
from flexclear.dynamics.run.trajectory import Trajectory, integrate
from flexclear.scene.load import edited, load_scene
from flexclear.scene.loose_joints import ClearanceSpherical
from flexclear.scene.parts import IdealJoint
from flexclear.scene.schema import Scene
from flexclear.stages.scenes import bundles, find_scene
from flexclear.system.progress import silent

#: the scenes of the paper, from the fewest to the most effects
SCENES = ("ideal", "far_free", "far_fixed", "far_cb", "csj", "far_csj_free", "far_csj_fixed", "far_csj_cb")


@dataclass(frozen=True)
class Mechanism:
    """A scene and the bundles of its flexible bodies."""

    name: str
    scene: Scene
    bundles: Mapping[str, xr.Dataset]

    def engine(self) -> Engine:
        """Return the compiled engine of the scene, whose steps use straight code as those of long runs do."""
        engine = engine_of(self.scene, self.bundles, silent)
        engine.specialised.worthwhile = True
        return engine

    def general_engine(self) -> Engine:
        """Return the engine whose steps run a list of calls, as those of scenes too long for straight code do."""
        engine = self.engine()
        engine.specialised.addresses[engine.selected.tobytes()] = 0
        return engine

    def with_scene(self, name: str, scene: Scene) -> Mechanism:
        """Return a mechanism with an edited scene and the bundles of this one."""
        return Mechanism(name, scene, {body: self.bundles[body] for body in scene.flexible()})


@dataclass(frozen=True)
class State:
    """A state of a run: time [s], mode and impact rate [m/s] of each contact, state vector."""

    t: float
    modes: np.ndarray
    latched: np.ndarray
    y: np.ndarray


def mechanism(name: str) -> Mechanism:
    """Return a model of the paper's mechanism, such as `far_cb` and its bundles; raise FlexclearError without them."""
    scene = load_scene(find_scene(f"sps4/{name}"))
    return Mechanism(name, scene, bundles(scene))


def without_friction(scene: Scene) -> Scene:
    """Return a copy whose clearance joints have no friction."""
    smooth = {name: joint.model_copy(update={"friction": None}) for name, joint in _loose(scene).items()}
    return scene.model_copy(update={"joint": scene.joint | smooth})


def without_clearance(scene: Scene) -> Scene:
    """Return a copy with ideal spherical joints in place of the clearance joints."""
    ideal = {name: IdealJoint(type="spherical", between=joint.between) for name, joint in _loose(scene).items()}
    return scene.model_copy(update={"joint": scene.joint | ideal})


def _loose(scene: Scene) -> dict[str, ClearanceSpherical]:
    return {name: joint for name, joint in scene.joint.items() if isinstance(joint, ClearanceSpherical)}


def damped(scene: Scene, ratio: float) -> Scene:
    """Return a copy whose flexible bodies all have one modal damping ratio."""
    return edited(scene, {f"body.{name}.damping": ratio for name in scene.flexible()})


def trajectory(engine: Engine) -> Trajectory:
    """Integrate an engine over the whole run from its consistent start."""
    return integrate(engine, consistent_start(engine), silent)


def states(engine: Engine, run: Trajectory) -> dict[str, State]:
    """Return a state without contact ("free") and, where all contacts carry force at some time, one "in contact"."""
    record = recording.record(run.rows, run.contacts)
    found = {"free": np.flatnonzero(~np.any(record.modes == 1.0, axis=1))}
    if run.contacts:
        forces = observe_run(engine, run).touch["normal_force"]
        found["in contact"] = np.flatnonzero(np.all(forces > 0.0, axis=1))
    # the middle of the candidates: at the start many terms are zero
    return {name: _state(record, rows[len(rows) // 2]) for name, rows in found.items() if len(rows)}


def most_touching(run: Trajectory) -> dict[str, State]:
    """Return a state in which as many contacts are closed as at any time of a run ("touching"), if any ever is."""
    record = recording.record(run.rows, run.contacts)
    closed = record.modes.sum(axis=1)
    rows = np.flatnonzero(closed == closed.max())
    return {"touching": _state(record, rows[len(rows) // 2])} if closed.max(initial=0.0) else {}


def _state(record: recording.Record, k: int) -> State:
    return State(float(record.time[k]), record.modes[k], record.latched[k], record.state[k])


def set_state(engine: Engine, state: State) -> None:
    """Set contact modes, impact rates and the active pieces of the drives to those of a state."""
    engine.modes[:], engine.latched[:] = state.modes, state.latched
    engine.select_pieces_after(state.t)


def evaluation_time(engine: Engine, state: State, repeat: int) -> float:
    """Return the processor time of one evaluation [s] as steps make it, averaged over `repeat` in compiled code."""
    set_state(engine, state)
    with _as_steps(engine):
        return once(lambda: closure_rows.evaluate(engine, state.y, state.t, repeat)) / repeat


@contextmanager
def _as_steps(engine: Engine) -> Iterator[None]:
    """Make evaluations that Python requests identical to those of the steps."""
    engine.settle(silent)
    before, engine.h[m.EVALUATE] = int(engine.h[m.EVALUATE]), engine.h[m.RATES]
    try:
        yield
    finally:
        engine.h[m.EVALUATE] = before
