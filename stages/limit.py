"""``--limit``: how long a command may take on the clock."""

from __future__ import annotations

import argparse
import math
import re

from flexclear.pipeline.core.scene.units import quantity
from flexclear.pipeline.core.system.errors import InputError


def deadline(options: argparse.Namespace | None) -> tuple[float, str]:
    """Seconds from now, and what is said then; InputError for what is no time."""
    text = getattr(options, "limit", None)
    if text is None:
        return math.inf, ""
    return seconds(text, "--limit"), f"the time that --limit {text} gives is over"


def seconds(text: str, option: str) -> float:
    """A time above zero [s], as ``10s``, ``2min`` or ``1h``; InputError for other texts of an option."""
    try:
        result = quantity(re.sub(r"(?<=[0-9.])(?=[a-z])", " ", text.strip()), "time")
        if not result > 0.0:
            raise ValueError("it must be above zero")
    except ValueError as error:
        raise InputError(f"{option} {text}", f"is no time: {error}", f"write {option} 2h, or '90 min'") from None
    return result
