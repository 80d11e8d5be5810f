"""MkDocs hook: links that lead out of docs/ become text, since the site does not hold their targets."""

from __future__ import annotations

import re
from typing import Any

#: a link to a file of the project that is no page of the site
_OUTSIDE = re.compile(r"\[([^\]\n]+)\]\(((?:\.\./)+|(?=examples/|SECURITY))([^)\s]+)\)")


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Return the page with each link out of docs/ replaced by its text and the path of its target."""
    return _OUTSIDE.sub(_as_text, markdown)


def _as_text(found: re.Match[str]) -> str:
    """Return a link to a page of docs/ unchanged, and any other link as text with its path."""
    words, up, path = found.groups()
    if up and path.endswith(".md") and path.partition("/")[0] not in ("CONTRIBUTING.md", "README.md", "CHANGELOG.md"):
        return found[0]
    return f"{words} (`{path}`)"
