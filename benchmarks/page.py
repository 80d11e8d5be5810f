"""Pages of docs/ that hold measurements: the lines between two marks of a page are written from the log.

    <!-- begin growth -->      until <!-- end growth -->: Markdown of that family, or of one named part of it
    <!-- begin measured -->    until <!-- end measured -->: date and machine of the measurements, which appear only here

Everything else on a page is written by hand and is left unchanged. Long tables are CSV files in docs/tables, of which a
page shows the rows that its family names.
"""

from __future__ import annotations

import io
import re
from collections.abc import Callable, Iterable, Mapping
from importlib import import_module
from itertools import count
from pathlib import Path
from typing import Any

from benchmarks import families, log
from benchmarks.family import Family, Record
from benchmarks.log import Session
from flexclear.artifacts.paths import PROJECT
from flexclear.post.plotting.table import Table, as_csv, pipe_table
from flexclear.scene.registry import lookup
from flexclear.system.errors import InputError

DOCS = PROJECT / "docs"
#: columns of a table: heading, and the function that returns a record's cell
Columns = Mapping[str, Callable[[Record], str]]
#: most rows of a table that a page shows completely
LONG_TABLE = 5
#: longest list of a session's cases [characters]; a longer one is replaced by the number of cases
LONGEST_LIST = 80
#: the text where nothing was measured
NOTHING = "Not measured."


def named(name: str) -> Family:
    """Return the family with this name; raise InputError, which lists the known names, for any other."""
    of = lookup(families.NAMES, name, kind="benchmark", where="python -m benchmarks")
    module, _, attribute = of.partition(":")
    found: Family = getattr(import_module(f"{families.__name__}.{module}"), attribute)
    return found


def of_page(page: str) -> dict[str, Family]:
    """Return the families, by name, whose measurements are on a page."""
    return {name: family for name in families.NAMES if (family := named(name)).page == page}


def write(page: str, logs: Path = log.FOLDER, into: Path = DOCS) -> Path:
    """Write a page and its files from the logs in a folder; return the page's path."""
    (into / page).parent.mkdir(parents=True, exist_ok=True)
    (into / page).write_text(text(page, logs), encoding="utf-8", newline="\n")
    for path, content in files_of(page, logs).items():
        (into / path).parent.mkdir(parents=True, exist_ok=True)
        (into / path).write_bytes(content)
    return into / page


def text(page: str, logs: Path = log.FOLDER) -> str:
    """Return a page whose lines between marks are filled from the logs."""
    parts = dict[str, str]()
    sessions = {name: log.latest(logs / f"{name}.jsonl") for name in of_page(page)}
    for name, family in of_page(page).items():
        if sessions[name]:
            parts |= shown(name, family, records(sessions[name]))[0]
    parts["measured"] = where({name: of for name, of in sessions.items() if of})
    return filled((DOCS / page).read_text(encoding="utf-8"), parts, f"docs/{page}")


def files_of(page: str, logs: Path = log.FOLDER) -> dict[str, bytes]:
    """Return the files that belong to a page, by path below docs/."""
    found: dict[str, bytes] = {}
    for name, family in of_page(page).items():
        if sessions := log.latest(logs / f"{name}.jsonl"):
            found |= {**family.files(records(sessions)), **shown(name, family, records(sessions))[1]}
    return found


def shown(name: str, family: Family, records: list[Record]) -> tuple[dict[str, str], dict[str, bytes]]:
    """Return the Markdown of a family by its place on the page, and its long tables as CSV files below docs/."""
    found, tables = family.show(records), dict[str, bytes]()
    parts = {name: found} if isinstance(found, str) else {f"{name} {part}": of for part, of in found.items()}
    return {
        place: shortened(text, place.replace(" ", "-"), family.rows, tables) for place, text in parts.items()
    }, tables


def shortened(text: str, name: str, rows: str, tables: dict[str, bytes]) -> str:
    """Return Markdown with few rows of each long table, and add the complete ones to `tables` as CSV, by path.

    rows: pattern of the rows that stay; without any the first two and the last one.
    """

    def few(found: re.Match[str]) -> str:
        head, rule, *lines = found[0].splitlines()
        kept = [line for line in lines if rows and re.search(rows, line)] or [*lines[:2], *lines[-1:]]
        if len(lines) <= LONG_TABLE or kept == lines:
            return found[0]
        path = next(p for k in count(1) if (p := f"tables/{name}{f'-{k}' if k > 1 else ''}.csv") not in tables)
        cells = [tuple(cell.strip() for cell in line.strip("|").split("|")) for line in (head, *lines)]
        tables[path] = as_csv(Table("", cells[0], tuple(cells[1:]))).encode()
        return "\n".join([head, rule, *kept, "", f"[All {len(lines)} rows]({path}).", ""])

    return re.sub(r"(?:^\|.*(?:\n|\Z))+", few, text, flags=re.MULTILINE)


def records(sessions: list[Session]) -> list[Record]:
    """Return the records of some sessions in one list."""
    return [record for session in sessions for record in session.records]


def filled(page: str, parts: Mapping[str, str], place: str) -> str:
    """Return a page with new text between its marks; raise InputError when the page has no marks for a part."""
    found = re.split(r"<!-- begin (.+?) -->\n.*?<!-- end \1 -->\n", page, flags=re.DOTALL)
    if missing := sorted(parts.keys() - set(found[1::2])):
        marks = " and ".join(f"<!-- {word} {missing[0]} -->" for word in ("begin", "end"))
        raise InputError(place, f"has no place for '{missing[0]}'", f"write {marks}")
    for k, name in enumerate(found[1::2]):
        found[2 * k + 1] = f"<!-- begin {name} -->\n\n{parts.get(name, NOTHING).strip()}\n\n<!-- end {name} -->\n"
    return "".join(found)


def where(measured: Mapping[str, list[Session]]) -> str:
    """Return date and machine of a page's measurements: one sentence, or a list where sessions differ."""
    by_session: dict[str, list[str]] = {}
    for name, sessions in measured.items():
        cases: dict[str, list[str]] = {}
        for session in sessions:
            cases.setdefault(session_words(session), []).extend(record["case"] for record in session.records)
        for words, mine in cases.items():
            names = list(dict.fromkeys(mine))
            listed = ", ".join(names)
            listed = listed if len(listed) <= LONGEST_LIST else f"{len(names)} case{'s' * (len(names) > 1)}"
            by_session.setdefault(words, []).append(name if len(cases) == 1 else f"{name} ({listed})")
    if len(by_session) == 1:
        return f"Measured {next(iter(by_session))}."
    return "Measured:\n\n" + "\n".join(f"- {', '.join(parts)}: {session}" for session, parts in by_session.items())


def session_words(session: Session) -> str:
    """Return date, machine and versions of a session in words."""
    versions = "".join(f", {name} {number}" for name, number in session.versions.items())
    machine = f"{session.measured} on {session.cpu or 'an unrecorded machine'}{versions}"
    return f"{machine} ({session.note})" if session.note else machine


def table(records: Iterable[Record], columns: Columns) -> str:
    """Return a Markdown table with one row for each record."""
    return pipe_table(tuple(columns), [[cell(record) for cell in columns.values()] for record in records])


def csv_table(records: Iterable[Record], columns: Columns) -> bytes:
    """Return the same table as CSV."""
    rows = tuple(tuple(cell(record) for cell in columns.values()) for record in records)
    return as_csv(Table("", tuple(columns), rows)).encode()


def spread(time: Mapping[str, float], unit: str, digits: int) -> str:
    """Return a time of the log with half the interquartile range of its repeats."""
    return f"{time[unit]:.{digits}f} ± {percent(time['spread'])}"


def mean(record: Record, name: str, factor: float = 1.0, digits: int = 0) -> str:
    """Return a mean over the members of an ensemble and its standard deviation; of a single run the value alone."""
    value = f"{factor * record[name]:.{digits}f}"
    return value if record.get("members") == 1 else f"{value} ± {factor * record[f'{name}_std']:.{digits}f}"


def percent(fraction: float) -> str:
    """Return a fraction as a percentage with one decimal."""
    return f"{100 * fraction:.1f} %"


def short(value: float) -> str:
    """Return a value with three significant digits; with an exponent below 1e-3 and from 1e4 on."""
    return f"{value:.3g}" if value == 0.0 or 1e-3 <= abs(value) < 1e4 else f"{value:.1e}"


def png(figure: Any, **how: Any) -> bytes:
    """Return a matplotlib figure as PNG, without the library's version, so that equal records give equal bytes."""
    from matplotlib import pyplot as plt

    file = io.BytesIO()
    figure.savefig(file, metadata={"Software": None}, **how)
    plt.close(figure)
    return file.getvalue()
