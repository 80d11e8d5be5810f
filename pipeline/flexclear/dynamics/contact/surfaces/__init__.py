"""Surfaces of clearance joints. To add one: a module here named like the joint's type, its parameters in
scene/clearance, and a case in tests/properties/test_dynamics_clearance.

Each module has the kernel ``separation`` (see `clearance_spherical`), ``stiffness(joint, exponent)`` and
``contact_size(joint, depth, force)``.
"""

from flexclear.scene.clearance import CONTACTS
from flexclear.scene.registry import declared

KIND = "clearance joint"
NAMES = declared(CONTACTS)
