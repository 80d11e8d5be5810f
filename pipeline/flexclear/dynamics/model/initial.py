"""Consistent start: joint coordinates from the poses of bodies, loops closed, speeds projected."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from flexclear.dynamics import memory as m
from flexclear.dynamics.joints.conditions import along, frame_motion
from flexclear.dynamics.joints.coordinate import Coordinate
from flexclear.dynamics.model import bushings
from flexclear.dynamics.model.assembly import chain_positions
from flexclear.dynamics.model.constraints import joint_positions, outboard_place
from flexclear.dynamics.model.driving import joint_type
from flexclear.dynamics.model.flexible_bodies import second_first_moment, shift, start_place
from flexclear.dynamics.model.gauges import angles
from flexclear.dynamics.model.mechanism import Link, Mechanism
from flexclear.dynamics.model.model import Model
from flexclear.dynamics.model.start_table import given_coordinates, given_modes
from flexclear.scene.parts import FlexibleBody, Ground, MeshedRigidBody, RigidBody
from flexclear.system.errors import InputError

#: state -> frames of all links and sites (named fields of LINK_FRAMES and SITE_FRAMES), and residual rates of the
#: closures, (closure rows,)
Motions = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray, np.ndarray]]

#: of effects: their internal states that follow from the frames of sites
STATES = {"bushings": bushings.rotations}
#: errors below this fraction of the requested speeds are rounding
RIGID = 1e-9
#: errors of given velocities below this fraction of the speeds come from the digits with which they were written
INPUT_DIGITS = 1e-6
#: errors above this fraction of the largest given velocity are refused
WRONG = 0.05
#: combinations of speeds that change rates by less than this fraction of the largest have no effect, as redundant rows
REDUNDANT = 1e-9


def start_state(model: Model) -> np.ndarray:
    """Return the state at the start as the scene gives it, before the loops are closed; shape (NY,)."""
    y = np.zeros(model.ny)
    for i, link in enumerate(model.links[1:], start=1):
        if not link.drives and joint_type(link.kind).POSITIONS:
            y[model.numbering.positions[i]] = _positions(model.mechanism, link)
    for i, q in model.mechanism.deformation.items():
        y[model.numbering.modal_positions[i]] = q
    return y


def _positions(mechanism: Mechanism, link: Link) -> np.ndarray:
    """Return the positions of a link's joint, or of its part of a chain, from the poses of the joint's two frames."""
    edge, starts = link.branch.edge, [link.start for link in mechanism.links]
    if edge is not None and edge.kind != link.kind:
        return chain_positions(mechanism, link, starts)
    assert link.inboard is not None
    F = starts[link.inboard.link].of(start_place(mechanism, link.inboard))
    return joint_positions(link.kind, F, link.start.of(outboard_place(mechanism, link)))


@dataclass(frozen=True)
class Rate:
    """A velocity that the scene gives: `requested` [m/s or rad/s], its key path, and its natural unit `size`.

    speed, sign: index of the free coordinate whose speed, times the sign, is this velocity; None at a closure joint.
    sites: of the two frames of a closure joint; coordinate: which of its motions the velocity belongs to.
    """

    place: str
    requested: float
    size: float
    speed: int | None = None
    sign: float = 1.0
    sites: tuple[int, int] = (0, 0)
    coordinate: Coordinate | None = None

    def of(self, sites: np.ndarray, u: np.ndarray) -> float:
        """Return the velocity [m/s or rad/s] at free speeds u; sites: frames, named fields of SITE_FRAMES."""
        if self.speed is not None:
            return self.sign * float(u[self.speed])
        assert self.coordinate is not None
        return float(along(self.coordinate.gauge, (), *(frame_motion(sites[k]) for k in self.sites)).rate)


def given_rates(model: Model) -> list[Rate]:
    """Return all velocities of joints and modes that the scene gives, except those of driven coordinates."""
    return [*_rates_of_joints(model), *_rates_of_modes(model)]


def _rates_of_joints(model: Model) -> Iterator[Rate]:
    closures = model.arrays.table(m.CLOSURES)
    for start in given_coordinates(model.scene):
        if start.velocity is None:
            continue
        path, size = f"{start.place[:-1]}.velocity]", 1.0 if start.coordinate.turning else model.length
        for i, link in enumerate(model.links):
            edge = link.branch.edge
            if edge is not None and edge.name == start.joint and not link.drives:
                numbers = dict(zip(link.joint.positions, model.numbering.coordinates[i], strict=True))
                if start.number in numbers:
                    yield Rate(path, start.velocity, size, numbers[start.number], link.joint.sign)
        for row, closure in zip(closures, model.closures, strict=True):
            if closure.name == start.joint:
                sites = int(row["site_a"]), int(row["site_b"])
                yield Rate(path, start.velocity, size, sites=sites, coordinate=start.coordinate)


def _rates_of_modes(model: Model) -> Iterator[Rate]:
    bundles = {link.flexible: link.bundle for link in model.links if link.flexible and link.bundle is not None}
    for name, values in given_modes(model.scene, bundles, "velocity").items():
        for c, value in zip(model.numbering.modal_coordinates[model.mechanism.link_of[name]], values, strict=True):
            yield Rate(f"[start.modal.{name}.velocity]", float(value), float(model.speed_scales[c]), c)


@dataclass(frozen=True)
class Velocities:
    """Linear equations matrix @ speeds = target of the speeds at the start, in natural units; (rows, nv), (rows,).

    asked: requested velocities, from which the target results by subtracting those of the drives, (rows,).
    given: key paths of the velocities that the first `n_given` rows set; the other rows keep the loops closed.
    fastest: largest of these velocities, plus that of a slow motion.
    """

    matrix: np.ndarray
    asked: np.ndarray
    target: np.ndarray
    n_given: int
    given: tuple[str, ...]
    fastest: float


def velocity_equations(model: Model, motion: Motions, y: np.ndarray) -> Velocities:
    """Return the linear equations that bodies, joints, modes and closures impose on the speeds in a state."""
    requested, others = with_velocities(model), given_rates(model)
    y = y.copy()
    y[model.speeds] = 0.0
    given, centres = _given_velocities(requested).ravel(), [centre_of(model, name) for name in requested]
    known = ~np.isnan(given)

    unit, L = model.speed_scales, model.length
    lengths = np.tile(_units(model), len(requested))[known]
    opening_lengths = np.where(model.arrays.table(m.CLOSURE_ROWS)["kind"] == 0, L, 1.0)

    def rates(state: np.ndarray) -> np.ndarray:
        frames, sites, opening = motion(state)
        q, u = state[: model.nq], state[model.speeds]
        moving = np.array([centre.motion(frames, q, u) for centre in centres])
        coordinates = [rate.of(sites, u) / rate.size for rate in others]
        return np.concatenate([moving.ravel()[known] / lengths, coordinates, opening / opening_lengths])

    base = rates(y)
    columns = []
    for k in range(model.nv):
        moved = y.copy()
        moved[model.nq + k] = unit[k]
        columns.append(rates(moved) - base)
    asked = np.concatenate([given[known] / lengths, [rate.requested / rate.size for rate in others]])
    count = len(asked)
    asked = np.concatenate([asked, np.zeros(len(base) - count)])
    fastest = _slow(model) + max(float(np.max(np.abs(values), initial=0.0)) for values in (asked, base))
    matrix = np.array(columns).T.reshape(len(base), model.nv)
    places = [*(f"[body.{name}.velocity]" for name in requested), *dict.fromkeys(rate.place for rate in others)]
    return Velocities(matrix, asked, asked - base, count, tuple(places), fastest)


def given_velocities(model: Model, motion: Motions, y: np.ndarray, fraction: float = WRONG) -> np.ndarray:
    """Return y with speeds that give bodies, joints and modes their velocities and keep the loops closed.

    A body's velocity is that of its centre of mass, for flexible and rigid bodies.  Flexible bodies start without modal
    speeds if joints, drives and given velocities allow that.  Speeds that these leave open are the least; next to given
    velocities of bodies, those of the least kinetic energy, as impulses on these bodies cause (Kelvin's theorem).
    fraction: largest error of the nearest speeds that joints and drives allow, relative to the largest given velocity.
    Raises InputError when the error is larger.
    """
    elastic = np.zeros(model.nv, dtype=bool)
    for modes in model.numbering.modal_coordinates.values():
        elastic[modes] = True
    others = given_rates(model)
    if not with_velocities(model) and not others and not elastic.any():
        return y
    elastic[[rate.speed for rate in others if rate.speed is not None]] = False
    equations = velocity_equations(model, motion, y)
    speeds, miss = _least_speeds(equations.matrix * ~elastic, equations.target)
    if miss > RIGID * equations.fastest:
        speeds, miss = _least_speeds(equations.matrix, equations.target)
    largest = float(np.max(np.abs(equations.asked), initial=0.0))
    if equations.given and miss > max(INPUT_DIGITS * equations.fastest, fraction * largest):
        names = ", ".join(path.removeprefix("[body.").removesuffix(".velocity]") for path in equations.given)
        raise InputError(
            equations.given[0],
            f"joints and drives do not allow the given velocities of {names} (the error is "
            f"{miss:.3g} of the mechanism's size, or radians, per second; up to {100.0 * fraction:g} % of the "
            "largest one is corrected)",
            "give consistent velocities, or fewer of them",
        )
    if with_velocities(model):
        rigid = np.flatnonzero(~elastic)
        left = _undetermined_speeds(equations.matrix[:, rigid])
        drives, roots = _energy_roots(model, motion, y, rigid)
        moving = drives + roots @ speeds[rigid]
        change = _least_speeds(roots @ left, moving)[0]
        if np.linalg.norm(roots @ left @ change) > RIGID * np.linalg.norm(moving):
            speeds[rigid] -= left @ change
    y = y.copy()
    y[model.speeds] = model.speed_scales * speeds
    return y


def _undetermined_speeds(matrix: np.ndarray) -> np.ndarray:
    """Return the speeds that equations with this matrix leave open, as orthonormal columns."""
    _, values, ways = np.linalg.svd(matrix)
    return np.asarray(ways[int(np.sum(values > REDUNDANT * values.max(initial=0.0))) :].T)


def _energy_roots(model: Model, motion: Motions, y: np.ndarray, speeds: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return numbers whose squares add up to twice the kinetic energy: by the drives, and per natural unit of speeds.

    speeds: indices of the free coordinates.  Links count as undeformed.  Shapes (6 links,), (6 links, speeds).
    """
    inertias = [(i, link.undeformed) for i, link in enumerate(model.links) if link.undeformed is not None]
    principal = [np.linalg.eigh(inertia.moments) for _, inertia in inertias]

    def roots(speed: int | None) -> np.ndarray:
        state, parts = y.copy(), list[np.ndarray]()
        state[model.speeds] = 0.0
        if speed is not None:
            state[model.nq + speed] = model.speed_scales[speed]
        frames, *_ = motion(state)
        for (i, inertia), (moments, axes) in zip(inertias, principal, strict=True):
            velocity, spin = (frames[i]["axes"].T @ frames[i][name] for name in ("velocity", "omega"))
            parts.append(inertia.mass**0.5 * (velocity + np.cross(spin, inertia.com)))
            parts.append(np.sqrt(np.maximum(moments, 0.0)) * (axes.T @ spin))
        return np.concatenate(parts)

    drives = roots(None)
    return drives, np.array([roots(k) - drives for k in speeds]).reshape(len(speeds), len(drives)).T


def with_velocities(model: Model) -> dict[str, RigidBody | FlexibleBody]:
    """Return the bodies to which the scene gives velocities, by name."""
    return {
        name: body
        for name, body in model.scene.body.items()
        if not isinstance(body, (Ground, MeshedRigidBody))
        and (body.velocity is not None or body.angular_velocity is not None)
    }


def changed_velocities(model: Model, frames: np.ndarray, sites: np.ndarray, y: np.ndarray) -> list[str]:
    """Return sentences that list bodies, joints and modes whose start velocities differ from the scene's, with amounts.

    y: state at the start.  frames, sites: of all links and sites there, named fields of LINK_FRAMES and SITE_FRAMES.
    """
    requested, changes, unit = with_velocities(model), [], _units(model)
    given = _given_velocities(requested)
    limit = INPUT_DIGITS * (_slow(model) + float(np.nanmax(np.abs(given / unit), initial=0.0)))
    for name, row in zip(requested, given, strict=True):
        change = np.abs(centre_of(model, name).motion(frames, y[: model.nq], y[model.speeds]) - row)
        if np.nanmax(change / unit) > limit:
            turning, moving = np.fmax.reduce(change.reshape(2, 3), axis=1, initial=0.0)
            changes.append(
                f"the start velocities given for {name} were corrected to satisfy joints and drives, by up to "
                f"{moving:.3g} m/s and {turning:.3g} rad/s"
            )
    for rate in given_rates(model):
        change = abs(rate.of(sites, y[model.speeds]) - rate.requested)
        if change > INPUT_DIGITS * (_slow(model) * rate.size + abs(rate.requested)):
            changes.append(
                f"the start velocity {rate.place} was corrected to satisfy joints and drives, by {change:.3g}"
            )
    return changes


def changed_positions(model: Model, y: np.ndarray, z: np.ndarray) -> list[str]:
    """Return sentences that list the modes which start otherwise in state z than in y, which has the scene's values.

    Raises InputError where the difference is large.
    """
    changes = []
    for i, q in model.mechanism.deformation.items():
        mine, name = model.numbering.modal_positions[i], model.links[i].flexible
        change, largest = float(np.max(np.abs(z[mine] - y[mine]))), float(np.max(np.abs(q), initial=0.0))
        unit = model.length * model.links[i].mass ** 0.5
        if change > max(INPUT_DIGITS * unit, WRONG * largest):
            raise InputError(
                f"[start.modal.{name}.coordinate]",
                f"joints and drives do not allow this deformation: they change it by {change:.3g} m",
                "give another one, or use a joint with more freedom",
            )
        if change > INPUT_DIGITS * max(largest, INPUT_DIGITS * unit):
            changes.append(
                f"the deformation given for {name} was corrected to satisfy joints and drives, by up to {change:.3g} m"
            )
    return changes


def _given_velocities(requested: dict[str, RigidBody | FlexibleBody]) -> np.ndarray:
    """Return angular velocity and velocity given for each body, shape (bodies, 6); nan where none is given."""
    given = [_components(b.angular_velocity) + _components(b.velocity) for b in requested.values()]
    return np.array(given).reshape(-1, 6)


def _units(model: Model) -> np.ndarray:
    """Return the natural units of angular and linear velocity: radians, and the mechanism's size; shape (6,)."""
    return np.array([1.0] * 3 + [model.length] * 3)


def _slow(model: Model) -> float:
    """Return the rate of a slow motion [1/s]: a radian, or the mechanism's size, in the time of the whole run."""
    return 1.0 / (model.scene.time.end - model.scene.time.start)


def _least_speeds(matrix: np.ndarray, target: np.ndarray) -> tuple[np.ndarray, float]:
    """Return the least speeds that come nearest to the target, and their largest error; all in natural units."""
    speeds, *_ = np.linalg.lstsq(matrix, target, rcond=REDUNDANT)
    return speeds, float(np.max(np.abs(matrix @ speeds - target), initial=0.0))


def _components(given: tuple[float, float, float] | None) -> list[float]:
    return [np.nan] * 3 if given is None else list(given)


@dataclass(frozen=True)
class Centre:
    """Centre of mass of a body; place: its position in the frame of its link, undeformed.

    shape, second: its displacement with the modal coordinates, as in `flexible_bodies.shift`.  positions, speeds:
    indices of these coordinates among the free ones.
    """

    link: int
    place: np.ndarray
    shape: np.ndarray
    second: np.ndarray | None = None
    positions: range = range(0)
    speeds: range = range(0)

    def motion(self, frames: np.ndarray, q: np.ndarray, u: np.ndarray) -> np.ndarray:
        """Return angular velocity of the body and velocity of its centre of mass, world axes, shape (6,)."""
        frame, bent, bending = frames[self.link], q[None, self.positions], u[None, self.speeds]
        moved, rate, _ = shift(self.shape, self.second, bent, bending, np.zeros_like(bent))
        arm = frame["axes"] @ (self.place + moved[0])
        v = frame["velocity"] + np.cross(frame["omega"], arm) + frame["axes"] @ rate[0]
        return np.concatenate([frame["omega"], v])


def centre_of(model: Model, name: str) -> Centre:
    """Return the centre of mass of a body, with its dependence on the modal coordinates."""
    i, body = model.mechanism.link_of[name], model.scene.body[name]
    link = model.links[i]
    if isinstance(body, RigidBody):
        placement = link.placements[name]
        return Centre(i, placement.p + placement.R @ np.array(body.com), np.zeros((3, 0)))
    assert link.bundle is not None
    first, shape = (link.bundle[key].values / link.mass for key in ("first_moment", "modal_first_moment"))
    form, numbering = second_first_moment(model.mechanism, i), model.numbering
    second = None if form is None else form / link.mass
    return Centre(i, first, shape, second, numbering.modal_positions[i], numbering.modal_coordinates[i])


def start_internal(model: Model, y: np.ndarray, sites: np.ndarray) -> np.ndarray:
    """Return y with the internal states of parts at their start values; sites: frames at y, rows of SITE_FRAMES."""
    y, first = y.copy(), model.ny - model.arrays.size(m.N_INTERNAL)
    for index, angle in angles(model.arrays.table(m.GAUGES), sites).items():
        y[first + index] = angle
    for index, states in of_effects(model, sites, np.zeros(model.ny - first)).items():
        y[first + index : first + index + len(states)] = states
    return y


def of_effects(model: Model, sites: np.ndarray, internal: np.ndarray) -> dict[int, np.ndarray]:
    """Return the internal states of effects from all sites' frames and previous states, by the index of the first."""
    states = dict[int, np.ndarray]()
    for follow in model.parts.functions(STATES):
        states |= follow(model, sites, internal)
    return states
