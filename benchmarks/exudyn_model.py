"""A scene as an Exudyn model, and its runs: the same masses, frames, joints, drive laws, contact and modal invariants.

Redundant coordinates, as Exudyn has them, in its leanest objects. docs/benchmarks.md says what is the same in the two
codes and what differs, and which settings were tried: these are the best of them.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib import import_module
from typing import Any

import numpy as np
import xarray as xr
from numpy.polynomial.polynomial import polyder

from benchmarks.errors import SAMPLING, Samples
from benchmarks.exudyn_bodies import Model, add_bodies, add_rigid, load, marker, transformation
from benchmarks.mechanisms import Mechanism, joint_laws
from benchmarks.timing import once
from pipeline.core.scene.clearance import ClearanceSpherical
from pipeline.core.scene.schema import Scene
from pipeline.dynamics.contact.surfaces import BallInSocket
from pipeline.dynamics.drives.pieces import Pieces
from pipeline.dynamics.model.merge import Frame, frames_of, merge, start_places

#: axes with x along the old z: Exudyn's prismatic joint slides along x
X_FROM_Z = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
#: mass of the slide between a cylinder and a flexible rod, which a drive's marker needs, as a share of the rod's
SLIDE_SHARE = 1e-8
#: Newmark's method (beta 1/4, gamma 1/2) or not, and the spectral radius of generalized-alpha, by name
METHODS = {"trapezoidal, index 2": (True, 1.0), "generalized-alpha, index 3": (False, 0.9)}


@dataclass(frozen=True)
class Outcome:
    """One run: processor time of the solver alone [s], and what was sampled; or why it failed."""

    seconds: float
    samples: Samples | None
    failure: str = ""


def build(scene: Scene, bundles: Mapping[str, xr.Dataset]) -> Model:
    """The model of a scene, not yet assembled, so that sensors can be added."""
    container, parts = load().SystemContainer(), import_module("exudyn.itemInterface")
    _check(scene)
    frames = frames_of(scene, bundles)
    scene = _held_legs_merged(scene, frames)
    groups, group_of = merge(scene, frames)
    starts = start_places(scene, groups, group_of, frames)
    model = Model(container.AddSystem(), parts, frames, groups, group_of, starts, bundles)
    model.system.variables["container"] = container  # kept alive with its system
    add_bodies(model, scene)
    _joints(model, scene)
    return model


def _check(scene: Scene) -> None:
    moving = [n for n, b in scene.body.items() if getattr(b, "velocity", None) or getattr(b, "angular_velocity", None)]
    if scene.load or moving or scene.time.start != 0.0:
        raise ValueError("the Exudyn model has no loads, and starts at rest at t = 0")


def _held_legs_merged(scene: Scene, frames: Mapping[str, Frame]) -> Scene:
    """Joints between rigid bodies whose drive keeps them at zero become fixed ones."""
    flexible = scene.flexible()
    held = {
        name: scene.joint[name].model_copy(update={"type": "fixed"})
        for name, law in joint_laws(scene).items()
        if holds_at_zero(law) and not any(frames[f].body in flexible for f in scene.joint[name].between)
    }
    drives = {name: drive for name, drive in scene.drive.items() if drive.joint not in held}  # type: ignore[union-attr]
    return scene.model_copy(update={"joint": scene.joint | held, "drive": drives})


def _joints(model: Model, scene: Scene) -> None:
    laws = joint_laws(scene)
    add, parts = model.system.AddObject, model.parts
    for name, joint in scene.joint.items():
        a, b = joint.between
        if joint.type == "fixed":
            if model.group_of[model.frames[a].body] != model.group_of[model.frames[b].body]:
                add(parts.GenericJoint(markerNumbers=[marker(model, a), marker(model, b)], constrainedAxes=[1] * 6))
        elif joint.type == "spherical":
            add(parts.SphericalJoint(markerNumbers=[marker(model, a), marker(model, b)]))
        elif isinstance(joint, ClearanceSpherical):
            _contact(model, joint, marker(model, a), marker(model, b))
        elif name in laws:
            _driven(model, a, b, laws[name])
        else:
            ends = [marker(model, f, X_FROM_Z) for f in (a, b)]
            add(parts.ObjectJointPrismaticX(markerNumbers=ends))


def _driven(model: Model, a: str, b: str, law: Pieces) -> None:
    """Prismatic joint with a prescribed coordinate; on a flexible rod by way of a slide of next to no mass."""
    add, parts = model.system.AddObject, model.parts
    f, g = model.frames[a], model.frames[b]
    i, j = model.group_of[f.body], model.group_of[g.body]
    inner, outer = model.groups[i].places[f.body].of(f.place), model.groups[j].places[g.body].of(g.place)
    body, point, end = model.bodies[j], outer.p - model.centres[j], None
    if model.groups[j].flexible:
        mass = SLIDE_SHARE * float(model.bundles[g.body]["mass"])
        body = add_rigid(model, model.starts[i].of(inner), mass, mass * 1e-4 * np.eye(3))
        point, turned = np.zeros(3), transformation(np.zeros(3), X_FROM_Z)
        end = model.system.AddMarker(parts.MarkerBodyRigid(bodyNumber=body, localHT=turned))
        rod = marker(model, b, X_FROM_Z)
        add(parts.GenericJoint(markerNumbers=[end, rod], constrainedAxes=[1] * 6))
    ends = [marker(model, a, X_FROM_Z), end if end is not None else marker(model, b, X_FROM_Z)]
    add(parts.ObjectJointPrismaticX(markerNumbers=ends))
    coordinate = model.system.AddMarker(
        parts.MarkerBodiesRelativeTranslationCoordinate(
            bodyNumbers=[model.bodies[i], body],
            localPosition0=inner.p - model.centres[i],
            localPosition1=point,
            axis0=inner.R[:, 2],
        )
    )
    position, rate = derivative(law, 0), derivative(law, 1)
    add(
        parts.CoordinateConstraint(
            markerNumbers=[model.ground_coordinate, coordinate],
            offsetUserFunction=lambda mbs, t, item, offset: position(t),
            offsetUserFunction_t=lambda mbs, t, item, offset: rate(t),
        )
    )


def _contact(model: Model, joint: ClearanceSpherical, socket: Any, ball: Any) -> None:
    """Exudyn's contact of a ball in a hollow sphere, between markers; ValueError for laws that it does not have."""
    restitution = joint.normal.restitution
    if joint.normal.law != "lankarani-nikravesh" or restitution is None:
        raise ValueError(f"no Exudyn object has the normal law '{joint.normal.law}'")
    dynamic, linear_up_to = _friction(joint)
    exponent, parts = joint.normal.exponent or 1.5, model.parts
    data = model.system.AddNode(
        parts.NodeGenericData(initialCoordinates=[joint.clearance, 0.0, 0.0, 0.0], numberOfDataCoordinates=4)
    )
    model.system.AddObject(
        parts.ObjectContactSphereSphere(
            markerNumbers=[ball, socket],
            nodeNumber=data,
            spheresRadii=[joint.ball_radius, joint.ball_radius + joint.clearance],
            isHollowSphere1=True,
            impactModel=1,
            contactStiffness=BallInSocket.stiffness(joint, exponent),
            contactStiffnessExponent=exponent,
            restitutionCoefficient=1.0 - 0.5 * (1.0 - restitution**2),
            minimumImpactVelocity=joint.floor,
            dynamicFriction=dynamic,
            frictionProportionalZone=linear_up_to,
        )
    )


def _friction(joint: ClearanceSpherical) -> tuple[float, float]:
    """Coefficient, and the speed [m/s] up to which Exudyn's law rises to it."""
    law = joint.friction
    if law is None:
        return 0.0, 1e-3
    if law.law == "ambrosio" and law.v0 == 0.0:
        return law.dynamic, law.v1
    if law.law != "modified-coulomb":
        raise ValueError(f"no Exudyn object has the friction law '{law.law}'")
    # the slope of mu at rest is 3/2 mu_s / v_s here and mu_d / v there
    return law.dynamic, law.dynamic * law.v_static / (1.5 * law.static)


def holds_at_zero(law: Pieces) -> bool:
    """Whether the coordinate stays at zero for ever."""
    return all(not piece.terms and not any(piece.coefficients) for piece in law.pieces)


def derivative(law: Pieces, order: int) -> Callable[[float], float]:
    """A derivative of a law of polynomials; at a break the later side.

    Plain floats, no arrays: a peer calls it at every iteration.  ValueError for laws with harmonics.
    """
    if law.harmonic:
        raise ValueError("laws with harmonics have no polynomials")
    starts = [piece.start for piece in law.pieces]
    falling = [polyder(piece.coefficients, order)[::-1].tolist() for piece in law.pieces]

    def value(t: float) -> float:
        k = max(bisect_right(starts, t) - 1, 0)
        s, result = t - starts[k], 0.0
        for c in falling[k]:
            result = result * s + c
        return result

    return value


def solve(here: Mechanism, body: str, method: str, step: float) -> Outcome:
    """Run a scene in Exudyn at a fixed step; building and assembling the model is not timed."""
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
