"""Laws of time, of drives and loads. To add one: a module here that is called like its type, and its
parameters in core/scene/laws.

Each module has ``pieces(law, dimension) -> Pieces`` (see `pieces`), which raises ValueError, in
words, for values that are not of that dimension.
"""

from flexclear.pipeline.core.scene.laws import KINDS
from flexclear.pipeline.core.scene.registry import declared

KIND = "law"
NAMES = declared(KINDS, made="pieces")
