"""A consistent start: joint coordinates from the bodies' poses, loops closed, speeds projected."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np

from pipeline.core.errors import InputError
from pipeline.core.scene.loads import SpringDamper
from pipeline.core.scene.parts import Ground, RigidBody
from pipeline.dynamics import memory as m
from pipeline.dynamics.model.chain import path_positions
from pipeline.dynamics.model.constraints import outboard_place
from pipeline.dynamics.model.deformation import shift
from pipeline.dynamics.model.driving import joint_class
from pipeline.dynamics.model.flexible_bodies import bow
from pipeline.dynamics.model.loads import order
from pipeline.dynamics.model.merge import Placement
from pipeline.dynamics.model.model import Model
from pipeline.dynamics.model.tree import PATH

#: state -> frames of all links, (links, FRAME_SIZE), and rates at which the loops open, (closure rows,)
Motions = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]

#: misses below this share of the speeds asked for are rounding; speeds that contradict each other miss by more than
#: this share
RIGID, CONTRADICTS = 1e-9, 1e-6
#: combinations of speeds that change rates by less than this share of the largest change nothing: redundant closures
REDUNDANT = 1e-9
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


def given_velocities(model: Model, motion: Motions, y: np.ndarray) -> np.ndarray:
    """Y with speeds that give the bodies their velocities and keep the loops closed; otherwise the least speeds.

    Velocities are those of centres of mass, of flexible bodies as of rigid ones.  Flexible bodies start without speeds
    of deformation if joints, drives and given velocities allow that.
    Raises InputError when joints and drives do not allow the velocities.
    """
    scene, numbering = model.scene, model.numbering
    wanted = {
        n: b
        for n, b in scene.body.items()
        if not isinstance(b, Ground) and (b.velocity is not None or b.angular_velocity is not None)
    }
    elastic = np.zeros(numbering.nv, dtype=bool)
    for link, first in numbering.flex_c0.items():
        elastic[first : first + numbering.modes[link]] = True
    if not wanted and not elastic.any():
        return y
    y = y.copy()
    nq, nv = numbering.nq, numbering.nv
    y[nq : nq + nv] = 0.0
    given = np.array([_components(b.angular_velocity) + _components(b.velocity) for b in wanted.values()]).ravel()
    told, centres = ~np.isnan(given), _centres(model, wanted)

    unit, L = model.speed_scales, model.mechanism.length
    lengths = np.tile([1.0] * 3 + [L] * 3, len(wanted))[told]

    def rates(state: np.ndarray) -> np.ndarray:
        frames, opening = motion(state)
        moving = [centre.motion(frames, state[:nq], state[nq : nq + nv]) for centre in centres]
        return np.concatenate([np.array(moving).ravel()[told] / lengths, opening / model.row_scales])

    base = rates(y)
    columns = []
    for k in range(nv):
        moved = y.copy()
        moved[nq + k] = unit[k]
        columns.append(rates(moved) - base)
    matrix = np.array(columns).T.reshape(len(base), nv)
    asked = np.concatenate([given[told] / lengths, np.zeros(len(base) - told.sum())])
    target = asked - base
    # a radian, or the mechanism's size, in the time of the whole run is slow
    slow = 1.0 / (scene.time.end - scene.time.start)
    fastest = slow + max(float(np.max(np.abs(values), initial=0.0)) for values in (asked, base))
    speeds, miss = _least(matrix * ~elastic, target)
    if miss > RIGID * fastest:
        speeds, miss = _least(matrix, target)
    if wanted and miss > CONTRADICTS * fastest:
        names = ", ".join(wanted)
        raise InputError(
            f"[body.{next(iter(wanted))}.velocity]",
            f"joints and drives do not allow the velocities given for {names} (they miss by {miss:.3g} of the "
            "mechanism's size, or radians, per second)",
            "give velocities that agree with each other, or fewer of them",
        )
    y[nq : nq + nv] = unit * speeds
    return y


def _least(matrix: np.ndarray, target: np.ndarray) -> tuple[np.ndarray, float]:
    """The least speeds that come nearest to the target, and by how much they miss it; all in their natural units."""
    speeds, *_ = np.linalg.lstsq(matrix, target, rcond=REDUNDANT)
    return speeds, float(np.max(np.abs(matrix @ speeds - target), initial=0.0))


def _components(given: tuple[float, float, float] | None) -> list[float]:
    return [np.nan] * 3 if given is None else list(given)


@dataclass(frozen=True)
class _Centre:
    """Centre of mass of a body: its place in the frame of its link, undeformed.

    shape, bow: its shift with the modal coordinates, from q0 and with the speeds from c0 on, as in `deformation.shift`.
    """

    link: int
    place: np.ndarray
    shape: np.ndarray
    bow: np.ndarray | None = None
    q0: int = 0
    c0: int = 0

    def motion(self, frames: np.ndarray, q: np.ndarray, u: np.ndarray) -> np.ndarray:
        """Angular velocity of the body and velocity of this point, world axes, shape (6,)."""
        modes, frame = self.shape.shape[1], frames[self.link]
        bent, bending = q[None, self.q0 : self.q0 + modes], u[None, self.c0 : self.c0 + modes]
        moved, rate, _ = shift(self.shape, self.bow, bent, bending, np.zeros((1, modes)))
        R = frame[m.FRAME.axes : m.FRAME.axes + 9].reshape(3, 3)
        omega, v = (frame[o : o + 3] for o in (m.FRAME.omega, m.FRAME.velocity))
        return np.concatenate([omega, v + np.cross(omega, R @ (self.place + moved[0])) + R @ rate[0]])


def _centres(model: Model, bodies: Iterable[str]) -> list[_Centre]:
    """The centres of mass of bodies, in their order."""
    mechanism, numbering, found = model.mechanism, model.numbering, []
    for name in bodies:
        i = mechanism.link_of[name]
        place, body = mechanism.links[i].places[name], mechanism.scene.body[name]
        if isinstance(body, RigidBody):
            found.append(_Centre(i, place.p + place.R @ np.array(body.com), np.zeros((3, 0))))
            continue
        bundle, bent = mechanism.bundles[name], bow(mechanism, name)
        mass = float(bundle["mass"])
        first, shape = (bundle[key].values / mass for key in ("first_moment", "modal_first_moment"))
        bent = None if bent is None else bent / mass
        found.append(_Centre(i, first, shape, bent, numbering.flex_q0[i], numbering.flex_c0[i]))
    return found


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
