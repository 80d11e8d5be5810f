"""Assembly of links without given poses: of several assemblies, the one nearest to the scene's hints.

The joints determine the missing poses, one link after the other. Their coordinates have the values that drives, starts
and hints give, else zero or, to find other assemblies, random values. Loops are then closed (`closing.close`); links
with a given pose stay still as long as that is possible.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from flexclear.dynamics.model.closing import close, misfit, opposite
from flexclear.dynamics.model.constraints import Constraint, moved_frame
from flexclear.dynamics.model.driving import joint_type, label
from flexclear.dynamics.model.mechanism import Mechanism
from flexclear.dynamics.model.merge import Placement
from flexclear.dynamics.model.start_table import Given
from flexclear.numerics.rotations import rotation_vector_to_matrix

#: initial guesses from which assemblies are sought; only the first is not random
GUESSES = 16
#: assemblies are equal if no coordinate differs by more than this, in radians or fractions of the mechanism's size
SAME_ASSEMBLY = 1e-4
#: singular values of naturally sized rows below this fraction of the largest count as zero: a motion is free
LOOSE = 1e-6

Hints = Mapping[tuple[str, int], float]


@dataclass(frozen=True)
class Assembly:
    """Poses of all links in which the joints fit; coordinates: of the joints, by name and number [m or rad]."""

    poses: list[Placement]
    coordinates: dict[tuple[str, int], float]


def assemblies(
    mechanism: Mechanism, joints: list[Constraint], placed: set[int], starts: Sequence[Given], within: float = 0.0
) -> list[Assembly]:
    """Return the assemblies in which the joints fit, nearest to the hints first, then to the first guess; maybe none.

    placed: links that have a given pose.  within: as in `close`.
    """
    hints, aims = targets(joints, starts)
    random, distinct, aim = np.random.default_rng(0), list[Assembly](), dict[tuple[str, int], float]()
    for k in range(GUESSES):
        here = guess(mechanism, joints, placed, aims, random if k else None, k / GUESSES)
        if k == 0:
            aim = {**_coordinates(joints, here), **hints}
        poses = close(mechanism, joints, here, placed, within)
        if poses is None and len(placed) > 1:
            poses = close(mechanism, joints, here, within=within)
        if poses is None or opposite(joints, poses) is not None:
            continue
        assembly = Assembly(poses, _coordinates(joints, poses))
        if all(
            _distance(mechanism, joints, assembly.coordinates, other.coordinates) > SAME_ASSEMBLY for other in distinct
        ):
            distinct.append(assembly)
        # the search ends at an assembly that can move and is closer than this to all hints
        if _freedoms(mechanism, joints, poses) and _distance(mechanism, joints, assembly.coordinates, hints) < 0.5:
            break  # a mechanism that can move: its first assembly near the hints counts
    from_hints = [_distance(mechanism, joints, one.coordinates, hints) for one in distinct]
    nearest = min(from_hints, default=0.0)
    # of assemblies that are nearest to the hints but for rounding, the one of the first guess comes first
    order = sorted(
        range(len(distinct)),
        key=lambda k: (
            from_hints[k] if from_hints[k] - nearest > SAME_ASSEMBLY else nearest,
            _distance(mechanism, joints, distinct[k].coordinates, aim),
        ),
    )
    return [distinct[k] for k in order]


def ambiguity(
    mechanism: Mechanism,
    joints: Sequence[Constraint],
    candidates: Sequence[Assembly],
    starts: Sequence[Given],
    placed: set[int],
) -> str:
    """Return a sentence on a start that the scene does not choose: one of several assemblies, or where free coordinates
    start; else an empty text.

    placed: links that have a given pose.
    """
    first = candidates[0]
    if _freedoms(mechanism, joints, first.poses):
        return _anywhere(mechanism, joints, first, starts, placed)
    if len(candidates) < 2:
        return ""
    hints, _ = targets(joints, starts)
    distances = [_distance(mechanism, joints, one.coordinates, hints) for one in candidates]
    if hints and distances[1] - distances[0] > SAME_ASSEMBLY:
        return ""
    differences = {key: abs(first.coordinates[key] - candidates[1].coordinates[key]) for key in first.coordinates}
    name, k = max(differences, key=lambda key: differences[key])
    kind = next(joint.edge.kind for joint in joints if joint.name == name)
    coordinate, called = joint_type(kind).COORDINATES[k], label(name, kind, k)
    values = ", ".join(f"{one.coordinates[name, k]:.4g}" for one in candidates[1:])
    return (
        f"the joints can be assembled in {len(candidates)} ways, and the scene does not select one: it starts with "
        f"{called} at {first.coordinates[name, k]:.4g} {coordinate.unit}, the others have {values}; "
        f"[start.joint.{called}] near = ... selects one"
    )


def _anywhere(
    mechanism: Mechanism, joints: Sequence[Constraint], at: Assembly, starts: Sequence[Given], placed: set[int]
) -> str:
    """Return a sentence that lists free coordinates which start neither where the scene says nor at 0."""
    if mechanism.scene.start is not None and mechanism.scene.start._sought:
        return ""
    held, open_ones, said = list[Constraint](), dict[str, str](), {(start.joint, start.number) for start in starts}
    known = {key for key, value in at.coordinates.items() if abs(value) <= SAME_ASSEMBLY}
    for key, near in targets(joints, starts)[0].items():
        # a coordinate closer to its hint than this, in radians or fractions of the mechanism's size, starts where it is
        # said
        known |= {key} if _distance(mechanism, joints, at.coordinates, {key: near}) <= 0.01 else set()
    for joint in joints:
        numbers = range(len(joint_type(joint.edge.kind).COORDINATES))
        chosen = [k for k in numbers if {joint.link_a, joint.link_b} <= placed or (joint.name, k) in known]
        held.append(_with_prescribed_coordinates(joint, at, [k for k in chosen if k not in joint.values]))
    freedoms = _freedoms(mechanism, held, at.poses)
    for i, joint in enumerate(joints):
        for k, coordinate in enumerate(joint_type(joint.edge.kind).COORDINATES):
            if not freedoms or k in held[i].values or (joint.name, k) in said:
                continue
            more = [*held[:i], _with_prescribed_coordinates(held[i], at, [k]), *held[i + 1 :]]
            if (fewer := _freedoms(mechanism, more, at.poses)) < freedoms:
                held, freedoms = more, fewer
                value = f"{at.coordinates[joint.name, k]:.4g} {coordinate.unit}"
                open_ones[label(joint.name, joint.edge.kind, k)] = value
    if not open_ones:
        return ""
    return (
        "the scene does not say where free coordinates start: "
        f"{', '.join(f'{called} is at {value}' for called, value in open_ones.items())}; "
        f"[start.joint.{next(iter(open_ones))}] position = ... sets one"
    )


def _with_prescribed_coordinates(joint: Constraint, at: Assembly, numbers: Sequence[int]) -> Constraint:
    """Return a joint with some coordinates prescribed where an assembly has them."""
    return replace(joint, values={**joint.values, **{k: at.coordinates[joint.name, k] for k in numbers}})


def targets(joints: Sequence[Constraint], starts: Sequence[Given]) -> tuple[Hints, Hints]:
    """Return the approximate coordinates that hints give, and these with the prescribed coordinates added."""
    hints = {(s.joint, s.number): s.near for s in starts if s.near is not None}
    return hints, hints | {(j.name, k): value for j in joints for k, value in j.values.items()}


def guess(
    mechanism: Mechanism,
    joints: Sequence[Constraint],
    placed: set[int],
    values: Hints,
    random: np.random.Generator | None = None,
    spread: float = 0.0,
) -> list[Placement]:
    """Return poses of all links; a joint to a known link places each link without a pose, loops may stay open."""
    poses, known = [link.start for link in mechanism.links], set(placed)
    # joints with few degrees of freedom come first: they determine poses best
    order = sorted(joints, key=lambda joint: len(joint_type(joint.edge.kind).SPEEDS) - len(joint.values))
    while True:
        joint = next((j for j in order if (j.link_a in known) != (j.link_b in known)), None)
        if joint is None:
            return poses
        motion = _motion(mechanism, joint, values, random, spread)
        if joint.link_a in known:
            poses[joint.link_b] = poses[joint.link_a].of(joint.place_a).of(motion).of(joint.place_b.inverse())
            known.add(joint.link_b)
        else:
            poses[joint.link_a] = poses[joint.link_b].of(joint.place_b).of(motion.inverse()).of(joint.place_a.inverse())
            known.add(joint.link_a)


def _motion(
    mechanism: Mechanism, joint: Constraint, values: Hints, random: np.random.Generator | None, spread: float
) -> Placement:
    """Return the pose of a joint's second frame in its first."""
    kind, x = joint.edge.kind, list[float]()
    coordinates = joint_type(kind).COORDINATES
    if not coordinates:
        turn = np.pi * spread * random.normal(size=3) if random is not None and kind == "spherical" else np.zeros(3)
        return Placement(R=rotation_vector_to_matrix(turn))
    for k, coordinate in enumerate(coordinates):
        value = values.get((joint.name, k))
        if value is None:
            value = 0.0 if random is None else float(random.uniform(-1.0, 1.0))
            # largest random slide, as a fraction of the mechanism's size
            value *= np.pi if coordinate.turning else 0.3 * mechanism.length
        x.append(value)
    return moved_frame(kind, Placement(), x)


def _coordinates(joints: Sequence[Constraint], poses: Sequence[Placement]) -> dict[tuple[str, int], float]:
    return {key: value for joint in joints for key, value in joint.coordinates(poses).items()}


def _distance(mechanism: Mechanism, joints: Sequence[Constraint], one: Hints, other: Hints) -> float:
    """Return the largest difference of common coordinates, in radians or fractions of the mechanism's size."""
    turning = {(j.name, k): c.turning for j in joints for k, c in enumerate(joint_type(j.edge.kind).COORDINATES)}
    differences = [0.0]
    for key in one.keys() & other.keys():
        way = one[key] - other[key]
        differences.append(abs((way + np.pi) % (2.0 * np.pi) - np.pi) if turning[key] else abs(way) / mechanism.length)
    return max(differences)


def _freedoms(mechanism: Mechanism, joints: Sequence[Constraint], poses: list[Placement]) -> int:
    """Return the number of motions that the joints and the prescribed coordinates leave."""
    free = [i for i, link in enumerate(mechanism.links) if i and not link.massless]
    columns = [6 * (i - 1) + k for i in free for k in range(6)]
    gradient = misfit(mechanism, list(joints), poses).gradient().toarray()[:, columns]
    values = np.linalg.svd(gradient, compute_uv=False)
    return len(columns) - int(np.sum(values > LOOSE * values.max(initial=0.0)))
