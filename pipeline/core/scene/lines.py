"""Where in a TOML file a path like ``body.rod.mesh`` is written: errors then name the line.

The reader of the standard library gives no line numbers, so that keys are searched for in the text.
"""

from __future__ import annotations

import re
import tomllib
from functools import lru_cache
from pathlib import Path

from flexclear.pipeline.core.system.errors import InputError, InputErrors

_KEY = r"""(?:[\w-]+|"[^"]*"|'[^']*')"""
_DOTTED = rf"{_KEY}(?:[ \t]*\.[ \t]*{_KEY})*"
_HEADER = re.compile(rf"^[ \t]*\[\[?[ \t]*({_DOTTED})[ \t]*\]\]?[ \t]*(?:#.*)?$")
_VALUE = re.compile(rf"^[ \t]*({_DOTTED})[ \t]*=")
_PLACE = re.compile(r"^(?P<file>.+\.toml) \[(?P<keys>[^\[\]]+)\]$")
#: tables of edits that a path may stand below
EDITS: tuple[tuple[str, ...], ...] = ((), ("replace",), ("set",))


def located(error: InputError) -> InputError:
    """The error with the line of its path behind the path, where a file has it; of several, each."""
    if isinstance(error, InputErrors):
        return InputErrors([located(one) for one in error.errors])
    position = where(error)
    if position is None:
        return error
    file, line = position
    said = _PLACE.match(error.place)
    other = "" if said is None or Path(said["file"]).resolve() == file.resolve() else f" of {file}"
    return InputError(f"{error.place}, line {line}{other}", error.problem, error.remedy)


def where(error: InputError) -> tuple[Path, int] | None:
    """File and line of an error's path; the path may be written in a scene that its file extends."""
    said = _PLACE.match(error.place)
    if said is None:
        return None
    return _found(Path(said["file"]), tuple(said["keys"].split(".")), ())


def _found(file: Path, keys: tuple[str, ...], above: tuple[Path, ...]) -> tuple[Path, int] | None:
    try:
        extends, lines = _read(file.read_text(encoding="utf-8-sig"))
    except (OSError, ValueError):
        return None
    # the part itself: of a path below it, the nearest key that is written out
    for length in range(len(keys), min(len(keys), 2) - 1, -1):
        for edit in EDITS:
            if (*edit, *keys[:length]) in lines:
                return file, lines[(*edit, *keys[:length])]
    if isinstance(extends, str) and file not in above:
        below = _found(file.parent / extends, keys, (*above, file))
        if below is not None:
            return below
    return (file, lines[keys[:1]]) if keys[:1] in lines else None


@lru_cache(maxsize=16)
def _read(text: str) -> tuple[object, dict[tuple[str, ...], int]]:
    """What a text extends, and its lines; many mistakes are searched for in one text."""
    return tomllib.loads(text).get("extends"), written(text)


def written(text: str) -> dict[tuple[str, ...], int]:
    """The line on which each key of a TOML text is first written, tables included."""
    lines_of: dict[tuple[str, ...], int] = {}
    table: tuple[str, ...] = ()
    quote = ""
    for number, line in enumerate(text.splitlines(), start=1):
        if quote:  # inside of a text over several lines
            quote = "" if quote in line else quote
            continue
        header, value = _HEADER.match(line), _VALUE.match(line)
        keys: tuple[str, ...] = ()
        if header:
            table = keys = _keys(header[1])
        elif value:
            keys = (*table, *_keys(value[1]))
            quote = next((q for q in ('"""', "'''") if line.count(q) == 1), "")
        for length in range(1, len(keys) + 1):
            lines_of.setdefault(keys[:length], number)
    return lines_of


def _keys(dotted: str) -> tuple[str, ...]:
    return tuple(key.strip("\"'") for key in re.findall(_KEY, dotted))
