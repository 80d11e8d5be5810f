"""Motion of the bodies and frames that a scene names, from that of the links that carry them, for the record.

Kernels store each quantity of all rows of the record contiguously, as datasets have it.
"""

from __future__ import annotations

import numpy as np

from flexclear.dynamics.equations.tuples import (
    add,
    at6,
    cross,
    product,
    put,
    scale,
    to_quaternion,
    turn,
    turn_back,
    turn_symmetric,
)
from flexclear.dynamics.kernels import kernel

#: outputs of every body, in this order, and how many numbers each is; their sum
OF_BODIES = {"position": 3, "quaternion": 4, "velocity": 3, "omega": 3, "acceleration": 3, "alpha": 3, "demand": 6}
SIZE = sum(OF_BODIES.values())


@kernel
def put_quaternion(out, o, R):
    """Store the unit quaternion (w x y z, w >= 0) of a rotation matrix."""
    w, x, y, z = to_quaternion(R)
    size = 1.0 / np.sqrt(w * w + x * x + y * y + z * z)
    if w < 0.0:
        size = -size
    out[o], out[o + 1], out[o + 2], out[o + 3] = size * w, size * x, size * y, size * z


@kernel
def put_bodies(d, out, first, every, r):
    """Store the motion of the centres of mass and axes of all bodies, row r of `every`, from out[first] on."""
    bodies, gravity = d.n_bodies, d.gravity[0].acceleration
    for k in range(bodies):
        frame, body = d.link_frames[d.bodies[k].link], d.body_numbers[k]
        R, omega, alpha, mass = frame.axes, frame.omega, frame.alpha, body.mass
        arm = turn(R, body.com)
        swing, p = cross(omega, arm), add(frame.origin, arm)
        a = add(frame.acceleration, add(cross(alpha, arm), cross(omega, swing)))
        here, size = first + 3 * (bodies * r + k), every * bodies
        put(out, here, p)
        put_quaternion(out, here + 3 * size + bodies * r + k, product(R, body.axes))
        put(out, here + 7 * size, add(frame.velocity, swing))
        put(out, here + 10 * size, omega)
        put(out, here + 13 * size, add(a, gravity))
        put(out, here + 16 * size, alpha)
        if mass > 0.0:
            J, turning, force = at6(body.inertia, 0), turn_back(R, omega), scale(mass, a)
            spin = add(turn_symmetric(J, turn_back(R, alpha)), cross(turning, turn_symmetric(J, turning)))
            here += 19 * size + 3 * (bodies * r + k)
            put(out, here, add(turn(R, spin), cross(p, force)))
            put(out, here + 3, force)


@kernel
def put_frames(d, out, first):
    """Store the origins of all frames from out[first] on."""
    for k in range(d.n_frames):
        frame = d.link_frames[d.frames[k].link]
        put(out, first + 3 * k, add(frame.origin, turn(frame.axes, d.named_frame_numbers[k].origin)))
