"""A scene in a notebook: its title, a small picture, and its parts by kind."""

from __future__ import annotations

import html
from collections.abc import Callable
from typing import Any

#: functions that return a picture of a scene as HTML; packages that can draw add theirs
PICTURES: list[Callable[[Any], str]] = []


def as_html(scene: Any) -> str:
    """Return the title, the times, a picture, and a table of the parts of a `Scene` by kind."""
    rows = []
    for family in ("body", "joint", "drive", "load", "stop", "gear", "event"):
        parts = getattr(scene, family).items()
        lines = "<br>".join(html.escape(_in_words(name, part)) for name, part in parts)
        rows += [f"<tr><th>{family}</th><td>{lines}</td></tr>"] if parts else []
    head = f"<b>{html.escape(scene.title)}</b><br>{html.escape(scene.name)}"
    picture = "".join(draw(scene) for draw in PICTURES)
    return f"<p>{head}: {scene.time.start:g} to {scene.time.end:g} s</p>{picture}<table>{''.join(rows)}</table>"


def _in_words(name: str, part: Any) -> str:
    """Return a part's name, type and the frames, joints or body that it acts on, as in a table."""
    kind = getattr(part, "type", None) or getattr(getattr(part, "law", None), "type", "")
    on = [getattr(part, key, None) for key in (("first", "second") if hasattr(part, "first") else ("joint", "frame"))]
    sites = " – ".join([*getattr(part, "between", ()), *(str(one) for one in on if one)])
    return ": ".join(filter(None, [f"{name} ({kind})" if kind else name, sites]))
