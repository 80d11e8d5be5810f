"""Surfaces of clearance joints. To add one: a module here, a line in the table, its parameters in
scene/loose_joints, and a case in tests/properties/test_dynamics_clearance.

Each module has the kernel ``separation`` (see `clearance_spherical`), ``stiffness(joint, exponent)`` and
``contact_size(joint, depth, force)``.
"""

from __future__ import annotations

from flexclear.dynamics.contact.surfaces import ball_on_plane, clearance_revolute, clearance_slot, clearance_spherical

SURFACES = {
    "clearance-spherical": clearance_spherical,
    "clearance-revolute": clearance_revolute,
    "clearance-slot": clearance_slot,
    "ball-on-plane": ball_on_plane,
}
