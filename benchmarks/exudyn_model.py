"""A scene as an Exudyn model: the same masses, frames, joints, drive laws, contact and modal invariants.

Redundant coordinates, as Exudyn has them. Its leanest objects are taken: Euler parameters, prismatic and spherical
joints, drives as coordinate constraints that also have a velocity level (without it only the index-3 solver works);
legs whose drive holds them are merged into one body.

What is the same: everything of rigid and flexible bodies, joints and drives (the two codes converge to one solution),
and the normal contact force: Exudyn's Hunt-Crossley model is K d^n (1 + 3/2 (1 - e) d'/d'0), which with
e = 1 - (1 - c_r^2)/2 is Lankarani and Nikravesh's.

What differs: friction. Exudyn's built-in law is linear up to one speed and constant above; for the paper's law it is
given the dynamic coefficient and the same slope at rest. The contact point lies half a penetration off.
"""

from __future__ import annotations

import contextlib
import io
import sys
from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib import import_module
from typing import Any

import numpy as np
import xarray as xr

from benchmarks import exudyn_contact
from benchmarks.laws import derivative, holds_at_zero, joint_laws
from pipeline.core.scene.clearance import ClearanceSpherical
from pipeline.core.scene.schema import Scene
from pipeline.dynamics.drives.pieces import Piece
from pipeline.dynamics.model.merge import Frame, Group, Placement, frames_of, merge, rigid_inertia, start_places

#: axes with x along the old z: Exudyn's prismatic joint slides along x
X_FROM_Z = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
#: mass of the slide between a cylinder and a flexible rod, which a drive's marker needs, as a share of the rod's
SLIDE_SHARE = 1e-8
EPSILON = np.array([[[(i - j) * (j - k) * (k - i) / 2.0 for k in range(3)] for j in range(3)] for i in range(3)])


@dataclass
class Model:
    """An Exudyn system under construction; bodies[i] is the object of group i, centres[i] its node's place in it."""

    system: Any
    parts: Any
    frames: dict[str, Frame]
    groups: list[Group]
    group_of: dict[str, int]
    starts: list[Placement]
    bundles: Mapping[str, xr.Dataset]
    bodies: list[Any] = field(default_factory=list)
    centres: list[np.ndarray] = field(default_factory=list)
    ground_coordinate: Any = None


def load() -> Any:
    """The exudyn package, in its version without range checks; ImportError when it is not installed."""
    sys.exudynFast = True  # type: ignore[attr-defined]  # how the package is told, before it is imported
    with contextlib.redirect_stdout(io.StringIO()):  # it prints a line on import
        import exudyn
    return exudyn


def build(scene: Scene, bundles: Mapping[str, xr.Dataset]) -> Model:
    """The model of a scene, not yet assembled, so that sensors can be added."""
    exudyn = load()
    parts = import_module("exudyn.itemInterface")
    _check(scene)
    frames = frames_of(scene, bundles)
    scene = _held_legs_merged(scene, frames)
    groups, group_of = merge(scene, frames)
    container = exudyn.SystemContainer()
    starts = start_places(scene, groups, group_of, frames)
    model = Model(container.AddSystem(), parts, frames, groups, group_of, starts, bundles)
    model.system.variables["container"] = container  # kept alive with its system
    model.bodies.append(model.system.AddObject(parts.ObjectGround()))
    model.centres.append(np.zeros(3))
    ground = model.system.AddNode(parts.NodePointGround())
    model.ground_coordinate = model.system.AddMarker(parts.MarkerNodeCoordinate(nodeNumber=ground, coordinate=0))
    for i, group in enumerate(groups[1:], start=1):
        (_flexible_body if group.flexible else _rigid_body)(model, scene, i, exudyn)
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


def _node(model: Model, place: Placement) -> Any:
    from exudyn.utilities import RotationMatrix2EulerParameters

    turned = list(RotationMatrix2EulerParameters(place.R))
    return model.system.AddNode(model.parts.NodeRigidBodyEP(referenceCoordinates=[*place.p, *turned]))


def _add_rigid(model: Model, place: Placement, mass: float, J: np.ndarray) -> Any:
    inertia = [J[0, 0], J[1, 1], J[2, 2], J[1, 2], J[0, 2], J[0, 1]]
    body = model.parts.ObjectRigidBody(mass=mass, inertia=inertia, nodeNumber=_node(model, place))
    return model.system.AddObject(body)


def _rigid_body(model: Model, scene: Scene, i: int, exudyn: Any) -> None:
    mass, com, J = rigid_inertia(scene, model.groups[i], Placement())
    model.bodies.append(_add_rigid(model, model.starts[i].of(Placement(com)), mass, J))
    model.centres.append(com)


def _flexible_body(model: Model, scene: Scene, i: int, exudyn: Any) -> None:
    """Floating frame with reduced order; all its matrices are integrals that the bundle holds."""
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
        massMatrixReduced=_dense(exudyn, b["modal_mass"].values),
        stiffnessMatrixReduced=_dense(exudyn, stiffness),
        dampingMatrixReduced=_dense(exudyn, 2.0 * damping * np.sqrt(stiffness)),
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


def _dense(exudyn: Any, matrix: np.ndarray) -> Any:
    container = exudyn.MatrixContainer()
    container.SetWithDenseMatrix(np.ascontiguousarray(matrix), useDenseMatrix=True)
    return container


def _invariants(b: xr.Dataset) -> dict[str, np.ndarray]:
    """Integrals of Zwoelfer and Gerstmayr's nodal FFRF, for fields S_j and X with ~v w = v x w."""
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
    """Six points around each frame, 10 mm off, and their modes: a marker on them moves and turns as the frame does."""
    arms = 0.01 * np.concatenate([np.eye(3), -np.eye(3)])
    positions, basis = [], []
    for k in range(b.sizes["frame"]):
        shift, turn = b["frame_translation_shape"].values[k], b["frame_rotation_shape"].values[k]
        for arm in arms:
            positions.append(b["frame_position"].values[k] + arm)
            basis.append(shift - np.cross(arm, turn, axisb=0).T)
    return np.concatenate(positions), np.concatenate(basis)


def marker(model: Model, frame: str, turn: np.ndarray | None = None) -> Any:
    """A rigid marker at a frame, its axes turned by `turn` against the frame's."""
    f = model.frames[frame]
    i, turn = model.group_of[f.body], np.eye(3) if turn is None else turn
    if not model.groups[i].flexible:
        place = model.groups[i].places[f.body].of(f.place)
        here = _transformation(place.p - model.centres[i], place.R @ turn)
        return model.system.AddMarker(model.parts.MarkerBodyRigid(bodyNumber=model.bodies[i], localHT=here))
    k = list(model.bundles[f.body]["frame"].values).index(frame.partition(".")[2])
    return model.system.AddMarker(
        model.parts.MarkerSuperElementRigid(
            bodyNumber=model.bodies[i],
            meshNodeNumbers=list(range(6 * k, 6 * k + 6)),
            weightingFactors=[1.0 / 6.0] * 6,
            localHT=_transformation(np.zeros(3), f.place.R @ turn),
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
                add(parts.GenericJoint(markerNumbers=[marker(model, a), marker(model, b)], constrainedAxes=[1] * 6))
        elif joint.type == "spherical":
            add(parts.SphericalJoint(markerNumbers=[marker(model, a), marker(model, b)]))
        elif isinstance(joint, ClearanceSpherical):
            exudyn_contact.add(model.system, parts, joint, marker(model, a), marker(model, b))
        elif name in laws:
            _driven(model, a, b, laws[name])
        else:
            ends = [marker(model, f, X_FROM_Z) for f in (a, b)]
            add(parts.ObjectJointPrismaticX(markerNumbers=ends))


def _driven(model: Model, a: str, b: str, law: tuple[Piece, ...]) -> None:
    """Prismatic joint with a prescribed coordinate; on a flexible rod by way of a slide of next to no mass."""
    add, parts = model.system.AddObject, model.parts
    f, g = model.frames[a], model.frames[b]
    i, j = model.group_of[f.body], model.group_of[g.body]
    inner, outer = model.groups[i].places[f.body].of(f.place), model.groups[j].places[g.body].of(g.place)
    body, point, end = model.bodies[j], outer.p - model.centres[j], None
    if model.groups[j].flexible:
        mass = SLIDE_SHARE * float(model.bundles[g.body]["mass"])
        body = _add_rigid(model, model.starts[i].of(inner), mass, mass * 1e-4 * np.eye(3))
        point, turned = np.zeros(3), _transformation(np.zeros(3), X_FROM_Z)
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
