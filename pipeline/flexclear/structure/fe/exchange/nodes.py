"""Nodes and named node sets in files of other finite element codes: input decks, which meshio reads without numbers."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import NoReturn

import numpy as np

from flexclear.structure.fe.exchange import ansys
from flexclear.system import machine
from flexclear.system.errors import InputError
from flexclear.system.external_files import companion_files, convert_reader_errors, require_file

#: memory of a deck's lines over the size of the file
COPIES = 8.0
#: keywords of Abaqus and CalculiX after which numbers, positions or directions of nodes are not those of the deck
REFUSED = ("NGEN", "NFILL", "NCOPY", "NMAP", "SYSTEM", "TRANSFORM", "EXPAND")
#: a number of Nastran without the letter of its exponent
BARE = re.compile(r"([\d.])([+-]\d+)$")
AGAIN = "the file was cut or damaged: write it again"
CARDS = ("GRID", "GRDSET", "SET1", "DMIG", "INCLUDE")


@dataclass
class Nodes:
    """Positions of the nodes by their numbers, and numbers by names of sets; in units of the file."""

    position: dict[int, tuple[float, ...]] = field(default_factory=dict)
    sets: dict[str, np.ndarray] = field(default_factory=dict)


def read(path: Path, where: str) -> Nodes:
    """Read the nodes of a deck: `.inp` of Abaqus and CalculiX, `.cdb` of Ansys, any other name for Nastran."""
    require_file(path, where)
    machine.require_memory(COPIES * path.stat().st_size, f"{where}: '{path.name}'", "write its nodes and sets alone")
    suffix = path.suffix.lower()
    with convert_reader_errors(path, where, f"'{path.name}' has no readable nodes", "write the deck again"):
        if suffix == ".cdb":
            arrays = ansys.arrays(path, where)
            nodes = Nodes(
                dict(zip(arrays.pop("node").tolist(), map(tuple, arrays.pop("position").tolist()), strict=True))
            )
            nodes.sets |= {name.removeprefix("set "): numbers for name, numbers in arrays.items()}
        else:
            for file in companion_files(path):  # refuses includes in a circle
                require_file(file, where)
            nodes = _of_keywords(path, where) if suffix == ".inp" else _of_cards(path, where)
        if not nodes.position or not np.isfinite(list(nodes.position.values())).all():
            raise ValueError("it has no nodes, or nodes at positions that are not three finite numbers")
    return nodes


def _of_keywords(path: Path, where: str) -> Nodes:
    nodes, keyword = Nodes(), ""
    chosen: dict[str, set[int]] = {}
    options: dict[str, str] = {}
    instances = 0
    for file, number, line in _lines(path):
        if line.startswith("*"):
            keyword, *rest = [part.strip() for part in line[1:].upper().split(",")]
            pairs = (part.partition("=")[::2] for part in rest)
            options = {name.strip(): value.strip().strip('"') for name, value in pairs}
            instances += keyword == "INSTANCE"
            if keyword in REFUSED or instances > 1 or (keyword == "NODE" and "SYSTEM" in options):
                problem = f"*{keyword} changes numbers or axes of nodes"
                refuse_line(file, number, where, problem, "write a flat deck without it")
            continue
        with locate_unreadable_number(file, number, where):
            parts = [part.strip() for part in line.rstrip(",").split(",")]
            if keyword == "INSTANCE":
                refuse_line(file, number, where, "*INSTANCE moves its nodes", "write a flat deck without it")
            elif keyword == "NODE":
                label, *position = int(parts[0]), *map(float, parts[1:4])
                if label in nodes.position:
                    refuse_line(file, number, where, f"node {label} is defined twice", "write each node once")
                nodes.position[label] = (*position, 0.0, 0.0)[:3]
                if "NSET" in options:
                    chosen.setdefault(options["NSET"], set()).add(label)
            elif keyword == "NSET":
                if "GENERATE" in options:
                    first, last, step = (*map(int, parts), 1)[:3]
                    parts = [str(n) for n in nodes.position if first <= n <= last and (n - first) % max(step, 1) == 0]
                for part in filter(None, parts):
                    known = chosen.get(part.upper())
                    chosen.setdefault(options["NSET"], set()).update([int(part)] if known is None else known)
    nodes.sets = {name: np.array(sorted(numbers), dtype=np.int64) for name, numbers in chosen.items()}
    return nodes


def _lines(path: Path) -> Iterator[tuple[Path, int, str]]:
    """Yield file, number and text of the lines of a deck and its includes, without comments."""
    with path.open(encoding="utf-8", errors="replace") as file:
        for number, line in enumerate(file, 1):
            text = line.strip()
            if not text or text.startswith("**"):
                continue
            if text.partition(",")[0].strip().replace("*", "").upper() == "INCLUDE":
                name = Path(text.split("=")[-1].strip())
                yield from _lines(name if name.exists() else path.parent / name)
            else:
                yield path, number, text


def _of_cards(path: Path, where: str) -> Nodes:
    nodes = Nodes()
    sets: list[tuple[str, list[int], range]] = []
    for number, name, values in cards(path):
        if name == "INCLUDE":
            refuse_line(path, number, where, "INCLUDE is not followed", "write the deck as one file")
        if name in ("GRID", "GRDSET"):
            values += [""] * 8
            if any(values[k].strip() not in ("", "0") for k in (1, 5)):
                problem = f"{name} {values[0].strip()} has its position or displacements in a local system"
                refuse_line(path, number, where, problem, "write CP and CD in the basic system")
        if name == "GRID":
            with locate_unreadable_number(path, number, where):
                nodes.position[int(values[0])] = tuple(parse_real(value) for value in values[2:5])
        if name == "SET1":
            with locate_unreadable_number(path, number, where):
                label, *members = [value.upper() for value in values if value]
                if "THRU" in members:
                    first, _, last = members
                    sets.append((label, [], range(int(first), int(last) + 1)))
                else:
                    sets.append((label, [int(node) for node in members], range(0)))
    for label, numbers, interval in sets:  # nodes may come after the sets of them
        inside = (node for node in nodes.position if node in interval)
        nodes.sets[label] = np.array(sorted({*numbers, *inside}), dtype=np.int64)
    return nodes


def cards(path: Path) -> Iterator[tuple[int, str, list[str]]]:
    """Yield line number, name and fields of the entries of a Nastran file that are read here, in any of its formats."""
    found: tuple[int, str, list[str]] | None = None
    with path.open(encoding="utf-8", errors="replace") as file:
        for number, line in enumerate(file, 1):
            text = line.split("$", 1)[0].rstrip().expandtabs(8)
            if not text:
                continue
            head, values = _fields(text)
            if head[:1] in ("", "+", "*"):
                if found is not None:
                    found[2].extend(values)
                continue
            if found is not None:
                yield found
            name = head.rstrip("*").upper()
            found = (number, name, values) if name in CARDS else None
            if text.lstrip().upper().startswith("INCLUDE"):
                found = (number, "INCLUDE", [])
    if found is not None:
        yield found


def _fields(text: str) -> tuple[str, list[str]]:
    """Return the name and the 4 (large) or 8 fields of a line; a line without some fields is filled up."""
    if "," in text:
        head, *values = [part.strip() for part in text.split(",")]
        width = 4 if "*" in head else 8
        return head, (values + [""] * width)[:width]
    head = text[:8].strip()
    size, width = (16, 4) if "*" in head else (8, 8)
    return head, [text[8 + size * k : 8 + size * (k + 1)].strip() for k in range(width)]


def parse_real(text: str) -> float:
    """Return a number of Nastran: 1.5, 1.5D-3, 1.5-3; an empty field is zero."""
    return float(BARE.sub(r"\1E\2", text.strip().upper().replace("D", "E"))) if text.strip() else 0.0


@contextmanager
def locate_unreadable_number(path: Path, number: int, where: str) -> Iterator[None]:
    """Raise InputError with the line of a file for a number that cannot be read."""
    try:
        yield
    except (ValueError, KeyError, IndexError):
        refuse_line(path, number, where, "cannot be read", AGAIN)


def refuse_line(path: Path, number: int, where: str, problem: str, remedy: str) -> NoReturn:
    """Raise InputError for a line of a file."""
    raise InputError(where, f"line {number} of '{path.name}': {problem}", remedy)
