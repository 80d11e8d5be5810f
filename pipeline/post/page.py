"""HTML of the report: no scripts, no outside resources."""

from __future__ import annotations

import html
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from flexclear.pipeline.post.discrepancies import DISCREPANCIES
from flexclear.pipeline.post.paper import CITATION
from flexclear.pipeline.post.plotting.table import Table, as_html

STYLE = """
:root { --ink: #1f2933; --soft: #5b6570; --line: #dde3ea; --back: #f7f9fb; --accent: #0072B2; }
* { box-sizing: border-box; }
body { margin: 0; background: var(--back); color: var(--ink);
       font: 16px/1.55 system-ui, "Segoe UI", Roboto, sans-serif; }
main { max-width: 1080px; margin: 0 auto; padding: 2.2rem 1.2rem 4rem; }
h1 { font-size: 1.9rem; line-height: 1.2; margin: 0 0 .3rem; }
h2 { margin: 2.8rem 0 .8rem; padding-top: .8rem; border-top: 1px solid var(--line); font-size: 1.3rem; }
p.lead { color: var(--soft); margin-top: 0; }
nav a { margin-right: 1rem; } a { color: var(--accent); }
figure { margin: 1.4rem 0 2rem; background: #fff; border: 1px solid var(--line); border-radius: 8px; padding: 1rem; }
figure img, figure video { width: 100%; height: auto; display: block; }
figcaption { font-weight: 600; margin-bottom: .6rem; }
figcaption a { font-weight: 400; font-size: .85rem; margin-left: .6rem; }
.scroll { overflow-x: auto; }
table { border-collapse: collapse; font-size: .86rem; width: 100%; font-variant-numeric: tabular-nums; }
th, td { padding: .35rem .6rem; border-bottom: 1px solid var(--line); text-align: right; vertical-align: top; }
th:first-child, td:first-child { text-align: left; } thead th { border-bottom: 2px solid #b9c4d0; }
table.prose td, table.prose th { text-align: left; }
figure p { color: var(--soft); font-size: .9rem; margin: .7rem 0 0; } code { font-size: .86em; }
"""


@dataclass(frozen=True, slots=True)
class Content:
    """All that a report shows. Paths are relative to the report's folder."""

    figures: tuple[str, ...]  #: names with a PNG
    tables: Mapping[str, Table]
    assumptions: Mapping[str, tuple[str, tuple[str, ...]]]  #: place -> (text, scenes)
    film: str | None = None
    still: str | None = None
    links: Mapping[str, str] = field(default_factory=dict)  #: text -> path
    facts: Mapping[str, Mapping[str, str]] = field(default_factory=dict)  #: scene -> run attributes


def html_page(content: Content, drawn: Sequence[tuple[str, str]], assumptions: Sequence[tuple[str, str, str]]) -> str:
    """The whole page; `drawn` are names and captions of the figures there are."""
    sections = [
        ("film", "The mechanism moving", _film(content)),
        ("figures", "Figures", "".join(_figure(name, title) for name, title in drawn)),
        ("tables", "Tables", "".join(as_html(table) for table in content.tables.values())),
        ("assumptions", "Assumptions", _prose(("value", "assumption", "scenes"), assumptions)),
        (
            "discrepancies",
            "Discrepancies",
            _prose(("place", "matter", "here"), [(d.place, d.matter, d.here) for d in DISCREPANCIES]),
        ),
    ]
    shown = [(key, head, body) for key, head, body in sections if body]
    links = "".join(f"<a href='#{key}'>{head}</a>" for key, head, _ in shown)
    body = "".join(f"<h2 id='{key}'>{head}</h2>\n{text}" for key, head, text in shown)
    return (
        "<!doctype html>\n<html lang='en'><head><meta charset='utf-8'><meta name='viewport' "
        "content='width=device-width'>"
        f"<title>flexclear report</title><style>{STYLE}</style></head>\n<body><main><h1>Rod flexibility and "
        "joint clearance: the paper, reproduced</h1>\n"
        f"<p class='lead'>{html.escape(CITATION)}</p>\n<nav>{links}</nav>\n{body}</main></body></html>\n"
    )


def _film(content: Content) -> str:
    parts = []
    if content.film is not None:
        show = (
            f"<video src='{content.film}' controls loop muted playsinline></video>"
            if content.film.endswith("mp4")
            else f"<img src='{content.film}' alt='film'>"
        )
        parts.append(f"<figure><figcaption>Flexible rod and clearance at A1</figcaption>{show}</figure>\n")
    elif content.still is not None:
        parts.append(f"<figure><img src='{content.still}' alt='the mechanism'></figure>\n")
    links = "".join(f"<li><a href='{path}'>{html.escape(text)}</a></li>" for text, path in content.links.items())
    return "".join(parts) + (f"<ul>{links}</ul>\n" if links else "")


def _figure(name: str, title: str) -> str:
    source = f"../figures/{name}"
    caption = f"{html.escape(title)}<a href='{source}.svg'>SVG</a>"
    image = f"<img src='{source}.png' alt='{html.escape(title)}' loading='lazy'>"
    return f"<figure id='{name}'><figcaption>{caption}</figcaption>{image}</figure>\n"


def _prose(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    if not rows:
        return ""
    head = "".join(f"<th>{html.escape(text)}</th>" for text in heads)
    lines = "".join("<tr>" + "".join(f"<td>{_code(cell)}</td>" for cell in row) + "</tr>\n" for row in rows)
    table = f"<table class='prose'><thead><tr>{head}</tr></thead><tbody>\n{lines}</tbody></table>"
    return f"<figure><div class='scroll'>{table}</div></figure>\n"


def _code(text: str) -> str:
    """Escaped, with `backticks` as code."""
    return re.sub(r"`([^`]+)`", r"<code>\1</code>", html.escape(text))
