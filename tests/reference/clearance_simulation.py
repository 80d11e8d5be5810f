r"""The mechanism with clearance at A1 and rigid rods, in minimal form: a second derivation.

Coordinates: :math:`\lambda`, the distance from B1 to the socket's centre A1, which with the driven
lengths of legs 2, 3, 4 fixes the platform; the axis u of leg 1, its rate and its spin.  Leg 1 is a
round body turning about B1 whose length is driven, so with :math:`I(l)` its transverse moment
about B1 and M the moment of the contact force there,

.. math:: I\,u\times\ddot u = M_\perp - \dot I\,u\times\dot u - I_a\,\sigma\,\dot u,
          \qquad I_a\,\dot\sigma = M\cdot u .
"""

import json

import numpy as np

from tests.reference import clearance, sps4
from tests.reference.clearance import Setting, Touch, platform_motion, press, setting, socket_acceleration
from tests.reference.ideal_motion import Motion, cross, leg_inertia

Array = np.ndarray
#: moment of inertia of a leg about its axis [kg m^2]
AXIAL = sps4.LOWER[3] + sps4.UPPER[3]


def axis(y: Array) -> tuple[Array, Array]:
    """Axis of leg 1 and its rate in the state y = (lambda, rate, u, u', spin), kept unit and perpendicular."""
    u = y[2:5] / np.sqrt(y[2:5] @ y[2:5])
    return u, y[5:8] - (u @ y[5:8]) * u


def start() -> Array:
    """Ball concentric with its socket and at rest, shape (9,)."""
    d = np.array([0.0, 0.0, sps4.FIRST.height]) + sps4.FIRST.A[0] - sps4.FIRST.B[0]
    return np.concatenate([[sps4.FIRST.length, 0.0], d / np.sqrt(d @ d), np.zeros(4)])


def mechanism(s: Setting) -> clearance.Mechanism:
    """The mechanism as functions of time and state."""

    def platform(t: float, side: int, y: Array) -> Motion:
        return platform_motion(s, t, side, y[0], y[1])

    def pressed(t: float, side: int, y: Array, m: Motion, latched: float | None) -> Touch:
        lengths, rates, _ = sps4.leg_lengths(sps4.FIRST, t, side)
        u, u_rate = axis(y)
        velocity = rates[0] * u + lengths[0] * u_rate - m.legs[1][0]
        return press(s.contact, lengths[0] * u - m.legs[0][0], velocity, cross(u, u_rate) + y[8] * u, m.omega, latched)

    def touch(t: float, side: int, y: Array, latched: float | None) -> Touch:
        return pressed(t, side, y, platform(t, side, y), latched)

    def rhs(side: int, latched: float | None) -> clearance.RightHandSide:
        def derivative(t: float, y: Array) -> Array:
            m = platform(t, side, y)
            now = pressed(t, side, y, m, latched)
            lengths, rates, _ = sps4.leg_lengths(sps4.FIRST, t, side)
            u, u_rate = axis(y)
            arm = lengths[0] * u + now.reach
            about_B, slope, weight_arm = leg_inertia(lengths[0])
            moment = cross(arm, now.force) + weight_arm * cross(u, s.gravity)
            along = u @ moment
            turned = moment - along * u - slope * rates[0] * cross(u, u_rate) - AXIAL * y[8] * u_rate
            out = np.empty(9)
            out[0] = y[1]
            out[1] = socket_acceleration(s, t, side, y[0], y[1], m, sps4.FIRST.B[0] + arm, now.force)
            out[2:5], out[8] = u_rate, along / AXIAL
            out[5:8] = cross(turned / about_B, u) - (u_rate @ u_rate) * u
            return out

        return derivative

    return clearance.Mechanism(start(), rhs, touch, platform, s.contact.floor)


def simulate(until: float = 0.18, rtol: float = 1e-11) -> clearance.Result:
    """The paper's scene: weightless, baseline platform."""
    return clearance.simulate(mechanism(setting()), until, clearance.Tolerance(rtol=rtol))


if __name__ == "__main__":
    # python -m tests.reference.clearance_simulation > tests/reference/csj.json (two to three minutes)
    result = simulate(rtol=1e-12)
    spin = {"spin": result.state[::10, 8].tolist()}
    print(json.dumps(clearance.table(result) | spin, indent=1))
