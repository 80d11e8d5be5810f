"""Normal contact laws. To add one: a module here named like the law, its name, or the class of its keys, in
scene/clearance, and a case in tests/properties/test_dynamics_laws.

Each has ``resolve(law, stiffness, mass) -> Resolved`` (see `contact.law`): the numbers for one of the compiled forms in
`contact.form`, and the restitution of a free impact. It raises ValueError, in words, for what it cannot deliver.
"""

from flexclear.scene.clearance import NORMALS
from flexclear.scene.registry import declared

KIND = "normal law"
NAMES = declared(NORMALS, key="law", made="resolve")
