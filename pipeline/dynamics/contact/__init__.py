"""Contact: forces from a normal law and a friction law, stiffness from geometry and materials.

NAMES lists the surfaces of each type of clearance joint: a class with ``stiffness(joint, exponent)`` and
``contact_size(joint, depth, force)``.
"""

KIND = "clearance joint"
NAMES = {
    "clearance-spherical": "surfaces:BallInSocket",
    "clearance-revolute": "surfaces:PinInJournal",
    "clearance-slot": "surfaces:PinInSlot",
    "ball-on-plane": "surfaces:BallOnPlane",
}
