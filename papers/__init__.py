"""Papers that this program reproduces, one folder each: applications, run by ``python -m papers.<name>``."""

import re
from pathlib import Path

#: folder of the project, with the scenes and pages that papers read
PROJECT = Path(__file__).absolute().parents[1]


def rows(text: str) -> tuple[tuple[str, ...], ...]:
    """Return the cells of a table, one row per line: ``first | second | third``; indented lines continue a row."""
    return tuple(tuple(map(str.strip, line.split("|"))) for line in re.sub(r"\n +", " ", text.strip()).splitlines())
