"""Surfaces of clearance joints. To add one: a module here named like the joint's type, its parameters in
core/scene/clearance, and a case in tests/properties/test_dynamics_clearance.

Each module has the kernel ``separation`` (see `clearance_spherical`), ``stiffness(joint, exponent)`` and
``contact_size(joint, depth, force)``.
"""

from flexclear.pipeline.core.scene.clearance import CONTACTS
from flexclear.pipeline.core.scene.registry import declared

KIND = "clearance joint"
NAMES = declared(CONTACTS)
