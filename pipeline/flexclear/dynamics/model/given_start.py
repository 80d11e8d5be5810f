"""Contradictions between the start that a scene gives and its drives and joints: refused, or corrected and reported."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from flexclear.dynamics.drives.pieces import Pieces
from flexclear.dynamics.model.chain import path_positions
from flexclear.dynamics.model.constraints import Constraint
from flexclear.dynamics.model.driving import coordinate_of, joint_type, label
from flexclear.dynamics.model.flexible_bodies import start_place
from flexclear.dynamics.model.laws import drive_laws
from flexclear.dynamics.model.mechanism import Mechanism
from flexclear.dynamics.model.merge import Placement
from flexclear.dynamics.model.start_table import Given
from flexclear.dynamics.model.tree import PATH, Edge
from flexclear.numerics.rotations import matrix_to_quaternion, rotation_between, rotation_vector_to_matrix
from flexclear.scene.drives import PathDrive
from flexclear.system.errors import InputError

#: corrections below this, as a fraction of the mechanism's size or in rad, come from the digits that were written
INPUT_DIGITS = 1e-6
#: largest number of bodies whose correction is reported one by one
MOST_REPORTED = 8


@dataclass(frozen=True)
class Contradiction:
    """A coordinate whose value `now` in the given poses is not the `value` of a drive's law or of the scene [m or rad].

    rule: name of what prescribes `value`.  drive: its drive, or None.
    of_path: True for a coordinate of a path, not of a joint.
    """

    drive: str | None
    place: str
    rule: str
    what: str
    now: float
    value: float
    turning: bool
    of_path: bool = False

    @property
    def size(self) -> float:
        """Absolute difference of the two values [m or rad]; angles are compared modulo full turns."""
        difference = self.now - self.value
        return abs((difference + np.pi) % (2.0 * np.pi) - np.pi) if self.turning else abs(difference)

    def text(self) -> str:
        """Return a sentence with both values and their difference."""
        unit = "rad" if self.turning else "m"
        return (
            f"{self.what} starts at {_coordinate_text(self.now)} {unit} in the given poses, but at "
            f"{_coordinate_text(self.value)} {unit} by {self.rule}: they differ by {self.size:.3g} {unit}"
        )


def _coordinate_text(value: float) -> str:
    """Return a coordinate [m or rad] as text; values below 1e-12 are rounding and become 0."""
    return f"{0.0 if abs(value) < 1e-12 else value:.6g}"


def contradictions(
    mechanism: Mechanism, joints: Sequence[Constraint], poses: Sequence[Placement], given: Mapping[str, Pieces]
) -> list[Contradiction]:
    """Return coordinates whose prescribed start contradicts the given poses; bodies without a pose are not examined.

    given: laws that replace the scene's; they were made for these poses and are not examined.
    """
    placed = given_links(mechanism)
    driven = [joint for joint in joints if joint.values and {joint.link_a, joint.link_b} <= placed]
    collected = [contradiction for joint in driven for contradiction in _contradictions_of_joint(joint, poses)]
    for link in mechanism.links:
        edge = link.branch.edge
        if edge is None or edge.kind != PATH or link.massless:
            continue
        site = mechanism.site(edge.frame_b)
        if site.link in placed:
            collected += _contradictions_of_path(
                mechanism, edge, poses[site.link].of(start_place(mechanism, site)), given
            )
    return [contradiction for contradiction in collected if contradiction.drive not in given]


def given_links(mechanism: Mechanism) -> set[int]:
    """Return the links whose pose the scene gives, and the ground."""
    bodies = mechanism.scene.body
    return {0} | {
        i
        for i, link in enumerate(mechanism.links)
        if any(getattr(bodies[name], "pose", None) is not None for name in link.group.placements)
    }


def _contradictions_of_joint(joint: Constraint, poses: Sequence[Placement]) -> Iterator[Contradiction]:
    now, kind = joint.coordinates(poses), joint.edge.kind
    differences = joint.demands(poses, joint.values).residuals[-len(joint.values) :]
    for (k, value), difference in zip(joint.values.items(), differences, strict=True):
        coordinate, named = joint_type(kind).COORDINATES[k], label(joint.name, kind, k)
        drive = joint.edge.drives[k] if joint.edge.drives else None
        what = f"joint '{named}'" if named == joint.name else f"'{named}'"
        # the angle nearest to the law's, where turns are counted
        start = value + float(difference) if coordinate.turning else now[joint.name, k]
        path = f"[drive.{drive}.law]" if drive else f"[start.joint.{named}.position]"
        rule = f"the law of drive '{drive}'" if drive else "its own start"
        yield Contradiction(drive, path, rule, what, start, value, coordinate.turning)


def _contradictions_of_path(
    mechanism: Mechanism, edge: Edge, G: Placement, given: Mapping[str, Pieces]
) -> Iterator[Contradiction]:
    t = mechanism.scene.time.start
    laws = dict(zip(mechanism.drives, drive_laws(mechanism.scene, given), strict=True))
    now = path_positions(edge, G.R, G.p + mechanism.origin)
    requested = [None if name is None else laws[name].value(t) for name in edge.drives]
    if edge.vector:
        turn = rotation_vector_to_matrix(np.array(requested[3:6], dtype=float))
        angle = float(rotation_between(matrix_to_quaternion(turn), matrix_to_quaternion(G.R)))
        drive, what = str(edge.drives[3]), f"the turn of '{edge.frame_b}'"
        path = f"[drive.{drive.partition('.')[0]}.rotation]"
        yield Contradiction(drive, path, f"the law of drive '{drive}'", what, angle, 0.0, True, True)
    for k, (name, value) in enumerate(zip(edge.drives, requested, strict=True)):
        if name is None or value is None or (edge.vector and k >= 3):
            continue
        rule, what = f"the law of drive '{name}'", f"'{edge.frame_b}'"
        yield Contradiction(name, f"[drive.{name}]", rule, what, float(now[k]), value, k >= 3, True)


def refuse_far(mechanism: Mechanism, far: Sequence[Contradiction]) -> None:
    """Raise InputError for given poses that contradict a joint's drive by more than a correction may move them.

    A frame on a path is moved to the start of the path, however far that is, and the correction is reported.
    """
    for contradiction in far:
        if contradiction.of_path:
            continue
        # a start that is further from its drive's law than this is refused, as a fraction of the mechanism's size and
        # in rad
        limit = 0.1 if contradiction.turning else 0.05 * mechanism.length
        if contradiction.size > limit:
            unit = "rad" if contradiction.turning else "m"
            raise InputError(
                contradiction.place,
                f"{contradiction.text()} (more than {limit:.3g} {unit})",
                "correct the poses or the start of the law, or remove the poses of the bodies that the drive moves"
                if contradiction.drive
                else "correct the poses or the position, or remove the poses of the bodies that follow from it",
            )


def refuse_driven(mechanism: Mechanism, starts: Sequence[Given], given: Mapping[str, Pieces]) -> None:
    """Raise InputError for given starts of driven coordinates that differ from the drives' laws.

    given: laws that replace the scene's; they were made for this start.
    """
    t, laws = mechanism.scene.time.start, dict(zip(mechanism.drives, drive_laws(mechanism.scene, given), strict=True))
    for name, drive in mechanism.scene.drive.items():
        if isinstance(drive, PathDrive) or name in given:
            continue
        joint, number, coordinate = coordinate_of(mechanism.scene, drive.joint, drive.coordinate, f"[drive.{name}]")
        for start in (s for s in starts if (s.joint, s.number) == (joint, number)):
            for key, order, requested in (("position", 0, start.position), ("velocity", 1, start.velocity)):
                law, unit = laws[name].value(t, order), coordinate.unit + "/s" * order
                size = 1.0 if coordinate.turning else mechanism.length
                if requested is not None and abs(law - requested) > INPUT_DIGITS * max(size, abs(law)):
                    raise InputError(
                        f"{start.place[:-1]}.{key}]",
                        f"is {requested:.6g} {unit}, and by the law of drive '{name}' {law:.6g} {unit}",
                        "remove it; driven coordinates start as their laws do",
                    )


def corrected_starts(mechanism: Mechanism, now: Sequence[Placement]) -> list[str]:
    """Return a sentence that lists bodies which do not start where the scene gives them, with amounts; else nothing.

    now: frames of all links at the start.
    """
    corrections = []
    for i in sorted(given_links(mechanism) - {0}):
        before, after = mechanism.placed[i], now[i]
        distance = float(np.linalg.norm(after.p - before.p)) / mechanism.length
        turned = float(rotation_between(matrix_to_quaternion(before.R), matrix_to_quaternion(after.R)))
        amounts = [f"moved by {distance * mechanism.length:.3g} m"] if distance > INPUT_DIGITS else []
        amounts += [f"turned by {turned:.3g} rad ({np.degrees(turned):.3g} deg)"] if turned > INPUT_DIGITS else []
        if amounts:
            corrections.append(
                (distance + turned, f"{', '.join(mechanism.links[i].group.placements)} {' and '.join(amounts)}")
            )
    if not corrections:
        return []
    texts = [text for _, text in sorted(corrections, reverse=True)]
    more = [f"and {len(texts) - MOST_REPORTED} more bodies"] if len(texts) > MOST_REPORTED else []
    return [f"the start was corrected to satisfy joints and drives: {'; '.join([*texts[:MOST_REPORTED], *more])}"]
