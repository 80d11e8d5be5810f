"""Contact: forces from a normal law and a friction law, stiffness from geometry and materials.

NAMES lists the stiffness of each type of clearance joint.
"""

KIND = "clearance joint"
NAMES = {"clearance-spherical": "stiffness:sphere_in_sphere"}
