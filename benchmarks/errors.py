"""Errors of whole runs against one converged reference, and our own ladder of tolerances."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import xarray as xr

from benchmarks.mechanisms import Mechanism
from benchmarks.timing import once
from flexclear.pipeline import dynamics
from flexclear.pipeline.core.scene.integrators import DEFAULT, VIBRATING
from flexclear.pipeline.core.scene.load import edited
from flexclear.pipeline.core.system.errors import SolverError
from flexclear.pipeline.core.system.progress import silent
from flexclear.pipeline.dynamics.run.evaluation.engine import Engine
from flexclear.pipeline.dynamics.run.evaluation.observation import frames
from flexclear.pipeline.dynamics.run.evaluation.start import consistent_start
from flexclear.pipeline.dynamics.run.run import observed
from flexclear.pipeline.dynamics.run.trajectory import integrate

#: two codes are compared at multiples of this [s], unless more rarely
SAMPLING = 1e-3
#: the integrators that are tried, those first whose runs tell soonest that others are far dearer
OURS = ("exponential", "dop853", "dopri5", "radau")
TOLERANCES = (1e-2, 5e-3, 2e-3, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-11, 1e-12)
#: of the reference
FINEST = 1e-13
#: a method's ladder ends with a run so many times longer than one that is no worse: tighter ones are dearer still
DEAR = 5.0


@dataclass(frozen=True)
class Samples:
    """Motion of a body's centre of mass: time [s], shape (n,); position [m] and velocity [m/s], shape (n, 3)."""

    time: np.ndarray
    position: np.ndarray
    velocity: np.ndarray


@dataclass(frozen=True)
class Error:
    """Largest deviations over the samples: of position [m] and velocity [m/s]; speed: the largest speed [m/s]."""

    position: float
    velocity: float
    speed: float

    @property
    def relative(self) -> float:
        """Error of the velocity as a share of the largest speed."""
        return self.velocity / self.speed

    def within(self, other: Error) -> bool:
        """Whether neither deviation is larger."""
        return self.position <= other.position and self.velocity <= other.velocity


@dataclass(frozen=True)
class Rung:
    """One of our runs: by what, its time once [s], how wrong it is, and how to time it once more [s].

    bare: how to time its integration alone [s], whose samples are states.  alike: how to time its integration with the
    body's position and velocity in the samples, as two sensors of another code have them [s]; alike_error: how wrong
    these are.
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
    """A motion to compare with, up to a horizon [s]: its samples every so many seconds.

    at: the same motion at any other times [s], ascending from the start of the run; for codes that cut their steps, and
    whose samples come late then.
    """

    samples: Samples
    horizon: float
    sampling: float = SAMPLING
    at: Callable[[np.ndarray], Samples] | None = None

    def error(self, samples: Samples) -> Error:
        """Deviation of a motion; ValueError when it was sampled at times at which this one is not known."""
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
    """Our run at the tightest tolerance."""
    finest = _at(here, DEFAULT, FINEST, sampling)
    engine = finest.engine()
    start = consistent_start(engine)

    def at(times: np.ndarray) -> Samples:
        within = np.minimum(times, here.scene.time.end)
        rows = integrate(engine, start, silent, outputs=within).rows
        k = np.searchsorted(rows[:, 0], within - 1e-6 * sampling)  # rows of events lie in between
        return _sensed(engine, rows[k], body)

    return Reference(_regular(_run(finest), body, sampling), horizon, sampling, at)


def ladder(here: Mechanism, body: str, reference: Reference, enough: Callable[[Error], bool]) -> list[Rung]:
    """Our runs by all methods at all tolerances, as far as they are not refused and not far dearer than others.

    enough: whether a run is so right that the method need not be tried at tighter tolerances.
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
        return _sensed(engine, rows[_sampled(rows[:, 0], reference.sampling)], body)

    def whole() -> float:
        return once(lambda: observed(engine, integrate(engine, start, silent)))

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


def _sensed(engine: Engine, rows: np.ndarray, body: str) -> Samples:
    """Position and velocity of a rigid body's centre of mass in rows of the record, as the integration left them."""
    model = engine.model
    link = model.mechanism.link_of[body]
    frame, place = frames(engine, rows)[:, link], model.links[link].places[body]
    arm = frame["axes"] @ (place.p + place.R @ np.array(model.scene.body[body].com))  # type: ignore[union-attr]
    position = frame["origin"] + arm + model.mechanism.origin
    return Samples(rows[:, 0], position, frame["velocity"] + np.cross(frame["omega"], arm))


def _at(here: Mechanism, integrator: str, rtol: float, sampling: float) -> Mechanism:
    change = {"solver.integrator": integrator, "solver.rtol": rtol, "output.interval": sampling}
    return here.with_scene(here.name, edited(here.scene, change))


def _run(here: Mechanism) -> xr.Dataset:
    return dynamics.simulate(here.scene, here.bundles, silent)


def _regular(run: xr.Dataset, body: str, sampling: float) -> Samples:
    """The rows at multiples of the sampling time; those of events lie in between."""
    time, motion = run["time"].values, run.sel(body=body)
    here = _sampled(time, sampling)
    return Samples(time[here], motion["position"].values[here], motion["velocity"].values[here])


def _sampled(time: np.ndarray, sampling: float) -> np.ndarray:
    """Which times are multiples of the sampling time."""
    return np.asarray(np.abs(time / sampling - np.round(time / sampling)) < 1e-6)


def cheapest(rungs: list[Rung], good: Callable[[Error], bool]) -> Rung | None:
    """Our fastest run whose error is good."""
    return min((rung for rung in rungs if good(rung.error)), key=lambda rung: rung.seconds, default=None)
