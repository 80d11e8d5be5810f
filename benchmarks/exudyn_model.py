"""A scene as an Exudyn model, and its runs: the same masses, frames, joints, drive laws, contact and modal invariants.

The model uses redundant coordinates, as Exudyn does, in its leanest objects. docs/benchmarks.md lists what is equal and
what differs in the two codes, and the settings that were tried: these are the best of them.
"""

from __future__ import annotations

import contextlib
import io
import sys
import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib import import_module
from typing import Any

import numpy as np
import xarray as xr
from numpy.polynomial.polynomial import polyder

from benchmarks.errors import Samples
from benchmarks.mechanisms import Mechanism
from flexclear.dynamics.contact.surfaces import clearance_spherical
from flexclear.dynamics.drives.pieces import Pieces, pieces_of
from flexclear.dynamics.model import merge as grouping
from flexclear.dynamics.model.contacts import LEAST_RATE
from flexclear.scene.drives import JointDrive
from flexclear.scene.loose_joints import ClearanceSpherical
from flexclear.scene.schema import Scene

EPSILON = np.array([[[(i - j) * (j - k) * (k - i) / 2.0 for k in range(3)] for j in range(3)] for i in range(3)])
#: axes with x along the old z: Exudyn's prismatic joint slides along x
X_FROM_Z = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
#: mass of the slide between a cylinder and a flexible rod, which a drive's marker needs, as a fraction of the rod's
SLIDE_SHARE = 1e-8
#: name -> True for Newmark's method (beta 1/4, gamma 1/2), spectral radius of generalized-alpha, relative tolerance of
#: Newton's iterations (the absolute one is a hundredth)
METHODS = {
    "trapezoidal, index 2": (True, 1.0, 1e-5),
    "generalized-alpha, index 3": (False, 0.9, 1e-5),
    "trapezoidal, loose Newton": (True, 1.0, 1e-3),
    "generalized-alpha, loose Newton": (False, 0.9, 1e-3),
}


@dataclass
class Model:
    """Exudyn system under construction.  bodies[i]: object of group i; centres[i]: its node's position in the group."""

    system: Any
    parts: Any
    frames: dict[str, grouping.Frame]
    groups: list[grouping.Group]
    group_of: dict[str, int]
    starts: list[grouping.Placement]
    bundles: Mapping[str, xr.Dataset]
    bodies: list[Any] = field(default_factory=list)
    centres: list[np.ndarray] = field(default_factory=list)
    ground_coordinate: Any = None


def load() -> Any:
    """Return the exudyn package in its version without range checks; raise ImportError when it is not installed."""
    sys.exudynFast = True  # type: ignore[attr-defined]  # the package reads it when it is imported
    with contextlib.redirect_stdout(io.StringIO()):  # it prints a line on import
        import exudyn
    return exudyn


@dataclass(frozen=True)
class Outcome:
    """One run: processor time of the solver alone [s], and its samples or the reason of its failure."""

    seconds: float
    samples: Samples | None
    failure: str = ""


def build(scene: Scene, bundles: Mapping[str, xr.Dataset]) -> Model:
    """Return the model of a scene, not yet assembled, so that sensors can be added."""
    container, parts = load().SystemContainer(), import_module("exudyn.itemInterface")
    _check(scene)
    frames = grouping.frames_of(scene, bundles)
    scene = _held_legs_merged(scene, frames)
    groups, group_of = grouping.merge(scene, frames)
    starts = grouping.start_places(scene, groups, group_of, frames, {})
    model = Model(container.AddSystem(), parts, frames, groups, group_of, starts, bundles)
    model.system.variables["container"] = container  # kept alive with its system
    _bodies(model, scene)
    _joints(model, scene)
    return model


def _check(scene: Scene) -> None:
    moving = [n for n, b in scene.body.items() if getattr(b, "velocity", None) or getattr(b, "angular_velocity", None)]
    if scene.load or moving or scene.time.start != 0.0:
        raise ValueError("the Exudyn model has no loads, and starts at rest at t = 0")


def _held_legs_merged(scene: Scene, frames: Mapping[str, grouping.Frame]) -> Scene:
    """Return the scene with fixed joints in place of those between rigid bodies whose drive holds them at zero."""
    flexible = scene.flexible()
    held = {
        name: scene.joint[name].model_copy(update={"type": "fixed"})
        for name, law in joint_laws(scene).items()
        if holds_at_zero(law) and not any(frames[f].body in flexible for f in scene.joint[name].between)
    }
    drives = {name: drive for name, drive in scene.drive.items() if drive.joint not in held}  # type: ignore[union-attr]
    return scene.model_copy(update={"joint": scene.joint | held, "drive": drives})


def _bodies(model: Model, scene: Scene) -> None:
    """Add the ground, and every group of bodies that are fixed to each other."""
    model.bodies.append(model.system.AddObject(model.parts.ObjectGround()))
    model.centres.append(np.zeros(3))
    ground = model.system.AddNode(model.parts.NodePointGround())
    at_rest = model.parts.MarkerNodeCoordinate(nodeNumber=ground, coordinate=0)
    model.ground_coordinate = model.system.AddMarker(at_rest)
    for i, group in enumerate(model.groups[1:], start=1):
        (_flexible_body if group.flexible else _rigid_body)(model, scene, i)


def _node(model: Model, place: grouping.Placement) -> Any:
    from exudyn.utilities import RotationMatrix2EulerParameters

    turned = list(RotationMatrix2EulerParameters(place.R))
    return model.system.AddNode(model.parts.NodeRigidBodyEP(referenceCoordinates=[*place.p, *turned]))


def _add_rigid(model: Model, place: grouping.Placement, mass: float, J: np.ndarray) -> Any:
    inertia = [J[0, 0], J[1, 1], J[2, 2], J[1, 2], J[0, 2], J[0, 1]]
    body = model.parts.ObjectRigidBody(mass=mass, inertia=inertia, nodeNumber=_node(model, place))
    return model.system.AddObject(body)


def _rigid_body(model: Model, scene: Scene, i: int) -> None:
    mass, com, J = grouping.rigid_inertia(scene, model.groups[i].placements)
    model.bodies.append(_add_rigid(model, model.starts[i].of(grouping.Placement(com)), mass, J))
    model.centres.append(com)


def _flexible_body(model: Model, scene: Scene, i: int) -> None:
    """Add a floating frame with reduced order; all its matrices are integrals that the bundle holds."""
    name = model.groups[i].host
    b, parts = model.bundles[name], model.parts
    n, damping = b.sizes["mode"], scene.flexible()[name].damping or 0.0
    if not isinstance(damping, float):
        raise ValueError(f"[body.{name}.damping] is not one ratio for all modes")
    zeros = [0.0] * n
    modal = model.system.AddNode(
        parts.NodeGenericODE2(
            referenceCoordinates=zeros,
            initialCoordinates=zeros,
            initialCoordinates_t=zeros,
            numberOfODE2Coordinates=n,
        )
    )
    stiffness, mass = b["modal_stiffness"].values, float(b["mass"])
    second = b["second_moment"].values
    positions, basis = _frame_points(b)
    body = parts.ObjectFFRFreducedOrder(
        nodeNumbers=[_node(model, model.starts[i]), modal],
        massMatrixReduced=_dense(b["modal_mass"].values),
        stiffnessMatrixReduced=_dense(stiffness),
        dampingMatrixReduced=_dense(2.0 * damping * np.sqrt(stiffness)),
        modeBasis=basis,
        referencePositions=positions,
        mass=mass,
        inertia=np.trace(second) * np.eye(3) - second,
        centerOfMass=b["first_moment"].values / mass,
        computeFFRFterms=True,
        **_invariants(b),
    )
    model.bodies.append(model.system.AddObject(body))
    model.centres.append(np.zeros(3))


def _dense(matrix: np.ndarray) -> Any:
    container = load().MatrixContainer()
    container.SetWithDenseMatrix(np.ascontiguousarray(matrix), useDenseMatrix=True)
    return container


def _invariants(b: xr.Dataset) -> dict[str, np.ndarray]:
    """Return the integrals of Zwoelfer and Gerstmayr's nodal FFRF, for fields S_j and X with ~v w = v x w."""
    S, XS, SS = (b[name].values for name in ("modal_first_moment", "position_mode_moment", "mode_mode_moment"))
    n, e = S.shape[1], EPSILON
    return {
        "mPsiTildePsi": np.einsum("abc,cbij->iaj", e, SS).reshape(3 * n, n),
        "mPsiTildePsiTilde": np.einsum("adc,dbf,cfij->iajb", e, -e, SS).reshape(3 * n, 3 * n),
        "mPhitTPsi": S,
        "mPhitTPsiTilde": np.einsum("abc,cj->ajb", -e, S).reshape(3, 3 * n),
        "mXRefTildePsi": np.einsum("abc,cbj->aj", e, XS),
        "mXRefTildePsiTilde": np.einsum("adc,dbf,cfj->ajb", e, -e, XS).reshape(3, 3 * n),
    }


def _frame_points(b: xr.Dataset) -> tuple[np.ndarray, np.ndarray]:
    """Return six points around each frame, 10 mm off, and their modes: a marker on them moves and turns with it."""
    arms = 0.01 * np.concatenate([np.eye(3), -np.eye(3)])
    positions, basis = [], []
    for k in range(b.sizes["frame"]):
        shift, turn = b["frame_translation_shape"].values[k], b["frame_rotation_shape"].values[k]
        for arm in arms:
            positions.append(b["frame_position"].values[k] + arm)
            basis.append(shift - np.cross(arm, turn, axisb=0).T)
    return np.concatenate(positions), np.concatenate(basis)


def _marker(model: Model, frame: str, turn: np.ndarray | None = None) -> Any:
    """Add a rigid marker at a frame, with axes turned by `turn` relative to the frame's."""
    f = model.frames[frame]
    i, turn = model.group_of[f.body], np.eye(3) if turn is None else turn
    if not model.groups[i].flexible:
        place = model.groups[i].placements[f.body].of(f.placement)
        here = _transformation(place.p - model.centres[i], place.R @ turn)
        return model.system.AddMarker(model.parts.MarkerBodyRigid(bodyNumber=model.bodies[i], localHT=here))
    k = list(model.bundles[f.body]["frame"].values).index(frame.partition(".")[2])
    return model.system.AddMarker(
        model.parts.MarkerSuperElementRigid(
            bodyNumber=model.bodies[i],
            meshNodeNumbers=list(range(6 * k, 6 * k + 6)),
            weightingFactors=[1.0 / 6.0] * 6,
            localHT=_transformation(np.zeros(3), f.placement.R @ turn),
        )
    )


def _transformation(p: np.ndarray, R: np.ndarray) -> np.ndarray:
    result = np.eye(4)
    result[:3, :3], result[:3, 3] = R, p
    return result


def _joints(model: Model, scene: Scene) -> None:
    laws = joint_laws(scene)
    add, parts = model.system.AddObject, model.parts
    for name, joint in scene.joint.items():
        a, b = joint.between
        if joint.type == "fixed":
            if model.group_of[model.frames[a].body] != model.group_of[model.frames[b].body]:
                add(parts.GenericJoint(markerNumbers=[_marker(model, a), _marker(model, b)], constrainedAxes=[1] * 6))
        elif joint.type == "spherical":
            add(parts.SphericalJoint(markerNumbers=[_marker(model, a), _marker(model, b)]))
        elif isinstance(joint, ClearanceSpherical):
            _contact(model, joint, _marker(model, a), _marker(model, b))
        elif name in laws:
            _driven(model, a, b, laws[name])
        else:
            ends = [_marker(model, f, X_FROM_Z) for f in (a, b)]
            add(parts.ObjectJointPrismaticX(markerNumbers=ends))


def joint_laws(scene: Scene) -> dict[str, Pieces]:
    """Return the law of every driven joint's coordinate; raise ValueError for drives that prescribe something else."""
    found, dimension = {}, {"prismatic": "length", "revolute": "angle"}
    for name, drive in scene.drive.items():
        if not isinstance(drive, JointDrive):
            raise ValueError(f"[drive.{name}] does not prescribe a joint's coordinate")
        found[drive.joint] = pieces_of(drive.law, dimension[scene.joint[drive.joint].type])
    return found


def _driven(model: Model, a: str, b: str, law: Pieces) -> None:
    """Add a prismatic joint with a prescribed coordinate; on a flexible rod, through a slide of negligible mass."""
    add, parts = model.system.AddObject, model.parts
    f, g = model.frames[a], model.frames[b]
    i, j = model.group_of[f.body], model.group_of[g.body]
    inner, outer = (
        model.groups[i].placements[f.body].of(f.placement),
        model.groups[j].placements[g.body].of(g.placement),
    )
    body, point, end = model.bodies[j], outer.p - model.centres[j], None
    if model.groups[j].flexible:
        mass = SLIDE_SHARE * float(model.bundles[g.body]["mass"])
        body = _add_rigid(model, model.starts[i].of(inner), mass, mass * 1e-4 * np.eye(3))
        point, turned = np.zeros(3), _transformation(np.zeros(3), X_FROM_Z)
        end = model.system.AddMarker(parts.MarkerBodyRigid(bodyNumber=body, localHT=turned))
        rod = _marker(model, b, X_FROM_Z)
        add(parts.GenericJoint(markerNumbers=[end, rod], constrainedAxes=[1] * 6))
    ends = [_marker(model, a, X_FROM_Z), end if end is not None else _marker(model, b, X_FROM_Z)]
    add(parts.ObjectJointPrismaticX(markerNumbers=ends))
    coordinate = model.system.AddMarker(
        parts.MarkerBodiesRelativeTranslationCoordinate(
            bodyNumbers=[model.bodies[i], body],
            localPosition0=inner.p - model.centres[i],
            localPosition1=point,
            axis0=inner.R[:, 2],
        )
    )
    add(
        parts.CoordinateConstraint(
            markerNumbers=[model.ground_coordinate, coordinate],
            offsetUserFunction=_symbolic(model, law, 0, "offsetUserFunction"),
            offsetUserFunction_t=_symbolic(model, law, 1, "offsetUserFunction_t"),
        )
    )


def _symbolic(model: Model, law: Pieces, order: int, name: str) -> Any:
    """Return a derivative of a law as an expression that Exudyn evaluates itself, without calling Python."""
    from exudyn.advancedUtilities import CreateSymbolicUserFunction

    choose = load().symbolic.IfThenElse
    starts, falling = polynomials(law, order)

    def value(mbs: Any, t: Any, item: Any, offset: Any) -> Any:
        found, end = None, starts[-1]
        for start, coefficients in zip(reversed(starts), reversed(falling), strict=True):
            result, s = 0.0 * t, t - start
            for c in coefficients:
                result = result * s + c
            found = result if found is None else choose(t < end, result, found)
            end = start
        return found

    made = CreateSymbolicUserFunction(model.system, value, name, itemTypeName="ObjectConnectorCoordinate")
    model.system.variables.setdefault("laws", []).append(made)  # must live as long as its system
    return made


def _contact(model: Model, joint: ClearanceSpherical, socket: Any, ball: Any) -> None:
    """Add Exudyn's contact of a ball in a hollow sphere, between markers; raise ValueError for laws that it lacks."""
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
            contactStiffness=clearance_spherical.stiffness(joint, exponent),
            contactStiffnessExponent=exponent,
            restitutionCoefficient=1.0 - 0.5 * (1.0 - restitution**2),
            minimumImpactVelocity=joint.floor or LEAST_RATE,
            dynamicFriction=dynamic,
            frictionProportionalZone=linear_up_to,
        )
    )


def _friction(joint: ClearanceSpherical) -> tuple[float, float]:
    """Return the friction coefficient, and the speed [m/s] up to which Exudyn's law rises to that value."""
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
    """Return True when the coordinate always stays at zero."""
    return all(not piece.terms and not any(piece.coefficients) for piece in law.pieces)


def polynomials(law: Pieces, order: int) -> tuple[list[float], list[list[float]]]:
    """Return the starts of the pieces [s], and coefficients of falling order of a derivative of each in the time since.

    Raise ValueError for laws with harmonics.
    """
    if law.harmonics.any():
        raise ValueError("laws with harmonics have no polynomials")
    starts = [piece.start for piece in law.pieces]
    return starts, [polyder(piece.coefficients, order)[::-1].tolist() for piece in law.pieces]


def solve(here: Mechanism, body: str, method: str, step: float, sampling: float) -> Outcome:
    """Run a scene in Exudyn at a fixed step [s], sampled at an interval [s]; building the model is not timed.

    Where Newton's iterations fail, Exudyn cuts its steps, and samples come at the first step after their time.
    """
    exudyn = load()
    model = build(here.scene, here.bundles)
    i = model.group_of[body]
    centre = np.array(here.scene.body[body].com)  # type: ignore[union-attr]
    place = model.groups[i].placements[body]
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
    settings = _settings(exudyn, here.scene.time.end, method, step, sampling)
    try:
        with contextlib.redirect_stdout(io.StringIO()):  # a failing run prints the text of its error
            # the thread's clock: the clock of a process with a time limit advances in ticks of 4 ms
            begun = time.thread_time()
            model.system.SolveDynamic(settings)
            seconds = time.thread_time() - begun
    except exudyn.SolverError as error:
        return Outcome(0.0, None, str(error))
    position, velocity = (np.array(model.system.GetSensorStoredData(s)) for s in sensors)
    return Outcome(seconds, Samples(position[:, 0], position[:, 1:4], velocity[:, 1:4]))


def _settings(exudyn: Any, span: float, method: str, step: float, sampling: float) -> Any:
    newmark, radius, tolerance = METHODS[method]
    settings = exudyn.SimulationSettings()
    integration = settings.timeIntegration
    integration.numberOfSteps, integration.endTime = round(span / step), span
    integration.minimumStepSize = 1e-12
    integration.verboseMode = 0
    integration.generalizedAlpha.useNewmark = integration.generalizedAlpha.useIndex2Constraints = newmark
    integration.generalizedAlpha.spectralRadius = radius
    integration.newton.useModifiedNewton = True
    integration.newton.modifiedNewtonContractivity = 0.005
    integration.newton.relativeTolerance, integration.newton.absoluteTolerance = tolerance, 0.01 * tolerance
    integration.discontinuous.useRecommendedStepSize = False
    settings.linearSolver.solverType = exudyn.LinearSolverType.EigenSparse
    settings.parallel.numberOfThreads = 1
    settings.solution.file.write = False
    settings.solution.sensors.writePeriod = sampling
    return settings
