"""A self-contained page: pictures and the film are inside, so that one file can be sent to somebody."""

from __future__ import annotations

import base64
import html
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from flexclear.pipeline.post.page import STYLE

#: media types by suffix of a file
TYPES = {"png": "image/png", "svg": "image/svg+xml", "mp4": "video/mp4", "gif": "image/gif"}


@dataclass(frozen=True, slots=True)
class Part:
    """A part of the page: its key, its heading, its HTML."""

    key: str
    heading: str
    body: str


def page(title: str, lead: str, parts: Sequence[Part]) -> bytes:
    """The page with those parts that are not empty."""
    shown = [part for part in parts if part.body]
    links = "".join(f"<a href='#{part.key}'>{html.escape(part.heading)}</a>" for part in shown)
    body = "".join(f"<h2 id='{part.key}'>{html.escape(part.heading)}</h2>\n{part.body}" for part in shown)
    text = (
        "<!doctype html>\n<html lang='en'><head><meta charset='utf-8'>"
        "<meta name='viewport' content='width=device-width'>"
        f"<title>{html.escape(title)}</title><style>{STYLE}</style></head>\n<body><main><h1>{html.escape(title)}</h1>\n"
        f"<p class='lead'>{html.escape(lead)}</p>\n<nav>{links}</nav>\n{body}</main></body></html>\n"
    )
    return text.encode()


def media(name: str, content: bytes, caption: str) -> str:
    """A picture or film, inside of the page."""
    kind = TYPES[name.rpartition(".")[2]]
    data = f"data:{kind};base64,{base64.b64encode(content).decode()}"
    shown = (
        f"<video src='{data}' controls loop muted playsinline></video>"
        if kind.startswith("video")
        else f"<img src='{data}' alt='{html.escape(caption)}'>"
    )
    return f"<figure><figcaption>{html.escape(caption)}</figcaption>{shown}</figure>\n"


def listed(rows: Mapping[str, str], heads: tuple[str, str]) -> str:
    """A table of two columns of text; empty without rows."""
    if not rows:
        return ""
    head = "".join(f"<th>{html.escape(text)}</th>" for text in heads)
    lines = "".join(
        f"<tr><td>{html.escape(name)}</td><td>{html.escape(text)}</td></tr>\n" for name, text in rows.items()
    )
    table = f"<table class='prose'><thead><tr>{head}</tr></thead><tbody>\n{lines}</tbody></table>"
    return f"<figure><div class='scroll'>{table}</div></figure>\n"
