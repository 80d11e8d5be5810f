"""Exudyn's settings are those that gave the best time for an error on these mechanisms, of those that were tried.

Implicit integration at fixed steps, by the trapezoidal rule with index-2 constraints or by generalized-alpha with
index 3 (spectral radius 0.9); the sparse solver (the dense one is a little slower); Jacobians renewed only when Newton
slows down (at a contraction of 0.005; by default 0.5), Newton tolerances that do not show in the error; the version
without range checks, no output but the samples. Steps cut down to the contact's begin, which Exudyn can do, cost more
than they gain here: it does not lengthen them again soon enough. Explicit and adaptive methods are not to be had:
Exudyn has them for systems without constraints.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from benchmarks.engines import Mechanism
from benchmarks.exudyn_model import build, load
from benchmarks.measure import once

#: both codes are compared at multiples of this [s]; every step below divides it
SAMPLING = 1e-3
#: Newmark's method (beta 1/4, gamma 1/2) or not, and the spectral radius of generalized-alpha, by name
METHODS = {"trapezoidal, index 2": (True, 1.0), "generalized-alpha, index 3": (False, 0.9)}


@dataclass(frozen=True)
class Samples:
    """Motion of a body's centre of mass: time [s], shape (n,); position [m] and velocity [m/s], shape (n, 3)."""

    time: np.ndarray
    position: np.ndarray
    velocity: np.ndarray


@dataclass(frozen=True)
class Outcome:
    """One run: processor time of the solver alone [s], and what was sampled; or why it failed."""

    seconds: float
    samples: Samples | None
    failure: str = ""


def solve(here: Mechanism, body: str, method: str, step: float) -> Outcome:
    """Run the scene at a fixed step; building and assembling the model is not timed."""
    exudyn = load()
    model = build(here.scene, here.bundles)
    i = model.group_of[body]
    centre = np.array(here.scene.body[body].com)  # type: ignore[union-attr]
    place = model.groups[i].places[body]
    sensors = [
        model.system.AddSensor(
            model.parts.SensorBody(
                bodyNumber=model.bodies[i],
                localPosition=place.p + place.R @ centre - model.centres[i],
                outputVariableType=kind,
                storeInternal=True,
            )
        )
        for kind in (exudyn.OutputVariableType.Position, exudyn.OutputVariableType.Velocity)
    ]
    model.system.Assemble()
    settings = _settings(exudyn, here.scene.time.end, method, step)
    try:
        seconds = once(lambda: model.system.SolveDynamic(settings))
    except exudyn.SolverError as error:
        return Outcome(0.0, None, str(error))
    position, velocity = (np.array(model.system.GetSensorStoredData(s)) for s in sensors)
    return Outcome(seconds, Samples(position[:, 0], position[:, 1:4], velocity[:, 1:4]))


def _settings(exudyn: Any, span: float, method: str, step: float) -> Any:
    """As the module's text says."""
    newmark, radius = METHODS[method]
    settings = exudyn.SimulationSettings()
    integration = settings.timeIntegration
    integration.numberOfSteps, integration.endTime = round(span / step), span
    integration.minimumStepSize = 1e-12
    integration.verboseMode = 0
    integration.generalizedAlpha.useNewmark = integration.generalizedAlpha.useIndex2Constraints = newmark
    integration.generalizedAlpha.spectralRadius = radius
    integration.newton.useModifiedNewton = True
    integration.newton.modifiedNewtonContractivity = 0.005
    integration.newton.relativeTolerance, integration.newton.absoluteTolerance = 1e-5, 1e-7
    integration.discontinuous.useRecommendedStepSize = False
    settings.linearSolver.solverType = exudyn.LinearSolverType.EigenSparse
    settings.parallel.numberOfThreads = 1
    settings.solution.file.write = False
    settings.solution.sensors.writePeriod = SAMPLING
    return settings
