"""Laws of time, for drives and loads. To add one: a module here named like its type, and its parameters in
scene/laws.

Each module has ``pieces(law, dimension) -> Pieces`` (see `pieces`), which raises ValueError, in words, for values of
another dimension.
"""

from flexclear.scene.laws import KINDS
from flexclear.scene.registry import declared

KIND = "law"
NAMES = declared(KINDS, made="pieces")
