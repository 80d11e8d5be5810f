"""Errors of whole runs against one converged reference, and our own ladder of tolerances."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import xarray as xr
from scipy.interpolate import CubicHermiteSpline

from benchmarks.engines import Mechanism, with_tolerance
from benchmarks.exudyn_runs import SAMPLING, Samples
from benchmarks.measure import once
from pipeline import dynamics
from pipeline.core.progress import silent
from pipeline.dynamics.run.engine import consistent_start
from pipeline.dynamics.run.run import observed
from pipeline.dynamics.run.trajectory import integrate

TOLERANCES = (1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-11, 1e-12)
#: the reference; its rows are so dense that cubic interpolation between them does not show
FINEST, DENSE = 1e-13, 1e-5


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
    """One of our runs: its tolerance, what it costs, how wrong it is, and how to time it once more [s]."""

    rtol: float
    evaluations: int
    error: Error
    time: Callable[[], float]


@dataclass(frozen=True)
class Reference:
    """A motion to compare with, up to a horizon [s]: `at(time)` gives position and velocity."""

    at: Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]
    horizon: float

    def error(self, samples: Samples) -> Error:
        """Deviation of a sampled motion."""
        here = samples.time <= self.horizon * (1.0 + 1e-9)
        position, velocity = self.at(samples.time[here])
        return Error(
            float(np.max(np.linalg.norm(samples.position[here] - position, axis=1))),
            float(np.max(np.linalg.norm(samples.velocity[here] - velocity, axis=1))),
            float(np.max(np.linalg.norm(velocity, axis=1))),
        )


def converged(here: Mechanism, body: str, horizon: float) -> Reference:
    """Our run at the tightest tolerance."""
    scene = with_tolerance(here.scene, FINEST, DENSE)
    motion = dynamics.simulate(scene, here.bundles, silent).sel(body=body)
    time, x, v, a = (motion[name].values for name in ("time", "position", "velocity", "acceleration"))
    place, speed = CubicHermiteSpline(time, x, v), CubicHermiteSpline(time, v, a)
    return Reference(lambda t: (place(t), speed(t)), horizon)


def of_samples(samples: Samples, horizon: float) -> Reference:
    """Another run that was sampled at the same times."""

    def at(t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        k = np.searchsorted(samples.time, t - 0.5 * SAMPLING)
        if not np.allclose(samples.time[k], t, rtol=0.0, atol=1e-6 * SAMPLING):
            raise ValueError("the two runs were not sampled at the same times")
        return samples.position[k], samples.velocity[k]

    return Reference(at, horizon)


def ladder(here: Mechanism, body: str, reference: Reference) -> list[Rung]:
    """Our runs at all tolerances."""
    rungs = []
    for rtol in TOLERANCES:
        edited = here.with_scene(here.name, with_tolerance(here.scene, rtol, SAMPLING))
        run = dynamics.simulate(edited.scene, edited.bundles, silent)
        error = reference.error(_regular(run.sel(body=body)))
        rungs.append(Rung(rtol, int(run.attrs["evaluations"]), error, _timer(edited)))
    return rungs


def _regular(motion: xr.Dataset) -> Samples:
    """The rows at multiples of the sampling time; those of events lie in between."""
    time = motion["time"].values
    here = np.abs(time / SAMPLING - np.round(time / SAMPLING)) < 1e-6
    return Samples(time[here], motion["position"].values[here], motion["velocity"].values[here])


def _timer(here: Mechanism) -> Callable[[], float]:
    engine = here.engine()
    start, _ = consistent_start(engine)
    # with the rows evaluated, as the peer evaluates its samples
    return lambda: once(lambda: observed(engine, integrate(engine, start, silent)))
