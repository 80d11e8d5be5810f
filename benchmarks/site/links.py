"""A hook of MkDocs: links that lead out of docs/ lead to the sources at the project's address, or become text."""

from __future__ import annotations

import re
from typing import Any

#: a link to a file of the project that is no page of the site
_OUTSIDE = re.compile(r"\[([^\]\n]+)\]\(((?:\.\./)+|(?=examples/|SECURITY))([^)\s]+)\)")


def on_page_markdown(markdown: str, **_: Any) -> str:
    """The page with such links as the name and the path of what they lead to."""
    return _OUTSIDE.sub(_told, markdown)


def _told(found: re.Match[str]) -> str:
    """Links to pages of this folder stay; others become words."""
    words, up, path = found.groups()
    if up and path.endswith(".md") and path.partition("/")[0] not in ("CONTRIBUTING.md", "README.md", "CHANGELOG.md"):
        return found[0]
    return f"{words} (`{path}`)"
