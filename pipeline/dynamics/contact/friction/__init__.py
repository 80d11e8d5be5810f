"""Friction laws. To add one: a module here, a line below; the property tests pick it up.

Each module has ``parameters(law)`` (four numbers) and the kernel ``coefficient(speed, p)`` whose
value times the normal force is the friction force, always against the sliding velocity.
"""

KIND = "friction law"
NAMES = {"modified-coulomb": "modified_coulomb:ModifiedCoulomb"}
