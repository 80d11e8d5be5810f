"""The page about the paper: what holds of it first, then all that is behind; one file with all inside."""

from __future__ import annotations

import html
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from flexclear.papers.wang_wang_2019.discrepancies import DISCREPANCIES
from flexclear.papers.wang_wang_2019.published import CITATION
from flexclear.pipeline.post.pages import Part, downloads, media, page, prose
from flexclear.pipeline.post.plotting.table import Table, as_csv, as_html

#: the table with a verdict on each statement, and its words
VERDICTS = "table_verdicts"
GOOD, BAD = ("holds",), ("does not hold",)
#: heading of what the page shows of each of the project's own pages
DOCUMENTS = {
    "accuracy": "Accuracy against time",
    "stability": "Stability: hard cases, and what became of each",
    "chaos": "Periodic or chaotic",
    "conditions": "Reference conditions of the modes",
}
#: tables that print what the paper gives, the others compare results with it
GIVEN = ("table01", "table02", "table03", "table04", "table05", "table06")


@dataclass(frozen=True, slots=True)
class Content:
    """All that the page shows."""

    tables: Mapping[str, Table]
    assumptions: Mapping[str, tuple[str, tuple[str, ...]]]  #: place -> (text, scenes)
    images: Mapping[str, bytes]  #: PNG of each figure, by name
    film: tuple[str, bytes] | None  #: file name and content
    still: bytes | None
    views: str  #: HTML of the views that can be turned
    facts: Mapping[str, Mapping[str, str]]  #: scene -> run attributes
    documents: Mapping[str, str]  #: of DOCUMENTS -> HTML
    variants: Sequence[tuple[str, str]]  #: scene and title


def html_page(content: Content, captions: Mapping[str, str], assumptions: Sequence[tuple[str, str, str]]) -> str:
    """The whole page; captions: of the figures there are, by name."""
    figures = "".join(media(f"{name}.png", png, captions[name]) for name, png in content.images.items())
    results = [table for name, table in content.tables.items() if name not in (*GIVEN, VERDICTS)]
    given = [content.tables[name] for name in GIVEN if name in content.tables]
    files = {f"{name}.csv": as_csv(table).encode() for name, table in content.tables.items()}
    parts = [
        Part("verdicts", "The verdict on every statement", _verdicts(content.tables.get(VERDICTS))),
        Part("film", "The mechanism moving", _film(content)),
        Part("figures", "Figures", figures),
        Part("tables", "Tables", "".join(as_html(table) for table in results)),
        *(Part(key, heading, content.documents.get(key, "")) for key, heading in DOCUMENTS.items()),
        Part("parameters", "Parameters, as the paper prints them and as they are here", "".join(map(as_html, given))),
        Part("variants", "Variants", prose(("scene", "what it is"), content.variants)),
        Part(
            "assumptions",
            "Assumptions, the most influential first",
            prose(("value", "assumption", "scenes"), assumptions),
        ),
        Part(
            "discrepancies",
            "Discrepancies",
            prose(("place", "matter", "here"), DISCREPANCIES),
        ),
        Part("versions", "How it was computed, and by which versions", _versions(content)),
        Part("downloads", "Downloads", downloads(files)),
    ]
    title = "Rod flexibility and joint clearance: the paper, reproduced"
    return page(title, CITATION, parts, _answer(content)).decode()


def _answer(content: Content) -> str:
    """How many of the paper's statements hold, and which do not; empty without verdicts."""
    table = content.tables.get(VERDICTS)
    if table is None:
        return ""
    verdict = table.columns.index("verdict")
    said = [row[verdict] for row in table.rows]
    counts = "; ".join(f"{_word(word)}: {said.count(word)}" for word in dict.fromkeys(said))
    lines = [f"<li>Of {len(said)} statements of the paper, judged by rules: {counts}.</li>"]
    for row in table.rows:
        if row[verdict] in BAD:
            section, text, word, numbers = row
            lines.append(
                f"<li><i>{html.escape(text)}</i> ({html.escape(section)}): {_word(word)}; {html.escape(numbers)}.</li>"
            )
    where = "<a href='#verdicts'>All verdicts</a>, <a href='#tables'>tables next to the paper's</a>"
    return f"<ul>{''.join(lines)}</ul><p>{where}.</p>"


def _word(verdict: str) -> str:
    look = "good" if verdict in GOOD else "bad" if verdict in BAD else ""
    return f"<span class='{look}'>{html.escape(verdict)}</span>" if look else html.escape(verdict)


def _verdicts(table: Table | None) -> str:
    if table is None:
        return ""
    text = as_html(table, prose=True)
    for word in dict.fromkeys(row[table.columns.index("verdict")] for row in table.rows):
        text = text.replace(f"<td>{html.escape(word)}</td>", f"<td>{_word(word)}</td>")
    return text


def _film(content: Content) -> str:
    shown, caption = "", "Flexible rod and clearance at A1"
    if content.film is not None:
        shown = media(*content.film, caption, f"Film of the mechanism: {caption}")
    elif content.still is not None:
        shown = media("mechanism.png", content.still, "The mechanism")
    return shown + content.views


def _versions(content: Content) -> str:
    keys = list(dict.fromkeys(key for facts in content.facts.values() for key in facts))
    rows = [(f"`{scene}`", *(facts.get(key, "") for key in keys)) for scene, facts in content.facts.items()]
    return prose(("scene", *keys), rows)
