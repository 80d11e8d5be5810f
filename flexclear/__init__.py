"""flexclear from Python: ``import flexclear as fc``.

``flexclear.pipeline`` and ``flexclear.stages`` are the folders of these names at the top of the repository: links in
a checkout, plain folders where flexclear is installed.
"""

from flexclear.pipeline import (
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
    sweep,
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
    "sweep",
]


def __getattr__(name: str) -> object:
    """`Scene` and the version, which are found when they are asked for."""
    from flexclear import pipeline

    return getattr(pipeline, name)
