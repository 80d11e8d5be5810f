"""The report page and docs/paper.md, from the results of the other stages."""

from __future__ import annotations

import base64
import html
import json
import re
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import xarray as xr

from flexclear.applications import Progress
from flexclear.publishing import (
    Part,
    Table,
    as_csv,
    as_html,
    downloads,
    figures_of,
    from_markdown,
    media,
    page,
    prose,
)
from papers import PROJECT
from papers.wang_wang_2019 import DOCUMENTS, figures
from papers.wang_wang_2019.published import CITATION, DISCREPANCIES

#: place, text and scenes
Assumption = tuple[str, str, tuple[str, ...]]
#: the command that makes everything on the page
PROGRAM = "python -m papers.wang_wang_2019"
#: attributes of a run that the page shows
FACTS = ("title", "method", "evaluations", "steps", "versions")


def run(params: Mapping[str, Any], inputs: Mapping[str, xr.Dataset], progress: Progress) -> dict[str, Any]:
    """Stage: write ``index.html``, and ``paper.md`` with its lists as CSV, from the results folder.

    params: the folder, the run of each scene below it, the sources of its values, the scene of film and pictures, and
    the digest of everything on the page, so that each change writes the page again.
    """
    results = Path(params["results"])
    attributes = {}
    for scene, path in params["runs"].items():
        with xr.open_dataset(results / path) as one:
            attributes[scene] = {**one.attrs, **params["origins"][scene]}
    content = collect(results, attributes, params["rendered"], PROJECT)
    lists = {f"{name}.csv": as_csv(table).encode() for name, table in paper_lists(content).items()}
    return {"index.html": html_page(content).encode(), "paper.md": paper_markdown(content).encode(), **lists}


def collect(
    results: Path, attributes: Mapping[str, Mapping[str, object]], rendered: str, source: Path | None = None
) -> Content:
    """Return the contents of a results folder (figures/, tables/, runs/<scene>/) and of the sources.

    attributes: scene -> attributes of its run.  rendered: the scene of film and views.  source: folder with `docs` and
    `scenes`.  Missing files are left out.
    """
    tables = {
        path.stem: from_markdown(path.read_text(encoding="utf-8"))
        for path in sorted((results / "tables").glob("table*.md"))
    }
    images = {name: results / "figures" / f"{name}.png" for name in figures.NAMES}
    folder = results / "runs" / rendered
    films = [path for path in (folder / "film.mp4", folder / "film.gif") if path.is_file()]
    still = folder / "mechanism.png"
    pages = [path for path in (folder / "motion.html", folder / "modes.html") if path.is_file()]
    return Content(
        tables=tables,
        assumptions=merged_assumptions(attributes),
        images={name: path.read_bytes() for name, path in images.items() if path.is_file()},
        film=(films[0].name, films[0].read_bytes()) if films else None,
        still=still.read_bytes() if still.is_file() else None,
        views="".join(figures_of(path.read_text(encoding="utf-8")) for path in pages),
        facts={scene: {key: str(facts[key]) for key in FACTS if key in facts} for scene, facts in attributes.items()},
        documents={} if source is None else _documents(source / "docs"),
        variants=() if source is None else _variants(source / "scenes" / "sps4" / "variants"),
    )


def _documents(docs: Path) -> dict[str, str]:
    return {name: section(docs / f"{name}.md", heads, endings) for name, (_, heads, endings) in DOCUMENTS.items()}


def _variants(folder: Path) -> list[tuple[str, str]]:
    """Return name and title of each scene in a folder."""
    variants = []
    for path in sorted(folder.glob("*.toml")):
        title = tomllib.loads(path.read_text(encoding="utf-8")).get("title", "")
        variants.append((f"`{path.parent.parent.name}/{path.parent.name}/{path.stem}`", str(title)))
    return variants


def merged_assumptions(attributes: Mapping[str, Mapping[str, object]]) -> list[Assumption]:
    """Return each assumption once, with its scenes; the assumed values are in alphabetical order."""
    scenes: dict[tuple[str, str], list[str]] = {}
    for scene, facts in attributes.items():
        for where, text in json.loads(str(facts.get("assumptions", "{}"))).items():
            scenes.setdefault((where, text), []).append(scene)
    return [(where, text, tuple(names)) for (where, text), names in sorted(scenes.items())]


def paper_markdown(content: Content) -> str:
    """Return docs/paper.md: what the tables say next to the paper's, the weightiest assumptions, discrepancies."""
    assumed = paper_lists(content)["assumptions"]
    parts = [
        "# The paper, reproduced\n",
        f"After this page you know what of {CITATION}, holds here. `make all` (`{PROGRAM}`) computes every number: it "
        "brings the scenes up to date, draws `results/figures` and `results/tables`, and writes this page "
        "(`results/report/paper.md`).\n",
        "[All figures and tables, and the scenes that each takes](paper/figures.csv). [All notes on the tables]"
        "(paper/notes.csv). [All assumptions](paper/assumptions.csv).\n",
        "## Tables\n",
        "Tables of given parameters, and what could not be integrated: `results/tables`.\n",
        *(_shown(name, table, notes) for name, (table, notes) in _results(content.tables).items()),
        "## Assumptions\n",
        "The weightiest values that the paper does not print. Each is marked `assumed` in its scene file.\n",
        _pipe(assumed.columns, assumed.rows[:SHOWN]),
        "## Discrepancies\n",
        "What the paper leaves open or prints in conflict with itself. Which of its statements on mode sets hold, and "
        "for which position of the prismatic joint: [reference-conditions.md](reference-conditions.md).\n",
        _pipe(("place", "matter", "here"), DISCREPANCIES),
    ]
    return "\n".join(parts)


def assumption_rows(content: Content) -> list[tuple[str, str, str]]:
    """Return value, reason and scenes of each assumption; one that all scenes share has the word all.

    Values of parts that differ only in their number (leg 1 to 4) share a row.
    """
    total = len(content.facts)
    grouped: dict[tuple[str, str], list[str]] = {}
    for path, text, scenes in sorted(content.assumptions, key=lambda assumption: weight(assumption[0])):
        where = "all" if len(scenes) == total else ", ".join(scene.partition("/")[2] or scene for scene in scenes)
        grouped.setdefault((text.removeprefix("assumed:").strip(), where), []).append(path)
    return [(", ".join(f"`{path}`" for path in places), text, where) for (text, where), places in grouped.items()]


#: parts whose values matter most in these scenes: the joint with clearance, the flexible rod, the layout
WEIGHTY = ("joint.A1", "body.rod1", "body.ground", "body.platform", "drive", "joint", "body")


def weight(where: str) -> int:
    """Return the rank of a value among the assumptions; small ranks come first."""
    known = [k for k, start in enumerate(WEIGHTY) if where == start or where.startswith(f"{start}.")]
    return known[0] if known else len(WEIGHTY)


def scenes_of(name: str) -> tuple[str, ...]:
    """Return the scenes that a figure or table reads, in order, each once."""
    return tuple(dict.fromkeys(reference.partition(":")[0] for reference in figures.figure(name).needs))


def paper_lists(content: Content) -> dict[str, Table]:
    """Return the lists of docs/paper: figures with their scenes, notes, assumptions that follow from no other."""
    rows = []
    for name in figures.NAMES:
        scenes = ", ".join(
            f"`{scene}`" if "/" in scene else f"timing of the `{scene}` scenes" for scene in scenes_of(name)
        )
        rows.append((figures.figure(name).title, scenes))
    assumed = tuple(row for row in assumption_rows(content) if "follows from" not in row[1])
    notes = tuple((table.title, note) for table, new in _results(content.tables).values() for note in new)
    return {
        "figures": Table("", ("figure or table", "scenes"), tuple(rows)),
        "notes": Table("", ("table", "note"), notes),
        "assumptions": Table("", ("value", "assumption", "scenes"), assumed),
    }


def _results(tables: Mapping[str, Table]) -> dict[str, tuple[Table, list[str]]]:
    """Return the tables of results by name, verdicts first, each with the notes that no table before it has."""
    found: dict[str, tuple[Table, list[str]]] = {}
    for name, table in sorted(tables.items(), key=lambda item: item[0] != VERDICTS):
        if name in PARAMETERS:
            continue
        known = {note for _, notes in found.values() for note in notes}
        found[name] = table, [n for n in table.notes if n not in known and not n.startswith("What could not be")]
    return found


def _shown(name: str, table: Table, notes: Sequence[str]) -> str:
    """Return a table with its first notes: complete if it is short, of verdicts statement and verdict."""
    shown = f"{_pipe(table.columns, table.rows)}\n" if len(table.rows) <= SHOWN else ""
    if name == VERDICTS:
        shown = f"{_pipe(table.columns[1:3], [row[1:3] for row in table.rows])}\n"
    first = "".join(f"\n{note}\n" for note in notes[:NOTES])
    return f"### {table.title}\n\n{shown}[The table as CSV](paper/{name}.csv).\n{first}"


def _pipe(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = [" | ".join(heads), "|".join("---" for _ in heads), *(" | ".join(row) for row in rows)]
    return "\n".join(f"| {line} |" if "---" not in line else f"|{line}|" for line in lines) + "\n"


#: comments that generated pages put around their measurements
COMMENT = re.compile(r"<!--.*?-->\s*", re.DOTALL)


def section(page: Path, headings: Sequence[str] = (), pictures: Sequence[str] | None = None) -> str:
    """Return the text of a page below its title, as HTML; empty where the page does not exist.

    headings: of the sections to return; "" is the text before the first heading.  pictures: endings of the names of the
    pictures to show; default: all.
    """
    if not page.is_file():
        return ""
    parts = _parts(COMMENT.sub("", page.read_text(encoding="utf-8")))
    text = "\n\n".join(
        f"### {head}\n\n{body}" if head else body for head, body in parts if not headings or head in headings
    )
    return _pictures(_html(text, page.parent), page.parent, pictures)


def _parts(text: str) -> list[tuple[str, str]]:
    """Return heading and text of each section of second level."""
    pieces = re.split(r"^## (.+)$", re.sub(r"\A# .+\n", "", text), flags=re.MULTILINE)
    return [("", pieces[0].strip()), *((pieces[k].strip(), pieces[k + 1].strip()) for k in range(1, len(pieces), 2))]


def _html(text: str, folder: Path) -> str:
    from markdown_it import MarkdownIt

    def link(match: re.Match[str]) -> str:
        """Return a link to a table with the table inside; links between pages lead nowhere in one file."""
        file = folder / match[1]
        if file.suffix != ".csv" or not file.is_file():
            return f"<i>{match[2]}</i>"
        data = base64.b64encode(file.read_bytes()).decode()
        return f"<a download='{file.name}' href='data:text/csv;base64,{data}'>{match[2]}</a>"

    made: str = MarkdownIt("commonmark", {"html": False}).enable("table").render(text)
    made = re.sub(r'<a href="(?!https?:|#)([^"]*)">(.*?)</a>', link, made, flags=re.DOTALL)
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
        data = base64.b64encode(path.read_bytes()).decode()
        return f"<figure class='plot'><img src='data:image/png;base64,{data}' alt='{alt}'></figure>"

    return re.sub(r'<p>\s*<img src="([^"]+)" alt="([^"]*)"\s*/?>\s*</p>', shown, text)


#: most rows of a table and of the assumptions, and most notes on a table, that docs/paper.md shows
SHOWN, NOTES = 5, 2
#: the table with a verdict on each statement, and its words
VERDICTS = "table_verdicts"
GOOD, BAD = ("holds",), ("does not hold",)
#: tables with the paper's given parameters; the others compare results
GIVEN = ("table01", "table02", "table03", "table04", "table05", "table06")
#: those of them that only repeat parameters
PARAMETERS = ("table01", "table02", "table03", "table06")


@dataclass(frozen=True, slots=True)
class Content:
    """Contents of the page."""

    tables: Mapping[str, Table]
    assumptions: Sequence[Assumption]
    images: Mapping[str, bytes]  #: PNG of each figure, by name
    film: tuple[str, bytes] | None  #: file name and content
    still: bytes | None
    views: str  #: HTML of the views that can be turned
    facts: Mapping[str, Mapping[str, str]]  #: scene -> run attributes
    documents: Mapping[str, str]  #: name in DOCUMENTS -> HTML
    variants: Sequence[tuple[str, str]]  #: scene and title


def html_page(content: Content) -> str:
    """Return the report, results/report/index.html: one page with images and film inside."""
    drawn = "".join(media(f"{name}.png", png, figures.figure(name).title) for name, png in content.images.items())
    results = [table for name, table in content.tables.items() if name not in (*GIVEN, VERDICTS)]
    given = [content.tables[name] for name in GIVEN if name in content.tables]
    files = {f"{name}.csv": as_csv(table).encode() for name, table in content.tables.items()}
    parts = [
        Part("verdicts", "The verdict on every statement", _verdicts(content.tables.get(VERDICTS))),
        Part("film", "The mechanism moving", _film(content)),
        Part("figures", "Figures", drawn),
        Part("tables", "Tables", "".join(as_html(table) for table in results)),
        *(Part(key, heading, content.documents.get(key, "")) for key, (heading, *_) in DOCUMENTS.items()),
        Part("parameters", "Parameters, as the paper prints them and as they are here", "".join(map(as_html, given))),
        Part("variants", "Variants", prose(("scene", "what it is"), content.variants)),
        Part(
            "assumptions",
            "Assumptions, the most influential first",
            prose(("value", "assumption", "scenes"), assumption_rows(content)),
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
    """Return how many of the paper's statements hold, and list those that do not; empty without verdicts."""
    table = content.tables.get(VERDICTS)
    if table is None:
        return ""
    verdict = table.columns.index("verdict")
    verdicts = [row[verdict] for row in table.rows]
    counts = "; ".join(f"{_word(word)}: {verdicts.count(word)}" for word in dict.fromkeys(verdicts))
    lines = [f"<li>Of {len(verdicts)} statements of the paper, judged by rules: {counts}.</li>"]
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
