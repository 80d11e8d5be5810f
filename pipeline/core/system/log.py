"""The one logger of this program, ``flexclear``: what is reported besides results, line by line.

Warnings are WARNING, progress is INFO, every step of it DEBUG. The command's -q and -v choose among these; from Python,
``logging.getLogger("flexclear").setLevel(logging.WARNING)`` does. Records go to stderr by the handler here, and to the
root logger only where ``propagate`` is set; another handler may replace it.
"""

from __future__ import annotations

import logging
import sys
from typing import TextIO

from flexclear.pipeline.core.system.errors import LONGEST_MESSAGE, shown

LOG = logging.getLogger("flexclear")
#: writes lines to the stream that `write_to` has named last, else to what stderr is at the time
_HANDLER = logging.StreamHandler()


class _Stderr:
    """The present stderr, which tests and notebooks exchange."""

    def write(self, text: str) -> None:
        sys.stderr.write(text)

    def flush(self) -> None:
        sys.stderr.flush()


class _Plain(logging.Formatter):
    """Clean a text that may come from files of others: no control characters, and only the ends of a long one."""

    def format(self, record: logging.LogRecord) -> str:
        return shown(super().format(record), LONGEST_MESSAGE)


def write_to(out: TextIO | None) -> None:
    """Let the own handler write to a stream; None: to stderr."""
    _HANDLER.setStream(_Stderr() if out is None or out is sys.stderr else out)  # type: ignore[arg-type]


def set_level(*, quiet: bool = False, verbose: bool = False) -> None:
    """What a command's -q and -v ask for."""
    LOG.setLevel(logging.WARNING if quiet else logging.DEBUG if verbose else logging.INFO)


if not LOG.handlers:
    _HANDLER.setFormatter(_Plain("flexclear: %(message)s"))
    LOG.addHandler(_HANDLER)
    LOG.propagate = False
    LOG.setLevel(logging.INFO)
write_to(None)
