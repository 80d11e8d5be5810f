"""docs/index.md: the README, as the first page of the site."""

from __future__ import annotations

import re

from flexclear.pipeline.core.workflow.fingerprint import TREE


def text() -> str:
    """The README, with its links as from docs/."""
    page = (TREE / "README.md").read_text(encoding="utf-8")
    return re.sub(r"\]\((docs/)?(?!http)([^)]+)\)", lambda m: f"]({'' if m[1] else '../'}{m[2]})", page)
