"""Start pose of a scene without compilation, also where joints, drives and poses do not fit."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from flexclear.dynamics.model import given_start
from flexclear.dynamics.model.assembly import assemble, with_starts
from flexclear.dynamics.model.constraints import Constraint, constraints
from flexclear.dynamics.model.driving import label
from flexclear.dynamics.model.mechanism import Mechanism, build
from flexclear.dynamics.model.merge import Placement
from flexclear.dynamics.model.placing import guess, targets
from flexclear.dynamics.model.plausibility import separations
from flexclear.dynamics.model.start_table import given_coordinates
from flexclear.numerics.rotations import matrix_to_quaternion
from flexclear.scene.schema import Scene
from flexclear.system.errors import InputError

if TYPE_CHECKING:
    import xarray as xr

    from flexclear.artifacts.labelled import Labelled


@dataclass(frozen=True)
class Gap:
    """Residual of a joint or its drive: from the required to the actual position of its second frame, world axes [m].

    angle: residual angle of the joint or its drive [rad].
    """

    joint: str
    start: np.ndarray
    end: np.ndarray
    angle: float

    @property
    def distance(self) -> float:
        """Distance between the two positions [m]."""
        return float(np.linalg.norm(self.end - self.start))


@dataclass(frozen=True)
class StartPose:
    """data: a run (schema RUN, in part) of one output, at rest.  gaps: of joints that do not fit.

    refused: error with which the start is refused; None where the joints fit.
    """

    data: xr.Dataset
    gaps: tuple[Gap, ...]
    refused: InputError | None


def start_pose(
    scene: Scene, placed: Scene, bundles: Mapping[str, Labelled], drawn: Mapping[str, xr.Dataset]
) -> StartPose:
    """Return the start that the joints allow or, where they do not fit, the start by poses and the tree of the joints.

    placed: the scene whose joints place the bodies, such as the ideal mechanism of the scene.  bundles: mass, inertia,
    frames of undeformed flexible bodies, by name.  drawn: the same for all bodies with a mesh.  Raises InputError where
    not even the tree of the joints can be built.
    """
    mechanism, refused = build(placed, bundles), None
    try:
        mechanism = assemble(mechanism)
    except InputError as error:
        refused, mechanism = error, _with_open_loops(mechanism)
    starts = given_coordinates(placed)
    poses = [link.start for link in mechanism.links]
    gaps = [] if refused is None else _gaps(mechanism, constraints(mechanism, starts=starts), poses)
    return StartPose(_data(scene, mechanism, drawn), (*gaps, *_gaps_of_loose_joints(mechanism)), refused)


def _with_open_loops(mechanism: Mechanism) -> Mechanism:
    """Return the mechanism with each body without a pose put where one joint has it; loops may stay open."""
    starts, placed = given_coordinates(mechanism.scene), given_start.given_links(mechanism)
    joints = constraints(mechanism, starts=starts)
    return with_starts(mechanism, guess(mechanism, joints, placed, targets(joints, starts)[1]))


def _gaps(mechanism: Mechanism, joints: Sequence[Constraint], poses: Sequence[Placement]) -> list[Gap]:
    result = []
    for joint in joints:
        away, turned = np.zeros(3), 0.0
        residuals, wrenches, _ = joint.demands(poses, joint.values)
        for value, wrench in zip(residuals, wrenches, strict=True):
            if np.any(wrench[3:]):
                away = away + value * wrench[3:]
            else:
                turned = max(turned, float(abs(value)))
        # residuals below these are rounding of a closed mechanism: as a fraction of its size, and an angle [rad]
        if np.linalg.norm(away) > 1e-8 * mechanism.length or turned > 1e-7:
            end = joint.frames(poses)[1].p + mechanism.origin
            result.append(Gap(joint.name, end - away, end, turned))
    return result


def _gaps_of_loose_joints(mechanism: Mechanism) -> list[Gap]:
    """Return gaps of balls and pins that start outside their sockets."""
    result = []
    for contact, _, away, inner in separations(mechanism):
        if contact.joint.hollow and np.linalg.norm(away) > 2.0 * contact.joint.clearance:
            end = inner.p + mechanism.origin
            result.append(Gap(contact.name, end - away, end, 0.0))
    return result


def _data(scene: Scene, mechanism: Mechanism, drawn: Mapping[str, xr.Dataset]) -> xr.Dataset:
    import xarray as xr

    names = mechanism.moving_bodies
    poses = {name: _pose(mechanism, name) for name in scene.body}
    centres = []
    for name in names:
        com = drawn[name]["com"].values if name in drawn else np.array(scene.body[name].com)  # type: ignore[union-attr]
        centres.append(poses[name].point(com))
    frames = {name: poses[frame.body].point(frame.placement.p) for name, frame in mechanism.frames.items()}
    still = np.zeros((1, len(names), 3))
    data = {
        "position": (("time", "body", "axis"), np.array(centres).reshape(1, -1, 3)),
        "quaternion": (
            ("time", "body", "quaternion_component"),
            np.array([matrix_to_quaternion(poses[name].R) for name in names]).reshape(1, -1, 4),
        ),
        "velocity": (("time", "body", "axis"), still),
        "angular_velocity": (("time", "body", "axis"), still),
        "frame_position": (("time", "frame", "axis"), np.array(list(frames.values())).reshape(1, -1, 3)),
        "modal_coordinate": (("time", "mode"), np.zeros((1, len(drawn)))),
    }
    joints = {
        label(joint.name, joint.edge.kind, k): value
        for joint in constraints(mechanism)
        for (_, k), value in joint.coordinates([link.start for link in mechanism.links]).items()
    }
    data["joint_position"] = (("time", "coordinate"), np.array(list(joints.values())).reshape(1, -1))
    coordinates = {
        "time": [scene.time.start],
        "body": names,
        "frame": list(frames),
        "mode": [f"{name}.1" for name in drawn],
        "mode_body": ("mode", list(drawn)),
        "coordinate": list(joints),
        "contact": list(scene.pairs()),
    }
    parameters = scene.model_dump(mode="json", exclude={"title", "description", "limits"}, exclude_none=True)
    return xr.Dataset(data, coordinates, {"parameters": json.dumps(parameters, sort_keys=True)})


def _pose(mechanism: Mechanism, body: str) -> Placement:
    """Return the pose of a body's frame in the world."""
    link = mechanism.links[mechanism.link_of[body]]
    here = link.start.of(link.placements[body])
    return here if link is mechanism.links[0] else Placement(here.p + mechanism.origin, here.R)
