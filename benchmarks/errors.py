"""Errors of whole runs against one converged reference, and runs of this program over a ladder of tolerances."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import xarray as xr

from benchmarks.mechanisms import Mechanism
from benchmarks.timing import once
from flexclear import dynamics
from flexclear.dynamics.run.evaluation.engine import Engine
from flexclear.dynamics.run.evaluation.observation import frames
from flexclear.dynamics.run.evaluation.start import consistent_start
from flexclear.dynamics.run.run import observe_run
from flexclear.dynamics.run.trajectory import integrate
from flexclear.scene.integrators import DEFAULT, VIBRATING
from flexclear.scene.load import edited
from flexclear.system.errors import SolverError
from flexclear.system.progress import silent

#: default interval of the samples at which two codes are compared [s]
SAMPLING = 1e-3
#: integrators in the order of trial: fast ones first, so that the ladders of far more expensive ones end early
OURS = ("exponential", "dop853", "dopri5", "radau")
TOLERANCES = (1e-2, 5e-3, 2e-3, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-11, 1e-12)
#: tolerance of the reference run
FINEST = 1e-13
#: a ladder ends when a run takes this many times longer than one with no larger error; tighter runs cost even more
DEAR = 5.0


@dataclass(frozen=True)
class Samples:
    """Motion of a body's centre of mass: time [s], shape (n,); position [m] and velocity [m/s], shape (n, 3)."""

    time: np.ndarray
    position: np.ndarray
    velocity: np.ndarray


@dataclass(frozen=True)
class Error:
    """Largest deviations over the samples, of position [m] and velocity [m/s].  speed: the largest speed [m/s]."""

    position: float
    velocity: float
    speed: float

    @property
    def relative(self) -> float:
        """Velocity error as a fraction of the largest speed."""
        return self.velocity / self.speed

    def within(self, other: Error) -> bool:
        """Return True when neither deviation exceeds that of another error."""
        return self.position <= other.position and self.velocity <= other.velocity


@dataclass(frozen=True)
class Rung:
    """One run of this program: integrator, tolerance, time [s], error, and functions that time the run again [s].

    time: times integration and outputs.  bare: times the integration alone, whose samples are states.  alike: times the
    integration with the body's position and velocity in the samples, as two sensors of another code record them.
    alike_error: error of those samples.
    """

    integrator: str
    rtol: float
    evaluations: int
    seconds: float
    error: Error
    time: Callable[[], float]
    bare: Callable[[], float]
    alike: Callable[[], float]
    alike_error: Error


@dataclass(frozen=True)
class Reference:
    """A reference motion up to a horizon [s], sampled at a regular interval [s].

    at: returns the motion at other ascending times [s] from the start of the run; needed for codes that cut their steps
    and therefore sample late.
    """

    samples: Samples
    horizon: float
    sampling: float = SAMPLING
    at: Callable[[np.ndarray], Samples] | None = None

    def error(self, samples: Samples) -> Error:
        """Return the deviation of a motion; raise ValueError when the reference is unknown at its sample times."""
        here = samples.time <= self.horizon * (1.0 + 1e-9)
        known = self._known(samples.time[here])
        return Error(
            float(np.max(np.linalg.norm(samples.position[here] - known.position, axis=1))),
            float(np.max(np.linalg.norm(samples.velocity[here] - known.velocity, axis=1))),
            float(np.max(np.linalg.norm(known.velocity, axis=1))),
        )

    def _known(self, t: np.ndarray) -> Samples:
        mine = self.samples
        k = np.minimum(np.searchsorted(mine.time, t - 0.5 * self.sampling), len(mine.time) - 1)
        if np.allclose(mine.time[k], t, rtol=0.0, atol=1e-6 * self.sampling):
            return Samples(mine.time[k], mine.position[k], mine.velocity[k])
        if self.at is None:
            raise ValueError("the two runs were not sampled at the same times")
        return self.at(t)


def converged(here: Mechanism, body: str, horizon: float, sampling: float = SAMPLING) -> Reference:
    """Return the reference motion: our run at the tightest tolerance."""
    finest = _at(here, DEFAULT, FINEST, sampling)
    engine = finest.engine()
    start = consistent_start(engine)

    def at(times: np.ndarray) -> Samples:
        within = np.minimum(times, here.scene.time.end)
        rows = integrate(engine, start, silent, outputs=within).rows
        k = np.searchsorted(rows[:, 0], within - 1e-6 * sampling)  # rows of events lie in between
        return sensed(engine, rows[k], body)

    return Reference(_regular(_run(finest), body, sampling), horizon, sampling, at)


def ladder(here: Mechanism, body: str, reference: Reference, enough: Callable[[Error], bool]) -> list[Rung]:
    """Return our runs by all methods at all tolerances, except refused runs and runs after a far more expensive one.

    enough: returns True when an error is so small that the method needs no tighter tolerance.
    """
    rungs: list[Rung] = []
    for integrator in OURS:
        if integrator == VIBRATING and not here.scene.flexible():
            continue
        for rtol in TOLERANCES:
            mine = _at(here, integrator, rtol, reference.sampling)
            try:
                run = _run(mine)
            except SolverError:
                continue
            rungs.append(_rung(mine, run, body, reference))
            found, seconds = rungs[-1].error, rungs[-1].seconds
            if enough(found) or any(r.error.within(found) and DEAR * r.seconds < seconds for r in rungs):
                break
    return rungs


def _rung(mine: Mechanism, run: xr.Dataset, body: str, reference: Reference) -> Rung:
    engine = mine.engine()
    start, what = consistent_start(engine), mine.scene.solver
    error = reference.error(_regular(run, body, reference.sampling))

    def alike() -> Samples:
        rows = integrate(engine, start, silent).rows
        return sensed(engine, rows[_sampled(rows[:, 0], reference.sampling)], body)

    def whole() -> float:
        return once(lambda: observe_run(engine, integrate(engine, start, silent)))

    return Rung(
        what.integrator,
        what.rtol,
        int(run.attrs["evaluations"]),
        whole(),
        error,
        whole,
        lambda: once(lambda: integrate(engine, start, silent)),
        lambda: once(alike),
        reference.error(alike()),
    )


def sensed(engine: Engine, rows: np.ndarray, body: str) -> Samples:
    """Return position and velocity of a rigid body's centre of mass from the rows that the integration recorded."""
    model = engine.model
    link = model.mechanism.link_of[body]
    frame, place = frames(engine, rows)[:, link], model.links[link].placements[body]
    arm = frame["axes"] @ (place.p + place.R @ np.array(model.scene.body[body].com))  # type: ignore[union-attr]
    position = frame["origin"] + arm + model.mechanism.origin
    return Samples(rows[:, 0], position, frame["velocity"] + np.cross(frame["omega"], arm))


def _at(here: Mechanism, integrator: str, rtol: float, sampling: float) -> Mechanism:
    change = {"solver.integrator": integrator, "solver.rtol": rtol, "output.interval": sampling}
    return here.with_scene(here.name, edited(here.scene, change))


def _run(here: Mechanism) -> xr.Dataset:
    return dynamics.simulate(here.scene, here.bundles, silent)


def _regular(run: xr.Dataset, body: str, sampling: float) -> Samples:
    """Return the samples at multiples of the sampling time; rows of events lie in between."""
    time, motion = run["time"].values, run.sel(body=body)
    here = _sampled(time, sampling)
    return Samples(time[here], motion["position"].values[here], motion["velocity"].values[here])


def _sampled(time: np.ndarray, sampling: float) -> np.ndarray:
    """Return the mask of the times that are multiples of the sampling time."""
    return np.asarray(np.abs(time / sampling - np.round(time / sampling)) < 1e-6)


def cheapest(rungs: list[Rung], good: Callable[[Error], bool]) -> Rung | None:
    """Return our fastest run whose error is acceptable, or None."""
    return min((rung for rung in rungs if good(rung.error)), key=lambda rung: rung.seconds, default=None)
