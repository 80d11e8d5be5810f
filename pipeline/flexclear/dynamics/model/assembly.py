"""Assembly: from the poses that a scene gives to poses that all joints allow, or a refusal."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from flexclear.dynamics.drives.pieces import Pieces
from flexclear.dynamics.model import fitting, given_start
from flexclear.dynamics.model.chain import path_positions
from flexclear.dynamics.model.closing import CLOSED_EXACTLY, close, ill_fitting, misfit, opposite
from flexclear.dynamics.model.constraints import Constraint, constraints, joint_positions, moved_frame
from flexclear.dynamics.model.flexible_bodies import start_place
from flexclear.dynamics.model.laws import NO_LAWS
from flexclear.dynamics.model.mechanism import Link, Mechanism
from flexclear.dynamics.model.merge import Placement
from flexclear.dynamics.model.placing import Assembly, ambiguity, assemblies, guess, targets
from flexclear.dynamics.model.start_table import Given, given_coordinates
from flexclear.system.errors import InputError


def assemble(mechanism: Mechanism, given: Mapping[str, Pieces] = NO_LAWS, *, exact: bool = False) -> Mechanism:
    """Return the mechanism with links placed so that all joints fit and driven ones are where their drives prescribe.

    Mechanisms with flexible bodies or paths are only checked: the engine closes them, with deformation and prescribed
    poses.
    given: laws that replace the scene's.  exact: True where no frame may be moved within its tolerance.
    Raises InputError for joints whose frames start at a large distance or with opposite axes, for given poses that
    contradict a drive, and for a mechanism that cannot be assembled, with the residual of every joint.
    """
    starts = given_coordinates(mechanism.scene)
    given_start.refuse_driven(mechanism, starts, given)
    joints, poses = constraints(mechanism, given, starts), [link.start for link in mechanism.links]
    placed = given_start.given_links(mechanism)
    between = [joint for joint in joints if {joint.link_a, joint.link_b} <= placed]
    free = len(placed) + sum(link.massless for link in mechanism.links[1:]) < len(mechanism.links)
    wrong = ill_fitting(mechanism, joints, poses) or opposite(joints, poses)
    search = free and not mechanism.has_paths and (wrong is not None or bool(starts))
    judged = between if search else joints
    if search:
        wrong = ill_fitting(mechanism, judged, poses) or opposite(judged, poses)
    if wrong is not None:
        raise wrong
    contradicted = given_start.contradictions(mechanism, joints, poses, given)
    given_start.refuse_far(mechanism, contradicted)
    residual = max([*residuals(judged, poses).values(), *(one.size for one in contradicted)], default=0.0)
    mechanism = replace(mechanism, start_residual=residual, placed=tuple(poses))
    if search:
        candidates = assemblies(mechanism, joints, placed, starts)
        if not candidates and not exact:
            mine = (mechanism, joints, placed, starts)
            fits = _assemble_with_moved_frames(
                mechanism, joints, given, lambda within: [one.poses for one in assemblies(*mine, within)]
            )
            if fits is not None:
                return fits
        return _place_links(mechanism, joints, placed, starts, candidates)
    asked = bool(starts or mechanism.deformation)
    if mechanism.has_paths or not (mechanism.all_rigid or asked):
        return with_starts(mechanism, poses)
    closed = close(mechanism, joints, poses)
    if closed is None and mechanism.all_rigid:
        fits = None if exact else _assemble_with_moved_frames(mechanism, joints, given, lambda within: [poses])
        if fits is not None:
            return fits
        _refuse_drives(mechanism, joints, poses)
        raise _impossible(mechanism, joints, poses)
    return with_starts(mechanism, closed or poses)


def _assemble_with_moved_frames(
    mechanism: Mechanism,
    joints: list[Constraint],
    given: Mapping[str, Pieces],
    near: Callable[[float], list[list[Placement]]],
) -> Mechanism | None:
    """Return the assembled mechanism with frames moved within their tolerances; None where these do not suffice.

    near: as in `fitting.fit_frames`.
    """
    scene = mechanism.scene
    # plans make bodies with recipes rigid, whose frames are then as exact as the mesh has them
    tolerant = scene.recipes() or any(body.frame_tolerance for body in scene.rigid().values())
    other = fitting.fit_frames(mechanism, joints, near) if tolerant else None
    if other is None:
        return None
    fits = assemble(other, given, exact=True)
    return replace(fits, choice=" ".join([fitting.describe_moved_frames(mechanism, other), fits.choice]).strip())


def _place_links(
    mechanism: Mechanism,
    joints: list[Constraint],
    placed: set[int],
    starts: Sequence[Given],
    candidates: Sequence[Assembly],
) -> Mechanism:
    """Return the mechanism with links without poses at the first of the assemblies; raise InputError without any."""
    if not candidates:
        _refuse_starts(mechanism, joints, placed, starts)
        driven = any(joint.values for joint in joints)
        if driven and assemblies(mechanism, [replace(joint, values={}) for joint in joints], placed, starts):
            raise _out_of_reach(mechanism, joints)
        raise _impossible(mechanism, joints, guess(mechanism, joints, placed, targets(joints, starts)[1]))
    choice = ambiguity(mechanism, joints, candidates, starts, placed)
    return replace(with_starts(mechanism, candidates[0].poses), choice=choice)


def with_starts(mechanism: Mechanism, poses: Sequence[Placement]) -> Mechanism:
    """Return the mechanism with these start poses; massless links of joints follow from the joints' coordinates."""
    links, settled_poses = [], list(poses)
    for i, link in enumerate(mechanism.links):
        if link.massless and i:
            settled_poses[i] = _massless_link_pose(mechanism, link, poses, settled_poses)
        links.append(replace(link, start=settled_poses[i]))
    return replace(mechanism, links=links)


def _massless_link_pose(
    mechanism: Mechanism, link: Link, poses: Sequence[Placement], settled_poses: Sequence[Placement]
) -> Placement:
    """Return the pose of a massless link: that of its inboard frame, moved along or about z by its own coordinate."""
    assert link.inboard is not None
    F = settled_poses[link.inboard.link].of(start_place(mechanism, link.inboard))
    return moved_frame(link.kind, F, chain_positions(mechanism, link, poses) if link.joint.positions else [])


def chain_positions(mechanism: Mechanism, link: Link, poses: Sequence[Placement]) -> np.ndarray:
    """Return the positions of a chain or path that belong to one link, in the tree's sense.

    poses: of the links that have mass.
    """
    edge, joint = link.branch.edge, link.joint
    assert edge is not None

    def at(frame: str) -> Placement:
        site = mechanism.site(frame)
        return poses[site.link].of(start_place(mechanism, site))

    G = at(edge.frame_b)
    if link.on_path:
        whole = path_positions(edge, G.R, G.p + mechanism.origin)
    else:
        whole = joint_positions(edge.kind, at(edge.frame_a), G)
    return np.asarray(joint.sign * whole[list(joint.positions)])


def residuals(joints: list[Constraint], poses: Sequence[Placement]) -> dict[str, float]:
    """Return the largest residual per joint [m, or the sine of an angle], without drives."""
    worst = {}
    for joint in joints:
        worst[joint.name] = float(np.max(np.abs(joint.demands(poses).residuals), initial=0.0))
    return worst


def _refuse_starts(mechanism: Mechanism, joints: list[Constraint], placed: set[int], starts: Sequence[Given]) -> None:
    """Raise InputError when only the positions that the scene gives prevent the assembly."""
    requested = [start for start in starts if start.position is not None]
    driven = {(start.joint, start.number) for start in requested}
    loose = [
        replace(joint, values={k: v for k, v in joint.values.items() if (joint.name, k) not in driven})
        for joint in joints
    ]
    others = assemblies(mechanism, loose, placed, starts) if requested else []
    if others:
        there = others[0].coordinates
        reached = ", ".join(f"{s.name} {there[s.joint, s.number]:.6g} {s.coordinate.unit}" for s in requested)
        raise InputError(
            f"{requested[0].place[:-1]}.position]",
            f"the joints cannot be assembled at the given positions, but for example at {reached}",
            "correct the position, or give an approximate value as near",
        )


def _refuse_drives(mechanism: Mechanism, joints: list[Constraint], poses: list[Placement]) -> None:
    """Raise InputError when only the start values of drives prevent the assembly."""
    driven = [joint for joint in joints if joint.values]
    if not driven or close(mechanism, [replace(joint, values={}) for joint in joints], poses) is None:
        return
    raise _out_of_reach(mechanism, driven)


def _out_of_reach(mechanism: Mechanism, joints: Sequence[Constraint]) -> InputError:
    """Return the error of joints that fit together, but not at the start values of their drives."""
    driven = {joint.name for joint in joints if joint.values}
    scene = mechanism.scene
    names = [n for n, d in scene.drive.items() if getattr(d, "joint", None) in driven]
    return InputError(
        f"[drive.{names[0]}.law]",
        f"the joints can be assembled, but not at the positions of the drives ({', '.join(names)}) at "
        f"t = {scene.time.start:.6g} s: the mechanism is over-driven, or a drive starts out of reach",
        "correct the start of a drive, or remove one",
    )


def _impossible(mechanism: Mechanism, joints: list[Constraint], poses: list[Placement]) -> InputError:
    left = residuals(joints, poses)
    worst = max(left, key=lambda name: left[name])
    listed = ", ".join(
        f"{name} {value:.3g}" for name, value in left.items() if value > CLOSED_EXACTLY * mechanism.length
    )
    posed = len(given_start.given_links(mechanism)) > 1
    where = "close to the given poses; residuals" if posed else "by its joints; residuals of the first attempt"
    # residuals of joints below this fraction of the mechanism's size come from rounded input
    slight = misfit(mechanism, joints, poses).worst < 1e-4
    return InputError(
        f"[joint.{worst}.between]",
        f"the mechanism cannot be assembled {where} (m, or sines of angles): {listed}"
        + ("; several joints impose nearly equal conditions" if slight else ""),
        "write lengths, frames and poses with more digits, or use a joint with more freedom"
        if slight
        else "correct lengths, frames, poses, or the start of a drive",
    )
