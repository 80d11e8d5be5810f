"""How a run begins where the poses of the bodies leave a choice."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field

from pipeline.core.scene.fields import Part


class Branch(Part):
    """One way out of a change point: on which this joint coordinate changes most in the direction of `sign`.

    joint, coordinate: as of a drive.  sign: 1 takes the branch on which the coordinate grows most, or falls least; -1
    that on which it falls most, or grows least.
    """

    joint: str
    coordinate: str | None = None
    sign: Literal[1, -1]


def _several(value: Any) -> Any:
    """One choice need not be written as a list."""
    return (value,) if isinstance(value, (Mapping, Branch)) else value


class Start(Part):
    """The start of the run.

    branch: in a change point, which of the branches that cross there the motion takes; with several loops a list, each
    choosing among what those before it have left.
    """

    branch: Annotated[tuple[Branch, ...], BeforeValidator(_several), Field(min_length=1)]
