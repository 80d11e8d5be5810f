"""The bodies of a scene as Exudyn's objects: Euler parameters, and floating frames with the modes of the bundles.

All matrices and invariants of flexible bodies are integrals that the bundles hold.
"""

from __future__ import annotations

import contextlib
import io
import sys
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import xarray as xr

from pipeline.core.scene.schema import Scene
from pipeline.dynamics.model.merge import Frame, Group, Placement, rigid_inertia

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


def add_bodies(model: Model, scene: Scene) -> None:
    """The ground, and every group of bodies that are fixed to each other."""
    model.bodies.append(model.system.AddObject(model.parts.ObjectGround()))
    model.centres.append(np.zeros(3))
    ground = model.system.AddNode(model.parts.NodePointGround())
    at_rest = model.parts.MarkerNodeCoordinate(nodeNumber=ground, coordinate=0)
    model.ground_coordinate = model.system.AddMarker(at_rest)
    for i, group in enumerate(model.groups[1:], start=1):
        (_flexible_body if group.flexible else _rigid_body)(model, scene, i)


def _node(model: Model, place: Placement) -> Any:
    from exudyn.utilities import RotationMatrix2EulerParameters

    turned = list(RotationMatrix2EulerParameters(place.R))
    return model.system.AddNode(model.parts.NodeRigidBodyEP(referenceCoordinates=[*place.p, *turned]))


def add_rigid(model: Model, place: Placement, mass: float, J: np.ndarray) -> Any:
    """A rigid body with its node at its centre of mass; J there, in its axes."""
    inertia = [J[0, 0], J[1, 1], J[2, 2], J[1, 2], J[0, 2], J[0, 1]]
    body = model.parts.ObjectRigidBody(mass=mass, inertia=inertia, nodeNumber=_node(model, place))
    return model.system.AddObject(body)


def _rigid_body(model: Model, scene: Scene, i: int) -> None:
    mass, com, J = rigid_inertia(scene, model.groups[i], Placement())
    model.bodies.append(add_rigid(model, model.starts[i].of(Placement(com)), mass, J))
    model.centres.append(com)


def _flexible_body(model: Model, scene: Scene, i: int) -> None:
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
        here = transformation(place.p - model.centres[i], place.R @ turn)
        return model.system.AddMarker(model.parts.MarkerBodyRigid(bodyNumber=model.bodies[i], localHT=here))
    k = list(model.bundles[f.body]["frame"].values).index(frame.partition(".")[2])
    return model.system.AddMarker(
        model.parts.MarkerSuperElementRigid(
            bodyNumber=model.bodies[i],
            meshNodeNumbers=list(range(6 * k, 6 * k + 6)),
            weightingFactors=[1.0 / 6.0] * 6,
            localHT=transformation(np.zeros(3), f.place.R @ turn),
        )
    )


def transformation(p: np.ndarray, R: np.ndarray) -> np.ndarray:
    """Homogeneous matrix of a place, shape (4, 4)."""
    result = np.eye(4)
    result[:3, :3], result[:3, 3] = R, p
    return result
