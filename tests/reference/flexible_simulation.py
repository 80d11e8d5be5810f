r"""Flexible rod 1 and clearance at A1: a second derivation, by sums over mass points.

Frame of leg 1: origin B1, z along the cylinder.  A point of the rod is at
:math:`r = h(t)e_z + X + S q` there, h being driven, and accelerates by

.. math:: \dot\omega\times r + S\ddot q + \omega\times(\omega\times r)
          + 2\omega\times(\dot h e_z + S\dot q) + \ddot h e_z .

Summed with the masses against the speeds of the points (Kane), with the lower bodies turning with
the frame and the upper ball on the rod's end, this gives the 3 + n equations of the leg; the
platform is `clearance`.
"""

import json
from dataclasses import dataclass

import numpy as np

from tests.reference import clearance, sps4
from tests.reference.clearance import Setting, Touch, platform_motion, press, setting, socket_acceleration
from tests.reference.ideal_motion import Motion, cross, exponential, skew
from tests.reference.rod_basis import LENGTH, Rod, rod

Array = np.ndarray
#: lower end of the rod below A, and stem of the upper ball [m]
BELOW, STEM = 0.28, 0.04


@dataclass(frozen=True)
class Leg:
    """Constants of the flexible leg in its frame: the rod, its shapes as (3 points, n), its modal mass (n, n)."""

    rod: Rod
    shapes: Array
    modal_mass: Array


def leg() -> Leg:
    """Leg 1 of the paper."""
    r = rod()
    modal_mass = np.einsum("p,pin,pim->nm", r.mass, r.shape, r.shape)
    return Leg(r, r.shape.reshape(-1, r.shape.shape[2]), modal_mass)


@dataclass(frozen=True)
class Now:
    """Leg 1 at one instant: rotation leg -> world, angular velocity (leg axes), modal state, driven end."""

    R: Array
    omega: Array
    q: Array
    q_rate: Array
    end: float
    end_rate: float
    end_acceleration: float


def read(n: int, t: float, side: int, y: Array) -> Now:
    """Leg 1 in the state y = (lambda, rate, quaternion, omega, q, q')."""
    lengths, rates, accelerations = sps4.leg_lengths(sps4.FIRST, t, side)
    w, a, b, c = y[2:6] / np.sqrt(y[2:6] @ y[2:6])
    v = np.array([a, b, c])
    R = (w * w - v @ v) * np.eye(3) + 2.0 * np.outer(v, v) + 2.0 * w * skew(v)
    return Now(R, y[6:9], y[9 : 9 + n], y[9 + n :], lengths[0] - BELOW, rates[0], accelerations[0])


@dataclass(frozen=True)
class Carried:
    """A point of the upper ball in leg axes: place from B1, velocity, speed per modal rate (3, n), and bias.

    bias: its acceleration while angular and modal accelerations are zero.
    """

    place: Array
    velocity: Array
    shape: Array
    bias: Array


@dataclass(frozen=True)
class Turn:
    """How the upper ball turns against the leg: rotation, angular velocity, and that per modal rate (3, n)."""

    rotation: Array
    omega: Array
    shape: Array


def ball_turn(leg: Leg, x: Now) -> Turn:
    """The rod's end turns by exp(theta), theta = tip_turn q.

    Angular velocity to second order in theta, which is below 1e-2: theta' + theta x theta' / 2.
    """
    theta = leg.rod.tip_turn @ x.q
    shape = leg.rod.tip_turn + 0.5 * skew(theta) @ leg.rod.tip_turn
    return Turn(exponential(theta), shape @ x.q_rate, shape)


def carried(leg: Leg, x: Now, turn: Turn, reach: float) -> Carried:
    """The point on the ball's axis `reach` [m] above the rod's end."""
    lever = turn.rotation @ np.array([0.0, 0.0, reach])
    place = leg.rod.tip_shape @ x.q + lever
    place[2] += x.end + LENGTH
    shape = leg.rod.tip_shape - skew(lever) @ turn.shape
    relative = shape @ x.q_rate
    relative[2] += x.end_rate
    bias = cross(x.omega, cross(x.omega, place)) + 2.0 * cross(x.omega, relative)
    bias += cross(turn.omega, cross(turn.omega, lever))
    bias[2] += x.end_acceleration
    return Carried(place, cross(x.omega, place) + relative, shape, bias)


def skew_row(vectors: Array) -> Array:
    """Cross-product matrices of vectors (points, 3) side by side, shape (3, 3 points)."""
    row = np.zeros((3, len(vectors), 3))
    x, y, z = vectors.T
    row[0, :, 1], row[0, :, 2], row[1, :, 0] = -z, y, z
    row[1, :, 2], row[2, :, 0], row[2, :, 1] = -x, -y, x
    return row.reshape(3, -1)


def equations(leg: Leg, x: Now) -> tuple[Array, Array]:
    """Mass matrix and right-hand side of the leg's angular and modal accelerations without a force on the ball.

    Leg axes; shapes (3 + n, 3 + n) and (3 + n,).
    """
    r, n, points = leg.rod, len(x.q), len(leg.rod.mass)
    turn = ball_turn(leg, x)
    ball = carried(leg, x, turn, STEM - sps4.BALL_CENTRE)
    places = r.place + (leg.shapes @ x.q).reshape(points, 3)
    places[:, 2] += x.end
    relative = (leg.shapes @ x.q_rate).reshape(points, 3)
    relative[:, 2] += x.end_rate
    bias = cross(x.omega, cross(x.omega, places)) + 2.0 * cross(x.omega, relative)
    bias[:, 2] += x.end_acceleration
    bias *= r.mass[:, None]
    weighted = r.mass[:, None] * places
    J = turn.rotation @ np.diag([sps4.BALL.transverse, sps4.BALL.transverse, sps4.BALL.axial]) @ turn.rotation.T
    lower = np.diag([sps4.LOWER[2], sps4.LOWER[2], sps4.LOWER[3]])
    weight = sps4.BALL.mass
    arm = skew(ball.place)
    M = np.empty((3 + n, 3 + n))
    M[:3, :3] = np.sum(weighted * places) * np.eye(3) - weighted.T @ places + lower + J - weight * arm @ arm
    # side by side, the cross-product matrices of all points: a sum over points is one product
    M[:3, 3:] = skew_row(weighted) @ leg.shapes + J @ turn.shape + weight * arm @ ball.shape
    M[3:, :3] = M[:3, 3:].T
    M[3:, 3:] = leg.modal_mass + turn.shape.T @ J @ turn.shape + weight * ball.shape.T @ ball.shape
    ball_omega = x.omega + turn.omega
    spin = J @ cross(x.omega, turn.omega) + cross(ball_omega, J @ ball_omega)
    right = np.empty(3 + n)
    right[:3] = -cross(places, bias).sum(axis=0) - cross(x.omega, lower @ x.omega) - spin - weight * arm @ ball.bias
    right[3:] = -bias.ravel() @ leg.shapes - turn.shape.T @ spin - weight * ball.bias @ ball.shape - r.stiffness @ x.q
    return M, right


def load(turn: Turn, ball: Carried, reach: Array, force: Array) -> Array:
    """What a force on the ball adds to the right-hand side; leg axes, `reach` from the ball's centre."""
    modal = ball.shape.T @ force + turn.shape.T @ cross(reach, force)
    return np.concatenate([cross(ball.place + reach, force), modal])


def state_rate(y: Array, x: Now, second: float, accelerations: Array) -> Array:
    """Derivative of the state from the accelerations of the socket's distance, of the leg and of its modes."""
    w, v = y[2], y[3:6]
    turn = 0.5 * np.concatenate([[-v @ x.omega], w * x.omega + cross(v, x.omega)])
    return np.concatenate([[y[1], second], turn, accelerations[:3], x.q_rate, accelerations[3:]])


def start(n: int) -> Array:
    """Straight rod, ball concentric and at rest, shape (9 + 2n,); x of the leg's frame is horizontal."""
    d = np.array([0.0, 0.0, sps4.FIRST.height]) + sps4.FIRST.A[0] - sps4.FIRST.B[0]
    z = d / np.sqrt(d @ d)
    x = np.array([-d[1], d[0], 0.0]) / np.sqrt(d[0] ** 2 + d[1] ** 2)
    R = np.column_stack([x, cross(z, x), z])
    w = 0.5 * np.sqrt(1.0 + np.trace(R))
    v = np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]]) / (4.0 * w)
    return np.concatenate([[sps4.FIRST.length, 0.0, w], v, np.zeros(3 + 2 * n)])


def mechanism(s: Setting) -> clearance.Mechanism:
    """The mechanism as functions of time and state."""
    one = leg()
    n = one.shapes.shape[1]

    def platform(t: float, side: int, y: Array) -> Motion:
        return platform_motion(s, t, side, y[0], y[1])

    def pressed(x: Now, turn: Turn, ball: Carried, m: Motion, latched: float | None) -> Touch:
        offset, relative = x.R @ ball.place - m.legs[0][0], x.R @ ball.velocity - m.legs[1][0]
        return press(s.contact, offset, relative, x.R @ (x.omega + turn.omega), m.omega, latched)

    def touch(t: float, side: int, y: Array, latched: float | None) -> Touch:
        x = read(n, t, side, y)
        turn = ball_turn(one, x)
        return pressed(x, turn, carried(one, x, turn, STEM), platform(t, side, y), latched)

    def rhs(side: int, latched: float | None) -> clearance.RightHandSide:
        def derivative(t: float, y: Array) -> Array:
            x, m = read(n, t, side, y), platform(t, side, y)
            turn = ball_turn(one, x)
            ball = carried(one, x, turn, STEM)
            now = pressed(x, turn, ball, m, latched)
            M, right = equations(one, x)
            force, reach = x.R.T @ now.force, x.R.T @ now.reach
            accelerations = np.linalg.solve(M, right + load(turn, ball, reach, force))
            point = sps4.FIRST.B[0] + x.R @ (ball.place + reach)
            return state_rate(y, x, socket_acceleration(s, t, side, y[0], y[1], m, point, now.force), accelerations)

        return derivative

    return clearance.Mechanism(start(n), rhs, touch, platform, s.contact.floor)


def simulate(until: float, rtol: float = 1e-11) -> clearance.Result:
    """The paper's scene with the flexible rod, up to `until` [s]; chaotic beyond some tens of milliseconds."""
    tolerance = clearance.Tolerance(rtol=rtol, atol=1e-15, flight=5e-5, contact=5e-6)
    return clearance.simulate(mechanism(setting()), until, tolerance)


if __name__ == "__main__":
    # python -m tests.reference.flexible_simulation > tests/reference/far_csj_cb.json (some minutes)
    print(json.dumps(clearance.table(simulate(0.02), every=5), indent=1))
