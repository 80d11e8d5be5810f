"""flexclear from Python: ``import flexclear as fc``."""

from pipeline import (
    compare,
    cost,
    edited,
    equilibrium,
    frequencies,
    load_scene,
    open,
    render,
    report,
    run,
    sections,
)

__all__ = [
    "Scene",
    "compare",
    "cost",
    "edited",
    "equilibrium",
    "frequencies",
    "load_scene",
    "open",
    "render",
    "report",
    "run",
    "sections",
]


def __getattr__(name: str) -> object:
    """`Scene` and the version, which are found when they are asked for."""
    import pipeline

    return getattr(pipeline, name)
