"""Sections of the project's Markdown pages, as HTML that carries its pictures."""

from __future__ import annotations

import base64
import re
from collections.abc import Sequence
from pathlib import Path

from flexclear.pipeline.core.system.file_dependencies import note

#: what generated pages put around what they measured
COMMENT = re.compile(r"<!--.*?-->\s*", re.DOTALL)


def section(page: Path, headings: Sequence[str] = (), pictures: Sequence[str] | None = None) -> str:
    """The text of a page below its title, as HTML; empty where there is no such page.

    headings: only what is below these; "" is what is before the first of them.  pictures: endings of the
    names of those that are shown; default: all.
    """
    note(page)
    if not page.is_file():
        return ""
    parts = _parts(COMMENT.sub("", page.read_text(encoding="utf-8")))
    text = "\n\n".join(
        f"### {head}\n\n{body}" if head else body for head, body in parts if not headings or head in headings
    )
    return _pictures(_html(text), page.parent, pictures)


def _parts(text: str) -> list[tuple[str, str]]:
    """Heading and text of each section of second level."""
    pieces = re.split(r"^## (.+)$", re.sub(r"\A# .+\n", "", text), flags=re.MULTILINE)
    return [("", pieces[0].strip()), *((pieces[k].strip(), pieces[k + 1].strip()) for k in range(1, len(pieces), 2))]


def _html(text: str) -> str:
    from markdown_it import MarkdownIt

    made: str = MarkdownIt("commonmark", {"html": False}).enable("table").render(text)
    # links between pages lead nowhere in one file
    made = re.sub(r'<a href="(?!https?:|#)[^"]*">(.*?)</a>', r"<i>\1</i>", made, flags=re.DOTALL)
    made = made.replace("<table>", "<figure><div class='scroll'><table class='sorts'>").replace(
        "</table>", "</table></div></figure>"
    )
    return made


def _pictures(text: str, folder: Path, requested: Sequence[str] | None) -> str:
    def shown(match: re.Match[str]) -> str:
        name, alt = match[1], match[2]
        path = folder / name
        if not path.is_file() or (requested is not None and not name.endswith(tuple(requested))):
            return ""
        note(path)
        data = base64.b64encode(path.read_bytes()).decode()
        return f"<figure class='plot'><img src='data:image/png;base64,{data}' alt='{alt}'></figure>"

    return re.sub(r'<p>\s*<img src="([^"]+)" alt="([^"]*)"\s*/?>\s*</p>', shown, text)
