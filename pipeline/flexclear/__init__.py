"""flexclear from Python: ``import flexclear as fc``.

Its functions are those of `flexclear.public`, which is imported when one of them is first used.
"""

# ruff: noqa: F403, F405  (names of `public`)
from importlib import import_module
from typing import TYPE_CHECKING

from flexclear.system import threads as threads  # isort: skip  (before NumPy is loaded)

if TYPE_CHECKING:
    from flexclear.public import *
    from flexclear.public import __version__ as __version__

__all__ = [
    "FlexclearError",
    "InputError",
    "ResourceError",
    "Scene",
    "SolverError",
    "compare",
    "cost",
    "edited",
    "effects",
    "equilibrium",
    "exit_code",
    "export",
    "frequencies",
    "load_scene",
    "new",
    "open",
    "plan",
    "quantity",
    "render",
    "report",
    "run",
    "sections",
    "sensitivities",
    "show",
    "simulation",
    "stability",
    "stage",
    "state_space",
    "sweep",
    "wear",
]


def __getattr__(name: str) -> object:
    """Return a name of `public`, imported at its first use, that module itself, or the version."""
    if name == "public":
        return import_module("flexclear.public")
    if name in __all__ or name == "__version__":
        return getattr(import_module("flexclear.public"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return [*__all__, "__version__"]
