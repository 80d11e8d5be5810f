"""A consistent start: joint coordinates from the bodies' poses, loops closed, speeds projected."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from pipeline.core.errors import InputError
from pipeline.core.scene.loads import SpringDamper
from pipeline.core.scene.parts import FlexibleBody, Ground, RigidBody
from pipeline.dynamics import memory as m
from pipeline.dynamics.model.assembly import chain_positions
from pipeline.dynamics.model.constraints import outboard_place
from pipeline.dynamics.model.driving import joint_class
from pipeline.dynamics.model.mechanism import Link, Mechanism
from pipeline.dynamics.model.model import Model

#: state -> frames of all links, named fields of LINK_FRAMES, and rates at which the loops open, (closure rows,)
Motions = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]

#: misses below this share of the speeds asked for are rounding
RIGID = 1e-9
#: a spring shorter than this share of the mechanism's size has no direction
SHORTEST = 1e-9


def start_state(model: Model) -> np.ndarray:
    """State at the start as the scene gives it, before the loops are closed; shape (NY,)."""
    y = np.zeros(model.ny)
    for i, link in enumerate(model.links[1:], start=1):
        if not link.drives and joint_class(link.kind).POSITIONS:
            y[model.numbering.positions[i]] = _positions(model.mechanism, link)
    return y


def _positions(mechanism: Mechanism, link: Link) -> np.ndarray:
    """Positions of a link's joint, or of its part of it, from the poses of the two frames."""
    edge, starts = link.branch.edge, [link.start for link in mechanism.links]
    if edge is not None and edge.kind != link.kind:
        return chain_positions(mechanism, link, starts)
    assert link.inboard is not None
    F = starts[link.inboard.link].of(link.inboard.place)
    relative = F.inverse().of(link.start.of(outboard_place(mechanism, link)))
    return np.asarray(joint_class(link.kind).coordinates(relative.R, relative.p))


def given_velocities(model: Model, motion: Motions, y: np.ndarray) -> np.ndarray:
    """Y with speeds that give the bodies their velocities and keep the loops closed; otherwise the least speeds.

    Flexible bodies start without speeds of deformation if joints, drives and given velocities allow that.
    Raises InputError when joints and drives do not allow the velocities.
    """
    wanted = {
        n: b
        for n, b in model.scene.body.items()
        if not isinstance(b, Ground) and (b.velocity is not None or b.angular_velocity is not None)
    }
    elastic = np.zeros(model.nv, dtype=bool)
    for modes in model.numbering.modal_coordinates.values():
        elastic[modes] = True
    if not wanted and not elastic.any():
        return y
    y = y.copy()
    y[model.speeds] = 0.0
    given = np.array([_components(b.angular_velocity) + _components(b.velocity) for b in wanted.values()]).ravel()
    told, arms = ~np.isnan(given), _arms(model, wanted)

    def rates(state: np.ndarray) -> np.ndarray:
        frames, opening = motion(state)
        return np.concatenate([_twists(frames, *arms)[told], opening])

    base = rates(y)
    columns = []
    for k in range(model.nv):
        moved = y.copy()
        moved[model.nq + k] = 1.0
        columns.append(rates(moved) - base)
    matrix = np.array(columns).T.reshape(len(base), model.nv)
    target = np.concatenate([given[told], np.zeros(len(base) - told.sum())]) - base
    speeds, miss = _least(matrix * ~elastic, target)
    if miss > RIGID * (1.0 + float(np.max(np.abs(target), initial=0.0))):
        speeds, miss = _least(matrix, target)
    if wanted and miss > 1e-6 * (1.0 + float(np.max(np.abs(given[told])))):
        names = ", ".join(wanted)
        raise InputError(
            f"[body.{next(iter(wanted))}.velocity]",
            f"joints and drives do not allow the velocities given for {names} (they miss by {miss:.3g})",
            "give velocities that agree with each other, or fewer of them",
        )
    y[model.speeds] = speeds
    return y


def _least(matrix: np.ndarray, target: np.ndarray) -> tuple[np.ndarray, float]:
    """The least speeds that come nearest to the target, and by how much they miss it."""
    speeds, *_ = np.linalg.lstsq(matrix, target, rcond=1e-12)
    return speeds, float(np.max(np.abs(matrix @ speeds - target), initial=0.0))


def _components(given: tuple[float, float, float] | None) -> list[float]:
    return [np.nan] * 3 if given is None else list(given)


def _arms(model: Model, bodies: Mapping[str, RigidBody | FlexibleBody]) -> tuple[np.ndarray, np.ndarray]:
    """Number of each body's link, (n,), and its centre of mass in the link's frame, (n, 3)."""
    links = [model.mechanism.link_of[name] for name in bodies]
    places = [model.links[link].places[name] for link, name in zip(links, bodies, strict=True)]
    coms = [np.array(getattr(body, "com", (0.0, 0.0, 0.0))) for body in bodies.values()]
    arms = [place.p + place.R @ com for place, com in zip(places, coms, strict=True)]
    return np.array(links, dtype=int), np.array(arms).reshape(len(links), 3)


def _twists(link_frames: np.ndarray, links: np.ndarray, arms: np.ndarray) -> np.ndarray:
    """Angular velocity and velocity of the centre of mass of each body, flattened."""
    frames = link_frames[links]
    turned = np.einsum("nij,nj->ni", frames["axes"], arms)
    return np.hstack([frames["omega"], frames["velocity"] + np.cross(frames["omega"], turned)]).ravel()


def start_loads(model: Model, y: np.ndarray, loads: np.ndarray) -> np.ndarray:
    """Y with the angles that loads follow; `loads`: what each does at y, rows of LOAD with named fields.

    Raises InputError for a spring or damper of no length, which has no direction.
    """
    y = y.copy()
    turns, first = model.arrays.table(m.LOADS)["turns"], model.ny - model.arrays.size(m.N_TURNS)
    for (name, _), turn, value in zip(model.loads, turns, loads["value"], strict=True):
        load = model.scene.load[name]
        if turn >= 0:
            y[first + turn] = value
        has_direction = isinstance(load, SpringDamper) and (load.damping > 0.0 or load.free_length)
        if has_direction and value <= SHORTEST * model.length:
            raise InputError(
                f"[load.{name}.between]",
                "its two ends start in one place, so that it pulls in no direction",
                "move an end; only a spring of no free length and no damping may start so",
            )
    return y
