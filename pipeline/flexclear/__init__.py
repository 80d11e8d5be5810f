"""flexclear from Python: ``import flexclear as fc``.

``flexclear.pipeline``, ``stages`` and ``papers`` are the folders of these names at the top of the repository: links in
a checkout, plain folders where flexclear is installed. Where a checkout has no links, as on Windows, Python also
searches the top of the repository.
"""

import os
from importlib import import_module
from typing import TYPE_CHECKING

if not os.path.isdir(os.path.join(os.path.dirname(__file__), "pipeline")):
    __path__.append(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))

from flexclear.system import threads as threads  # isort: skip  (before NumPy is loaded)

if TYPE_CHECKING:
    from flexclear.public import *  # noqa: F403  (listed there)


def __getattr__(name: str) -> object:
    """Return a name of `public`, imported at its first use, that module itself, or the version."""
    listed = name in ("public", "__all__", "__version__")
    public = import_module("flexclear.public") if listed or not name.startswith("__") else None
    if name == "public":
        return public
    if public is not None and (listed or name in public.__all__):
        return getattr(public, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return [*globals(), *import_module("flexclear.public").__all__]
