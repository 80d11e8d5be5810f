"""A consistent start: joint coordinates from the bodies' poses, loops closed, speeds projected."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from pipeline.core.errors import InputError
from pipeline.core.scene.loads import SpringDamper
from pipeline.core.scene.parts import Ground
from pipeline.dynamics import memory as m
from pipeline.dynamics.model.chain import path_positions
from pipeline.dynamics.model.constraints import outboard_place
from pipeline.dynamics.model.driving import joint_class
from pipeline.dynamics.model.loads import order
from pipeline.dynamics.model.merge import Placement
from pipeline.dynamics.model.model import Model
from pipeline.dynamics.model.tree import PATH

#: state -> frames of all links, (links, FRAME_SIZE), and rates at which the loops open, (closure rows,)
Motions = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]

#: misses below this share of the speeds asked for are rounding
RIGID = 1e-9
#: a spring shorter than this share of the mechanism's size has no direction
SHORTEST = 1e-9


def start_state(model: Model) -> np.ndarray:
    """State at the start as the scene gives it, before the loops are closed; shape (n,)."""
    numbering, mechanism = model.numbering, model.mechanism
    q, v = np.zeros(numbering.nq), np.zeros(numbering.nv)
    for i, link in enumerate(mechanism.links[1:], start=1):
        declared = joint_class(link.kind)
        if numbering.driven(i) >= 0 or not declared.POSITIONS:
            continue
        coordinates = _coordinates(model, i)
        q[numbering.q0[i] : numbering.q0[i] + len(coordinates)] = coordinates
    return np.concatenate([q, v, np.zeros(model.arrays.size(m.N_LEDGER))])


def _coordinates(model: Model, i: int) -> np.ndarray:
    """Positions of a link's joint, or of its part of it, from the poses of the two frames."""
    mechanism = model.mechanism
    link = mechanism.links[i]
    edge, stage = link.branch.edge, link.stage
    assert link.inboard is not None
    if edge is None or stage is None or edge.kind == link.kind:
        F = mechanism.links[link.inboard.link].start.of(link.inboard.place)
        relative = F.inverse().of(link.start.of(outboard_place(mechanism, link)))
        found: np.ndarray = joint_class(link.kind).coordinates(relative.R, relative.p)
        return found
    G = _world(model, edge.frame_b)
    if edge.kind == PATH:
        whole = path_positions(edge, G.R, G.p + mechanism.origin)
    else:
        relative = _world(model, edge.frame_a).inverse().of(G)
        whole = joint_class(edge.kind).coordinates(relative.R, relative.p)
    return stage.sign * whole[list(stage.positions)]


def _world(model: Model, frame: str) -> Placement:
    """Start pose of a named frame, from the kernels' origin."""
    site = model.mechanism.site(frame)
    return model.mechanism.links[site.link].start.of(site.place)


@dataclass(frozen=True)
class Velocities:
    """Linear equations matrix @ speeds = target of the start's speeds, (n, nv), and (n,).

    told: how many rows, the first ones, ask for the given velocities of `bodies`; the others keep the loops closed.
    """

    matrix: np.ndarray
    target: np.ndarray
    told: int
    bodies: tuple[str, ...]


def velocity_equations(model: Model, motion: Motions, y: np.ndarray) -> Velocities:
    """What is asked of the speeds at the start."""
    wanted = _given(model)
    y = y.copy()
    nq, nv = model.numbering.nq, model.numbering.nv
    y[nq : nq + nv] = 0.0
    given = np.array([_components(b.angular_velocity) + _components(b.velocity) for b in wanted.values()]).ravel()
    told, arms = ~np.isnan(given), _arms(model, wanted)

    def rates(state: np.ndarray) -> np.ndarray:
        frames, opening = motion(state)
        return np.concatenate([_twists(frames, *arms)[told], opening])

    base = rates(y)
    columns = []
    for k in range(nv):
        moved = y.copy()
        moved[nq + k] = 1.0
        columns.append(rates(moved) - base)
    matrix = np.array(columns).T.reshape(len(base), nv)
    target = np.concatenate([given[told], np.zeros(len(base) - told.sum())]) - base
    return Velocities(matrix, target, int(told.sum()), tuple(wanted))


def given_velocities(model: Model, motion: Motions, y: np.ndarray) -> np.ndarray:
    """Y with speeds that give the bodies their velocities and keep the loops closed; otherwise the least speeds.

    Flexible bodies start without speeds of deformation if joints, drives and given velocities allow that.
    Raises InputError when joints and drives do not allow the velocities.
    """
    numbering = model.numbering
    elastic = np.zeros(numbering.nv, dtype=bool)
    for link, first in numbering.flex_c0.items():
        elastic[first : first + numbering.modes[link]] = True
    if not _given(model) and not elastic.any():
        return y
    asked, y = velocity_equations(model, motion, y), y.copy()
    speeds, miss = _least(asked.matrix * ~elastic, asked.target)
    if miss > RIGID * (1.0 + float(np.max(np.abs(asked.target), initial=0.0))):
        speeds, miss = _least(asked.matrix, asked.target)
    if asked.bodies and miss > 1e-6 * (1.0 + float(np.max(np.abs(asked.target[: asked.told])))):
        raise InputError(
            f"[body.{asked.bodies[0]}.velocity]",
            f"joints and drives do not allow the velocities given for {', '.join(asked.bodies)} (they miss by "
            f"{miss:.3g})",
            "give velocities that agree with each other, or fewer of them",
        )
    y[numbering.nq : numbering.nq + numbering.nv] = speeds
    return y


def _given(model: Model) -> dict[str, Any]:
    """Bodies that are given velocities."""
    return {
        n: b
        for n, b in model.scene.body.items()
        if not isinstance(b, Ground) and (b.velocity is not None or b.angular_velocity is not None)
    }


def _least(matrix: np.ndarray, target: np.ndarray) -> tuple[np.ndarray, float]:
    """The least speeds that come nearest to the target, and by how much they miss it."""
    speeds, *_ = np.linalg.lstsq(matrix, target, rcond=1e-12)
    return speeds, float(np.max(np.abs(matrix @ speeds - target), initial=0.0))


def _components(given: tuple[float, float, float] | None) -> list[float]:
    return [np.nan] * 3 if given is None else list(given)


def _arms(model: Model, bodies: dict) -> tuple[np.ndarray, np.ndarray]:
    """Number of each body's link, (n,), and its centre of mass in the link's frame, (n, 3)."""
    links = [model.mechanism.link_of[name] for name in bodies]
    places = [model.mechanism.links[link].places[name] for link, name in zip(links, bodies, strict=True)]
    coms = [np.array(getattr(body, "com", (0.0, 0.0, 0.0))) for body in bodies.values()]
    arms = [place.p + place.R @ com for place, com in zip(places, coms, strict=True)]
    return np.array(links, dtype=int), np.array(arms).reshape(len(links), 3)


def _twists(link_frames: np.ndarray, links: np.ndarray, arms: np.ndarray) -> np.ndarray:
    """Angular velocity and velocity of the centre of mass of each body, flattened."""
    frames = link_frames[links]
    omega, v = frames[:, m.FRAME.omega : m.FRAME.omega + 3], frames[:, m.FRAME.velocity : m.FRAME.velocity + 3]
    turned = np.einsum("nij,nj->ni", frames[:, m.FRAME.axes : m.FRAME.axes + 9].reshape(-1, 3, 3), arms)
    return np.hstack([omega, v + np.cross(omega, turned)]).ravel()


def start_loads(model: Model, y: np.ndarray, loads: np.ndarray) -> np.ndarray:
    """Y with the angles that loads follow; `loads`: what each does at y, shape (loads, LOAD_SIZE).

    Raises InputError for a spring or damper of no length, which has no direction.
    """
    y, scene = y.copy(), model.scene
    for name, row, now in zip(order(scene), model.arrays.table(m.LOADS), loads, strict=True):
        load = scene.load[name]
        if row["turns"] >= 0:
            y[len(y) - model.arrays.size(m.N_TURNS) + row["turns"]] = now["value"]
        has_direction = isinstance(load, SpringDamper) and (load.damping > 0.0 or load.free_length)
        if has_direction and now["value"] <= SHORTEST * model.mechanism.length:
            raise InputError(
                f"[load.{name}.between]",
                "its two ends start in one place, so that it pulls in no direction",
                "move an end; only a spring of no free length and no damping may start so",
            )
    return y
