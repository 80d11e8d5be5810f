"""``--limit``: how long a command may take on the clock."""

from __future__ import annotations

import argparse
import math
import re

from flexclear.pipeline.core.errors import InputError
from flexclear.pipeline.core.units import quantity


def argument(parser: argparse.ArgumentParser) -> None:
    """How long the command may take."""
    parser.add_argument(
        "--limit", metavar="TIME", help="stop in good order after, e.g., 2h (exit code 4); run again to go on"
    )


def deadline(options: argparse.Namespace | None) -> tuple[float, str]:
    """Seconds from now, and the message printed then; InputError for what is no time."""
    text = getattr(options, "limit", None)
    if text is None:
        return math.inf, ""
    try:
        seconds = quantity(re.sub(r"(?<=[0-9.])(?=[a-z])", " ", text.strip()), "time")
        if not seconds > 0.0:
            raise ValueError("it must be above zero")
    except ValueError as error:
        raise InputError(f"--limit {text}", f"is no time: {error}", "write --limit 2h, or '90 min'") from None
    return seconds, f"the time that --limit {text} gives is over"
