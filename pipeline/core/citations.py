"""Where a method is from, as docstrings say it: a paragraph that begins with ``Source:``."""

from __future__ import annotations

import re

_SOURCE = re.compile(r"^\s*Sources?:\s+(.+?)(?:\n\s*\n|\Z)", re.DOTALL | re.MULTILINE)


def cited(docstring: str | None) -> list[str]:
    r"""The sources that a docstring names, each on one line.

    >>> cited("A law.\n\nSource: Hertz (1881), Journal f. Math.\n92, 156-171.")
    ['Hertz (1881), Journal f. Math. 92, 156-171.']
    """
    return [" ".join(match[1].split()) for match in _SOURCE.finditer(docstring or "")]
