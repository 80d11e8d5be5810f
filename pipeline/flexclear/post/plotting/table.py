"""A small table of text cells, written as CSV, Markdown and HTML."""

from __future__ import annotations

import csv
import html
import io
import re
from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Table:
    """Title, column heads, rows of text, and notes (one paragraph each)."""

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        wrong = [row for row in self.rows if len(row) != len(self.columns)]
        if wrong:
            raise ValueError(f"table '{self.title}' has {len(self.columns)} columns, but a row {wrong[0]}")


def files(name: str, table: Table) -> dict[str, bytes]:
    """Return the table as ``name.csv`` and ``name.md``."""
    return {f"{name}.csv": as_csv(table).encode(), f"{name}.md": as_markdown(table).encode()}


def as_csv(table: Table) -> str:
    """Return heads and rows as CSV; notes are not data and stay out."""
    buffer = io.StringIO()
    writer = csv.writer(buffer, lineterminator="\n")
    writer.writerow(table.columns)
    writer.writerows(table.rows)
    return buffer.getvalue()


def as_markdown(table: Table) -> str:
    """Return title, aligned pipe table and notes as Markdown."""
    notes = "".join(f"\n{note}\n" for note in table.notes)
    return f"**{table.title}**\n\n{pipe_table(table.columns, table.rows)}\n{notes}"


def pipe_table(columns: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a pipe table that reads the same on a terminal: the first column is text, the others are numbers."""
    width = [max(3, *(len(row[i]) for row in (columns, *rows))) for i in range(len(columns))]
    rule = "|".join(["", "-" * (width[0] + 2), *("-" * (w + 1) + ":" for w in width[1:]), ""])
    return "\n".join([_line(columns, width), rule, *(_line(row, width) for row in rows)])


def from_markdown(text: str) -> Table:
    """Return the table that `as_markdown` wrote; ValueError for other text."""
    blocks = text.strip().split("\n\n")
    lines = blocks[1].splitlines() if len(blocks) > 1 else []
    if not blocks[0].startswith("**") or len(lines) < 2 or not lines[0].startswith("|"):
        raise ValueError("not a table written by as_markdown")
    cells = [tuple(cell.strip() for cell in line.strip("|").split("|")) for line in lines]
    return Table(blocks[0].strip("*"), cells[0], tuple(cells[2:]), tuple(blocks[2:]))


def as_html(table: Table, *, prose: bool = False) -> str:
    """Return a ``<figure>`` with the table and its notes; `prose`: True when cells hold sentences."""
    head = "".join(f"<th scope='col'>{html.escape(column)}</th>" for column in table.columns)
    rows = "".join("<tr>" + "".join(f"<td>{html.escape(cell)}</td>" for cell in row) + "</tr>\n" for row in table.rows)
    # links between pages of the documentation lead nowhere from here
    footnotes = [re.sub(r"\[([^\]]+)\]\([^)]*\)", r"\1", note) for note in table.notes]
    notes = "".join(f"<p>{html.escape(note)}</p>\n" for note in footnotes)
    caption = html.escape(table.title)
    return (
        f"<figure class='table'><figcaption>{caption}</figcaption>\n<div "
        f"class='scroll' tabindex='0' role='region' aria-label='{html.escape(table.title, quote=True)}'>"
        f"<table class='sorts{' prose' if prose else ''}'><thead><tr>{head}</tr></thead>\n"
        f"<tbody>\n{rows}</tbody></table></div>\n{notes}</figure>\n"
    )


def _line(cells: Sequence[str], width: list[int]) -> str:
    padded = (c.ljust(w) if i == 0 else c.rjust(w) for i, (c, w) in enumerate(zip(cells, width, strict=True)))
    return "| " + " | ".join(padded) + " |"
