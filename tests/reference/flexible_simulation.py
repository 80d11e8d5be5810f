r"""Flexible rod 1 and clearance at A1: a second derivation, by sums over mass points.

Frame of leg 1: origin B1, z along the cylinder.  A point of the rod is at
:math:`r = h(t)e_z + X + S q` there, h being driven, and accelerates by

.. math:: \dot\omega\times r + S\ddot q + \omega\times(\omega\times r)
          + 2\omega\times(\dot h e_z + S\dot q) + \ddot h e_z .

Summed with the masses against the speeds of the points (Kane), with the lower bodies turning with
the frame and the upper ball on the rod's end, this gives the 3 + n equations of the leg; the
platform is `clearance_platform`.
"""

from __future__ import annotations

import json
from dataclasses import dataclass

import numpy as np

from tests.reference import clearance_run, sps4
from tests.reference.clearance_contact import Touch, press
from tests.reference.clearance_platform import Setting, platform_motion, setting, socket_acceleration
from tests.reference.ideal_motion import Motion, cross, exponential, skew
from tests.reference.rod_basis import LENGTH, Rod, rod

Array = np.ndarray
#: lower end of the rod below A, and stem of the upper ball [m]
BELOW, STEM = 0.28, 0.04


@dataclass(frozen=True)
class Leg:
    """Constants of the flexible leg in its frame.

    ball: from the rod's lower end to the upper ball's centre (3,); ball_shape: its displacement per coordinate (3, n).
    masses, places, shapes: of all points, the ball's centre of mass last; (points,), (points, 3), (3 points, n).
    """

    rod: Rod
    ball: Array
    ball_shape: Array
    masses: Array
    places: Array
    shapes: Array
    modal_mass: Array


def leg() -> Leg:
    """Leg 1 of the paper."""
    r = rod()
    end = np.array([0.0, 0.0, LENGTH])
    stem, centre = np.array([0.0, 0.0, STEM]), np.array([0.0, 0.0, STEM - sps4.BALL_CENTRE])
    # a point fixed to the rod's end moves by the end's displacement and rotation
    ball_shape = r.tip_shape - skew(stem) @ r.tip_turn
    mass_shape = r.tip_shape - skew(centre) @ r.tip_turn
    masses = np.append(r.mass, sps4.BALL.mass)
    shapes = np.concatenate([r.shape, mass_shape[None]])
    modal_mass = np.einsum("p,pin,pim->nm", masses, shapes, shapes)
    places = np.vstack([r.place, end + centre])
    return Leg(r, end + stem, ball_shape, masses, places, shapes.reshape(-1, shapes.shape[2]), modal_mass)


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
    lengths, rates, accelerations = sps4.leg_lengths(t, side)
    w, a, b, c = y[2:6] / np.sqrt(y[2:6] @ y[2:6])
    v = np.array([a, b, c])
    R = (w * w - v @ v) * np.eye(3) + 2.0 * np.outer(v, v) + 2.0 * w * skew(v)
    return Now(R, y[6:9], y[9 : 9 + n], y[9 + n :], lengths[0] - BELOW, rates[0], accelerations[0])


def ball_motion(leg: Leg, x: Now) -> tuple[Array, Array, Array]:
    """The ball's centre from B1, its velocity, and the ball's angular velocity, leg axes."""
    r = leg.ball + leg.ball_shape @ x.q
    r[2] += x.end
    velocity = cross(x.omega, r) + leg.ball_shape @ x.q_rate
    velocity[2] += x.end_rate
    return r, velocity, x.omega + leg.rod.tip_turn @ x.q_rate


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
    r, n, points = leg.rod, len(x.q), len(leg.masses)
    places = leg.places + (leg.shapes @ x.q).reshape(points, 3)
    places[:, 2] += x.end
    relative = (leg.shapes @ x.q_rate).reshape(points, 3)
    relative[:, 2] += x.end_rate
    bias = cross(x.omega, cross(x.omega, places)) + 2.0 * cross(x.omega, relative)
    bias[:, 2] += x.end_acceleration
    bias *= leg.masses[:, None]
    weighted = leg.masses[:, None] * places
    turned = exponential(r.tip_turn @ x.q)
    J = turned @ np.diag([sps4.BALL.transverse, sps4.BALL.transverse, sps4.BALL.axial]) @ turned.T
    lower = np.diag([sps4.LOWER[2], sps4.LOWER[2], sps4.LOWER[3]])
    M = np.empty((3 + n, 3 + n))
    M[:3, :3] = np.sum(weighted * places) * np.eye(3) - weighted.T @ places + lower + J
    # side by side, the cross-product matrices of all points: a sum over points is one product
    M[:3, 3:] = skew_row(weighted) @ leg.shapes + J @ r.tip_turn
    M[3:, :3] = M[:3, 3:].T
    M[3:, 3:] = leg.modal_mass + r.tip_turn.T @ J @ r.tip_turn
    turning = r.tip_turn @ x.q_rate
    ball_omega = x.omega + turning
    ball_bias = J @ cross(x.omega, turning) + cross(ball_omega, J @ ball_omega)
    right = np.empty(3 + n)
    right[:3] = -cross(places, bias).sum(axis=0) - cross(x.omega, lower @ x.omega) - ball_bias
    right[3:] = -r.tip_turn.T @ ball_bias - r.stiffness @ x.q - bias.ravel() @ leg.shapes
    return M, right


def load(leg: Leg, arm: Array, reach: Array, force: Array) -> Array:
    """What a force on the ball adds to the right-hand side; leg axes, arm from B1, reach from the ball's centre."""
    modal = leg.ball_shape.T @ force + leg.rod.tip_turn.T @ cross(reach, force)
    return np.concatenate([cross(arm, force), modal])


def state_rate(y: Array, x: Now, second: float, accelerations: Array) -> Array:
    """Derivative of the state from the accelerations of the socket's distance, of the leg and of its modes."""
    w, v = y[2], y[3:6]
    turn = 0.5 * np.concatenate([[-v @ x.omega], w * x.omega + cross(v, x.omega)])
    return np.concatenate([[y[1], second], turn, accelerations[:3], x.q_rate, accelerations[3:]])


def start(n: int) -> Array:
    """Straight rod, ball concentric and at rest, shape (9 + 2n,); x of the leg's frame is horizontal."""
    d = np.array([0.0, 0.0, sps4.HEIGHT]) + sps4.A[0] - sps4.B[0]
    z = d / np.sqrt(d @ d)
    x = np.array([-d[1], d[0], 0.0]) / np.sqrt(d[0] ** 2 + d[1] ** 2)
    R = np.column_stack([x, cross(z, x), z])
    w = 0.5 * np.sqrt(1.0 + np.trace(R))
    v = np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]]) / (4.0 * w)
    return np.concatenate([[sps4.LENGTH, 0.0, w], v, np.zeros(3 + 2 * n)])


def mechanism(s: Setting) -> clearance_run.Mechanism:
    """The mechanism as functions of time and state."""
    one = leg()
    n = one.ball_shape.shape[1]

    def platform(t: float, side: int, y: Array) -> Motion:
        return platform_motion(s, t, side, y[0], y[1])

    def pressed(x: Now, m: Motion, latched: float | None) -> Touch:
        r, velocity, omega = ball_motion(one, x)
        offset, relative = x.R @ r - m.legs[0][0], x.R @ velocity - m.legs[1][0]
        return press(s.contact, offset, relative, x.R @ omega, m.omega, latched)

    def touch(t: float, side: int, y: Array, latched: float | None) -> Touch:
        return pressed(read(n, t, side, y), platform(t, side, y), latched)

    def rhs(side: int, latched: float | None) -> clearance_run.RightHandSide:
        def derivative(t: float, y: Array) -> Array:
            x, m = read(n, t, side, y), platform(t, side, y)
            now = pressed(x, m, latched)
            force, reach = x.R.T @ now.force, x.R.T @ now.reach
            arm = ball_motion(one, x)[0] + reach
            M, right = equations(one, x)
            accelerations = np.linalg.solve(M, right + load(one, arm, reach, force))
            second = socket_acceleration(s, t, side, y[0], y[1], m, sps4.B[0] + x.R @ arm, now.force)
            return state_rate(y, x, second, accelerations)

        return derivative

    return clearance_run.Mechanism(start(n), rhs, touch, platform, s.contact.floor)


def simulate(until: float, rtol: float = 1e-11) -> clearance_run.Result:
    """The paper's scene with the flexible rod, up to `until` [s]; chaotic beyond some tens of milliseconds."""
    tolerance = clearance_run.Tolerance(rtol=rtol, atol=1e-15, flight=5e-5, contact=5e-6)
    return clearance_run.simulate(mechanism(setting()), until, tolerance)


if __name__ == "__main__":
    # python -m tests.reference.flexible_simulation > tests/reference/far_csj_cb.json (some minutes)
    print(json.dumps(clearance_run.table(simulate(0.02), every=5), indent=1))
