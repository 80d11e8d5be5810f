"""Friction laws. To add one: a module here named like the law, with a `LAW` (see `law.Friction`), its parameters in
scene/clearance, and a case in tests/properties/test_dynamics_friction and test_dynamics_clearance.

A joint without friction names none.
"""

from flexclear.scene.clearance import FRICTIONS
from flexclear.scene.registry import declared

KIND = "friction law"
NAMES = declared(FRICTIONS, key="law", made="LAW")
