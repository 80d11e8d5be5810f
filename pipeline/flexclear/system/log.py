"""The only logger of this program, ``flexclear``, for all reports besides results, line by line.

Warnings have level WARNING, progress INFO, every step of progress DEBUG. The command's -q and -v choose the level; from
Python use ``logging.getLogger("flexclear").setLevel(logging.WARNING)``. Records go to stderr by the handler here, and
to the root logger only where ``propagate`` is set; another handler may replace it.
"""

from __future__ import annotations

import logging
import sys
from typing import TextIO

from flexclear.system.errors import LONGEST_MESSAGE, terminal_text

LOG = logging.getLogger("flexclear")
#: writes lines to the stream last given to `write_to`, else to the current stderr
_HANDLER = logging.StreamHandler()


class _Stderr:
    """The current stderr, which tests and notebooks replace."""

    def write(self, text: str) -> None:
        sys.stderr.write(text)

    def flush(self) -> None:
        sys.stderr.flush()


class _Plain(logging.Formatter):
    """Formats texts that may come from other programs' files: no control characters, long texts shortened."""

    def format(self, record: logging.LogRecord) -> str:
        return terminal_text(super().format(record), LONGEST_MESSAGE)


def write_to(out: TextIO | None) -> None:
    """Let the handler of this program write to a stream; None: to stderr."""
    _HANDLER.setStream(_Stderr() if out is None or out is sys.stderr else out)  # type: ignore[arg-type]


def set_level(*, quiet: bool = False, verbose: bool = False) -> None:
    """Set the level that a command's -q and -v request."""
    LOG.setLevel(logging.WARNING if quiet else logging.DEBUG if verbose else logging.INFO)


if not LOG.handlers:
    _HANDLER.setFormatter(_Plain("flexclear: %(message)s"))
    LOG.addHandler(_HANDLER)
    LOG.propagate = False
    if LOG.level == logging.NOTSET:  # the user's choice may come first
        LOG.setLevel(logging.INFO)
write_to(None)
