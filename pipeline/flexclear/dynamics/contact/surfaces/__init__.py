"""Surfaces of clearance joints. To add one: a module here, a line in the table, its parameters in
scene/loose_joints, and a case in tests/properties/test_dynamics_clearance.

Each module has ``separation(numbers, R_WA, p, v)``, of numbers that may be symbols, ``stiffness(joint, exponent)`` and
``contact_size(joint, depth, force)``. p, v: centre of the inner surface as seen from that of the outer one, and its
rate there, in axes of the world.  R_WA: axes of the outer frame.  numbers: of the contact (`memory.CONTACT_NUMBERS`).
"""

from __future__ import annotations

from flexclear.dynamics.contact.surfaces import (
    ball_on_plane,
    ball_on_strip,
    clearance_revolute,
    clearance_slot,
    clearance_spherical,
)

SURFACES = {
    "clearance-spherical": clearance_spherical,
    "clearance-revolute": clearance_revolute,
    "clearance-slot": clearance_slot,
    "ball-on-plane": ball_on_plane,
    "ball-on-strip": ball_on_strip,
}
