"""MkDocs hook: the README is the first page; links out of docs/ become text, since the site lacks their targets."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

#: a link to a file of the project that is no page of the site
_OUTSIDE = re.compile(r"\[([^\]\n]+)\]\(((?:\.\./)+|(?=examples/|SECURITY))([^)\s]+)\)")


def on_files(files: Any, config: Any, **_: Any) -> Any:
    """Add the README as first page, with links relative to docs/, without the list that the site's menu has."""
    from mkdocs.structure.files import File

    path = Path(config["docs_dir"]).parent / "README.md"
    page = path.read_text(encoding="utf-8").partition("## Read on\n")[0].rstrip() + "\n"
    page = re.sub(r"\]\((docs/)?(?!http)([^)]+)\)", lambda m: f"]({'' if m[1] else '../'}{m[2]})", page)
    files.append(File.generated(config, "index.md", content=page))
    return files


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Return the page with each link out of docs/ replaced by its text and the path of its target."""
    return _OUTSIDE.sub(_as_text, markdown)


def _as_text(found: re.Match[str]) -> str:
    """Return a link to a page of docs/ unchanged, and any other link as text with its path."""
    words, up, path = found.groups()
    if up and path.endswith(".md") and path.partition("/")[0] not in ("CONTRIBUTING.md", "README.md", "CHANGELOG.md"):
        return found[0]
    return f"{words} (`{path}`)"
