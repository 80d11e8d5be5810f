"""Loads. To add one: a module here named like its type, and its parameters in scene/loads. A load whose effect
needs more, such as states between steps, is in the effect's folder.

Each module except that of gravity, which is a field, has

- ``row(load, place)`` or, on a joint coordinate, ``row(load, place, coordinate)``: the row of the load (see `row.Row`);
  raises ValueError, in words, for invalid values;
- ``apply(d, k)``: kernel that applies load k by `fields.act`.
"""

from flexclear.scene.loads import KINDS
from flexclear.scene.registry import declared

KIND = "load"
NAMES = declared(KINDS) | {
    "gravity": "gravity:field",
    "bushing": ".effects.bushings.bushing",
    "pid": ".effects.controllers.pid",
    "sampled-pid": ".effects.controllers.sampled_pid",
}
