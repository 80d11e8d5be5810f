"""TOML files: their tables, the line on which a key path like ``body.rod.mesh`` is written, and syntax errors in words.

The reader of the standard library gives no line numbers of keys, so they are searched for in the text.
"""

from __future__ import annotations

import copy
import re
import stat
import tomllib
from functools import lru_cache
from pathlib import Path
from typing import Any

from flexclear.scene.registry import suggestion
from flexclear.scene.units import unit
from flexclear.system.errors import InputError, InputErrors

#: largest size of a scene or recipe [bytes]: the TOML reader takes a second for the worst content of this size
LARGEST_FILE = 1 << 20
#: a key with more parts than a scene has levels; the TOML reader's time grows with their number squared
_PART = r"""(?:[\w-]++|"(?:[^"\\\n]|\\.)*+"|'[^'\n]*+')"""
DEEP = re.compile(rf"(?<![\w\\-])(?:{_PART}[ \t]*+\.[ \t]*+){{50}}")


def read_toml(path: Path) -> dict[str, Any]:
    """Read a TOML file as a table; raise InputError when it cannot be read or parsed."""
    try:
        status = path.stat()
        if not stat.S_ISREG(status.st_mode):
            raise InputError(str(path), "cannot be read: it is not an ordinary file", "name a TOML file")
        if status.st_size > LARGEST_FILE:
            raise InputError(
                str(path),
                f"is larger than {LARGEST_FILE >> 20} MB",
                "name a TOML file; put long tables of laws into a CSV file",
            )
        text = path.read_text(encoding="utf-8-sig")
        if DEEP.search(text):
            raise InputError(str(path), "nests tables too deeply to be read: a key has more than 50 parts")
        return copy.deepcopy(_parsed(text))
    except FileNotFoundError:
        raise InputError(str(path), "there is no such file", _neighbours(path)) from None
    except UnicodeDecodeError as error:
        raise InputError(str(path), f"is not text in UTF-8: {error.reason}", "name a TOML file") from None
    except OSError as error:
        raise InputError(str(path), f"cannot be read: {error.strerror}", "name a TOML file") from None
    except tomllib.TOMLDecodeError as error:
        raise not_toml(path, path.read_text(encoding="utf-8-sig"), str(error)) from None
    except RecursionError:
        raise InputError(str(path), "nests tables or lists too deeply to be read") from None
    except ValueError as error:  # a NUL in the path, or a number with more digits than Python reads
        raise InputError(str(path), f"cannot be read: {error}", "name a TOML file") from None


#: `check` reads a scene at several of its steps
_parsed = lru_cache(maxsize=16)(tomllib.loads)


def _neighbours(path: Path) -> str | None:
    if any("\\" in part for part in path.parts) or not str(path).isprintable():  # \ separates folders on Windows only
        return "write / between folders, which works on every system"
    names = [p.name for p in path.parent.glob("*.toml")] if path.parent.is_dir() else []
    return suggestion(path.name, names) if names else None


def recipe_frames(mesh: str) -> list[str] | None:
    """Return the names of the frames in a mesh recipe; None when it cannot be read, which is reported elsewhere."""
    try:
        frames = read_toml(Path(mesh)).get("frames")
    except (OSError, ValueError, InputError):
        return None
    return list(frames) if isinstance(frames, dict) else None


_KEY = r"""(?:[\w-]+|"[^"]*"|'[^']*')"""
_DOTTED = rf"{_KEY}(?:[ \t]*\.[ \t]*{_KEY})*"
_HEADER = re.compile(rf"^[ \t]*\[\[?[ \t]*({_DOTTED})[ \t]*\]\]?[ \t]*(?:#.*)?$")
_VALUE = re.compile(rf"^[ \t]*({_DOTTED})[ \t]*=")
_PLACE = re.compile(r"^(?P<file>.+\.toml) \[(?P<keys>[^\[\]]+)\]$")
_LINE = re.compile(r"^(?P<file>.+\.toml), line (?P<line>\d+)$")
#: prefixes of a key path in files that edit another
EDITS: tuple[tuple[str, ...], ...] = ((), ("replace",), ("set",))


def with_line_number(error: InputError) -> InputError:
    """Return the error with the line behind its key path, where a file contains the path; for several errors, each."""
    if isinstance(error, InputErrors):
        return InputErrors([with_line_number(one) for one in error.errors])
    position = locate_error(error)
    if position is None or _LINE.match(error.place):
        return error
    file, line = position
    match = _PLACE.match(error.place)
    other = "" if match is None or Path(match["file"]).resolve() == file.resolve() else f" of {file}"
    return InputError(f"{error.place}, line {line}{other}", error.problem, error.remedy)


def with_file_name(error: InputError, path: Path | None) -> InputError:
    """Return an error with the file before its place, where that is only a part of the file."""
    if isinstance(error, InputErrors):
        return InputErrors([with_file_name(one, path) for one in error.errors])
    if path is None or not error.place.startswith("["):
        return error
    return InputError(f"{path} {error.place}", error.problem, error.remedy)


def locate_error(error: InputError) -> tuple[Path, int] | None:
    """Return file and line of an error's key path, which may be written in a scene that the file extends."""
    if found := _LINE.match(error.place):
        return Path(found["file"]), int(found["line"])
    match = _PLACE.match(error.place)
    if match is None:
        return None
    return _position(Path(match["file"]), tuple(match["keys"].split(".")), ())


def _position(file: Path, keys: tuple[str, ...], above: tuple[Path, ...]) -> tuple[Path, int] | None:
    try:
        extends, lines = _base_and_lines(file.read_text(encoding="utf-8-sig"))
    except (OSError, ValueError):
        return None
    # of a path inside a part, the longest beginning that is written out, down to the part itself
    for length in range(len(keys), min(len(keys), 2) - 1, -1):
        for edit in EDITS:
            if (*edit, *keys[:length]) in lines:
                return file, lines[(*edit, *keys[:length])]
    if isinstance(extends, str) and file not in above:
        below = _position(file.parent / extends, keys, (*above, file))
        if below is not None:
            return below
    return (file, lines[keys[:1]]) if keys[:1] in lines else None


@lru_cache(maxsize=16)
def _base_and_lines(text: str) -> tuple[object, dict[tuple[str, ...], int]]:
    """Return the scene that a text extends, and the lines of its keys; cached, since one text may have many errors."""
    return tomllib.loads(text).get("extends"), lines_of_keys(text)


def lines_of_keys(text: str) -> dict[tuple[str, ...], int]:
    """Return the line on which each key of a TOML text is first written, tables included."""
    lines_of: dict[tuple[str, ...], int] = {}
    table: tuple[str, ...] = ()
    quote = ""
    for number, line in enumerate(text.splitlines(), start=1):
        if quote:  # inside a multi-line text
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


_NUMBER = re.compile(r"\(at line (\d+)")
_AT = re.compile(r" \(at (?:line \d+, column \d+|end of document)\)$")
_OTHER = "put names with characters other than A to z, digits, - and _ in quotation marks"
#: text in quotation marks, or a comment, both left unchanged; or a number and the text after it that may be a unit
_PARTS = re.compile(
    r"""("[^"]*"|'[^']*'|\#.*)"""
    r"""|(?<![\w.])([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)[ \t]*"""
    r"""((?:[^\W\d_]|[%°])[^,\]}\#"'=]*)"""
)


def not_toml(path: Path, text: str, message: str) -> InputError:
    """Return the error for a file with this text, which the TOML reader refused with this message."""
    if path.resolve().suffix != ".toml":  # a file that another one may name to have it quoted
        return InputError(str(path), "is not TOML", "name a TOML file, which ends with .toml")
    match, lines = _NUMBER.search(message), text.splitlines()
    number = int(match[1]) if match else 0
    line = lines[number - 1] if 0 < number <= len(lines) else ""
    where = f"{path}, line {number}" if number else str(path)
    problem, hint = _common_error(line) or _reader_message(message, line)
    return InputError(where, f"is not TOML: {problem}", hint)


def _common_error(line: str) -> tuple[str, str] | None:
    """Return the probable error in a line, and what to write instead; None where no common error fits."""
    bare = line.strip()
    value = re.match(r"([\w.\"'-]+)\s*=\s*(.*)$", bare)
    if bare.startswith(("//", ";", "/*")):
        return f"a comment begins with #: {bare}", f"write # {bare.lstrip('/;* ')}"
    if len(re.findall(r"(?<!\\)\"", bare.partition(" #")[0])) % 2:
        return (
            f"a quotation mark is missing: {bare}",
            'put text and quantities with units between two quotation marks: "1 mm"',
        )
    # 300: largest length of a line for which a correction is suggested
    quoted = _quote_quantities(line) if len(line) <= 300 else line
    if quoted != line:
        return f"a quantity with a unit needs quotation marks: {bare}", f"write {quoted.strip()}"
    if value and re.fullmatch(r"[-+]?\d+,\d+", value[2]):
        return f"a decimal comma is not allowed: {bare}", f"write {value[1]} = {value[2].replace(',', '.')}"
    if value and re.fullmatch(r"[A-Za-z][\w -]*", value[2]) and value[2] not in ("true", "false", "inf", "nan"):
        return f"text needs quotation marks: {bare}", f'write {value[1]} = "{value[2]}"'
    if value and not value[2].partition("#")[0]:
        return f"a value is missing: {bare}", "write one, or remove the line"
    colon = re.match(r"([\w.-]+)\s*:\s*(.+)$", bare)
    if colon:
        return f"key and value are joined by =: {bare}", f"write {colon[1]} = {colon[2]}"
    return None


def _reader_message(message: str, line: str) -> tuple[str, str | None]:
    """Return the TOML reader's message without the position in the text, and a hint where it needs one."""
    text = _AT.sub("", message)
    twice = re.match(r"Cannot declare \((.*?),?\) twice", text)
    if twice:
        name = ".".join(re.findall(r"'([^']*)'", twice[1]))
        return f"the table [{name}] is defined twice", "give it another name, or join both"
    if "Unescaped '\\'" in text or "hex value" in text:
        return f'\\ begins a special character in "...": {line.strip()}', "write / between folders, also on Windows"
    if text == "Cannot overwrite a value":
        return f"a key is given twice: {line.strip()}", "remove one of the two"
    if "key part" in text and line.strip().endswith("{"):
        return f"{text}: {line.strip()}", "write a table in { } on one line, or give it a [heading] of its own"
    if "Unclosed" in text or "Expected ']'" in text:
        hint = _OTHER if _odd_name(line) else "close each bracket, with commas between entries"
        return f"{text}: {line.strip()}", hint
    return text, _OTHER if "after a key" in text or "table declaration" in text else None


def _odd_name(line: str) -> bool:
    """Return True when a table's name has characters that TOML allows in quotation marks only."""
    return bool(re.match(r"\s*\[[^\]\"']*[^\]\"'\x00-\x7f]", line))


def _quote_quantities(line: str) -> str:
    """Return the line with its quantities in quotation marks."""

    def quote_with_unit(part: re.Match[str]) -> str:
        if part[1] is not None or unit(part[3]) is None:
            return part[0]
        rest = part[3][len(part[3].rstrip()) :]
        return f'"{part[2]} {part[3].strip()}"{rest}'

    return _PARTS.sub(quote_with_unit, line)
