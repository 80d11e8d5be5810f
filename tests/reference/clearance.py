r"""The mechanism with a clearance joint at A1: the contact, the platform, and runs from contact to contact.

The contact of a ball in a socket, for the second derivations.

Wang & Wang (2019), eqs. (21)-(29): both forces act at one point on the line of centres, on the
ball's surface; friction acts against the sliding of the material points there.

The platform on legs 2, 3 and 4, with leg 1 replaced by a contact force at the socket A1.

The distance :math:`\lambda` from B1 to the socket's centre and the driven lengths of the other legs
fix the platform.  Its six balances are linear in :math:`\ddot\lambda`, three axial leg forces and
two horizontal forces at C.

From contact to contact: runs with one clearance joint, events located, nothing shared with the engine.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.integrate import DOP853, OdeSolution
from scipy.optimize import brentq, minimize_scalar

from tests.reference import sps4
from tests.reference.contact_solutions import modified_coulomb
from tests.reference.ideal_motion import (
    UP,
    WEIGHTLESS,
    Motion,
    cross,
    ideal,
    leg_loads,
    motion,
    motion_at,
    platform_demand,
)

Array = np.ndarray


@dataclass(frozen=True)
class Touch:
    """The contact now: gap [m], rate of penetration [m/s], normal force [N], force on the ball.

    reach: from the ball's centre to the point where the forces act [m].
    """

    gap: float
    rate: float
    normal: float
    force: Array
    reach: Array


def press(
    c: sps4.Contact, offset: Array, velocity: Array, ball_omega: Array, socket_omega: Array, latched: float | None
) -> Touch:
    """Geometry and forces of the contact; without a latched impact rate [m/s] there is no force.

    offset, velocity: of the ball's centre relative to the socket's, world axes [m, m/s].
    """
    distance = np.sqrt(offset @ offset)
    if latched is None or distance == 0.0:
        rate = offset @ velocity / distance if distance > 0.0 else 0.0
        return Touch(c.clearance - distance, float(rate), 0.0, np.zeros(3), np.zeros(3))
    n = offset / distance
    rate = n @ velocity
    depth = max(0.0, distance - c.clearance)
    normal = max(0.0, c.stiffness * depth**1.5 * (1.0 + c.hysteresis * rate / latched))
    reach = c.ball_radius * n
    slip = velocity + cross(ball_omega, reach) - cross(socket_omega, offset + reach)
    slip = slip - (n @ slip) * n
    speed = np.sqrt(slip @ slip)
    force = -normal * n
    if speed > 0.0:
        mu = modified_coulomb(speed, c.mu_static, c.mu_dynamic, c.v_static, c.v_dynamic)
        force = force - normal * mu * slip / speed
    return Touch(c.clearance - distance, float(rate), float(normal), force, reach)


GRID = 1e-4


@dataclass(frozen=True)
class Setting:
    """What one run needs: contact data, platform, gravity, and ideal poses as guesses for Newton's method."""

    contact: sps4.Contact
    plate: sps4.Plate
    gravity: Array
    guesses: list[Motion]


def setting() -> Setting:
    """The paper's mechanism in the first layout, without weight."""
    times = np.arange(0.0, 0.18 + GRID / 2, GRID)
    guesses = ideal(sps4.FIRST, times, np.where(times < 0.18, 1, -1))
    return Setting(sps4.Contact(), sps4.platform(sps4.FIRST), WEIGHTLESS, guesses)


def platform_motion(s: Setting, t: float, side: int, distance: float, rate: float) -> Motion:
    """The platform's motion while the socket's distance from B1 has no second derivative."""
    guess = s.guesses[min(max(round(t / GRID), 0), len(s.guesses) - 1)]
    return motion(*_lengths(t, side, distance, rate, 0.0), guess)


def _lengths(t: float, side: int, distance: float, rate: float, second: float) -> tuple[Array, Array, Array]:
    lengths, rates, accelerations = sps4.leg_lengths(sps4.FIRST, t, side)
    lengths[0], rates[0], accelerations[0] = distance, rate, second
    return lengths, rates, accelerations


def demand(s: Setting, m: Motion) -> tuple[Array, Array, Array]:
    """Six balances of platform, legs 2..4 and central chain in the motion m; axes of and arms to legs 2..4."""
    legs = leg_loads(*(part[1:] for part in m.legs), s.gravity)
    arms = m.layout.A[1:] @ m.rotation.T
    force, moment = platform_demand(m, s.plate, s.gravity)
    force = force + legs.across_at_A.sum(axis=0) + sps4.CENTRAL_MASS * (m.acceleration - s.gravity[2]) * UP
    moment = moment + cross(arms, legs.across_at_A).sum(axis=0)
    return np.concatenate([force, moment]), legs.axis, arms


def socket_acceleration(
    s: Setting, t: float, side: int, distance: float, rate: float, m: Motion, point: Array, force: Array
) -> float:
    """Second derivative of the socket's distance from B1 [m/s^2].

    m: the motion with zero for it. force: on leg 1's ball by the socket, acting at `point`, world axes.
    """
    base, axes, arms = demand(s, m)
    # the demand is linear in the unknown: one more evaluation, at 1 m/s^2, gives its column
    faster = motion_at(m.layout, m.height, m.rotation, *_lengths(t, side, distance, rate, 1.0))
    matrix = np.zeros((6, 6))
    matrix[:, 0] = demand(s, faster)[0] - base
    matrix[:3, 1:4], matrix[3:, 1:4] = axes.T, cross(arms, axes).T
    matrix[0, 4] = matrix[1, 5] = 1.0
    applied = -np.concatenate([force, cross(point - m.height * UP, force)])
    return float(np.linalg.solve(matrix, applied - base)[0])


RightHandSide = Callable[[float, Array], Array]


@dataclass(frozen=True)
class Mechanism:
    """A mechanism as functions of time, side of a drive break, state, and latched impact rate (None in flight)."""

    start: Array
    rhs: Callable[[int, float | None], RightHandSide]
    touch: Callable[[float, int, Array, float | None], Touch]
    platform: Callable[[float, int, Array], Motion]
    floor: float


@dataclass(frozen=True)
class Impact:
    """A contact: times [s], approach and separation speed [m/s], largest normal force [N] and depth [m].

    One that is still open at the end of the run has neither end nor separation (nan).
    """

    start: float
    end: float
    approach: float
    separation: float
    peak_force: float
    depth: float


@dataclass(frozen=True)
class Result:
    """States on the output grid, shape (time, n), the platform's motion there, and all contacts."""

    time: Array
    state: Array
    platform: list[Motion]
    impacts: list[Impact]


@dataclass(frozen=True)
class Tolerance:
    """Relative and absolute tolerance; longest step in flight and in contact [s]."""

    rtol: float = 1e-11
    atol: float = 1e-15
    flight: float = 1e-4
    contact: float = 2e-5


@dataclass(frozen=True)
class Stretch:
    """Motion between two events: its end, whether the gap changed sign there, and a way to ask for states."""

    start: float
    end: float
    state: Array
    event: bool
    states: OdeSolution


def advance(rhs: RightHandSide, t: float, y: Array, end: float, tol: Tolerance) -> Array:
    """State at `end` from (t, y), no events watched."""
    if end <= t:
        return y
    solver = DOP853(rhs, t, y, end, rtol=tol.rtol, atol=tol.atol, first_step=end - t)
    while solver.status == "running":
        solver.step()
    return solver.y


def integrate(
    m: Mechanism, t: float, y: Array, end: float, side: int, latched: float | None, tol: Tolerance
) -> Stretch:
    """Integrate until the gap changes sign or `end` is reached."""
    rhs = m.rhs(side, latched)
    longest = tol.flight if latched is None else tol.contact
    solver = DOP853(rhs, t, y, end, rtol=tol.rtol, atol=tol.atol, max_step=longest, first_step=min(1e-7, end - t))
    away = 1.0 if latched is None else -1.0
    times, pieces = [t], []
    while solver.status == "running":
        before, y_before = solver.t, solver.y.copy()
        solver.step()
        pieces.append(solver.dense_output())
        times.append(solver.t)
        # the first step leaves the event itself, where the sign is that of rounding
        if len(pieces) > 1 and away * m.touch(solver.t, side, solver.y, None).gap < 0.0:
            dense = pieces[-1]

            def gap(x: float, f: Callable[[float], Array] = dense) -> float:
                return m.touch(x, side, f(x), None).gap

            times[-1] = brentq(gap, before, solver.t, xtol=1e-17, rtol=1e-15)
            y = advance(rhs, before, y_before, times[-1], tol)
            return Stretch(t, times[-1], y, True, OdeSolution(times, pieces))
    return Stretch(t, end, solver.y, False, OdeSolution(times, pieces))


def largest(f: Callable[[float], float], times: Array) -> float:
    """Maximum of a smooth function that has one hump near its largest sample."""
    k = int(np.argmax([f(t) for t in times]))
    bounds = (times[max(k - 1, 0)], times[min(k + 1, len(times) - 1)])
    # a maximum is flat: 1e-4 of the bracket in time is 1e-8 of the height
    options = {"xatol": 1e-4 * (bounds[1] - bounds[0])}
    return float(-minimize_scalar(lambda t: -f(t), bounds=bounds, method="bounded", options=options).fun)


def with_peak(m: Mechanism, impact: Impact, piece: Stretch, side: int, latched: float) -> Impact:
    """The impact with the largest force and depth of one more stretch of contact."""

    def at(t: float) -> Touch:
        return m.touch(t, side, piece.states(t), latched)

    times = np.linspace(piece.start, piece.end, 40)
    force, depth = largest(lambda t: at(t).normal, times), largest(lambda t: -at(t).gap, times)
    return replace(impact, peak_force=max(impact.peak_force, force), depth=max(impact.depth, depth))


def simulate(m: Mechanism, until: float = 0.18, tol: Tolerance | None = None) -> Result:
    """Run from the start to `until` [s] <= 0.18."""
    tol = tol or Tolerance()
    y, t, latched = m.start, 0.0, None
    samples: list[tuple[float, Array]] = [(0.0, y)]
    impacts: list[Impact] = []
    while t < until:
        # right-hand values at 0, left-hand ones at 0.18 s; at 0.09 s only the jerk differs
        side = 1 if t < 0.09 else -1
        piece = integrate(m, t, y, min(until, 0.09 if t < 0.09 else 0.18), side, latched, tol)
        grid = [k * GRID for k in range(int(t / GRID + 1e-6) + 1, int(piece.end / GRID + 1e-6) + 1)]
        samples += [(x, piece.states(x)) for x in grid]
        if latched is not None:
            impacts[-1] = with_peak(m, impacts[-1], piece, side, latched)
        t, y = piece.end, piece.state
        if not piece.event:
            continue
        rate = m.touch(t, side, y, None).rate
        if latched is None:
            latched = max(rate, m.floor)
            impacts.append(Impact(t, np.nan, rate, np.nan, 0.0, 0.0))
        else:
            impacts[-1] = replace(impacts[-1], end=t, separation=-rate)
            latched = None
    time, state = np.array([x for x, _ in samples]), np.array([y for _, y in samples])
    platform = [m.platform(x, 1 if x < 0.18 else -1, y) for x, y in samples]
    return Result(time, state, platform, impacts)


def table(result: Result, every: int = 10) -> dict[str, list[float]]:
    """The numbers stored for comparison: the impacts, and the platform on each `every`-th grid point."""
    columns = {f"impact_{name}": [getattr(i, name) for i in result.impacts] for name in Impact.__dataclass_fields__}
    columns["time"] = result.time[::every].tolist()
    for name in ("height", "speed", "tilt"):
        columns[name] = [float(getattr(m, name)) for m in result.platform[::every]]
    columns["rotation"] = [m.rotation.ravel().tolist() for m in result.platform[::every]]
    return columns
