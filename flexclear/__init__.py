"""flexclear from Python: ``import flexclear as fc``.

``flexclear.pipeline`` and ``flexclear.stages`` are the folders of these names at the top of the repository: links in
a checkout, plain folders where flexclear is installed. Where a checkout has no links, as on Windows, the top itself is
looked through.
"""

import os

if not os.path.isdir(os.path.join(os.path.dirname(__file__), "pipeline")):
    __path__.append(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))

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
