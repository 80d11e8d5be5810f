"""Loads. To add one: a module here that is called like its type, and its parameters in core/scene/loads. One whose
effect takes more, as states between steps, is in the effect's folder.

Each module but that of gravity, which is a field, has
- ``row(load, place)`` or, on a joint coordinate, ``row(load, place, coordinate)``: what it acts on
  and with (see `row.Row`); ValueError, in words, for values that cannot be;
- ``apply(d, k)``: kernel that applies load k by `fields.act`.
"""

from flexclear.pipeline.core.scene.loads import KINDS
from flexclear.pipeline.core.scene.registry import declared

KIND = "load"
NAMES = declared(KINDS) | {
    "gravity": "gravity:field",
    "bushing": ".effects.bushings.bushing",
    "pid": ".effects.controllers.pid",
    "sampled-pid": ".effects.controllers.sampled_pid",
}
