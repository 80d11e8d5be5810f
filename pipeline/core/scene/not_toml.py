"""What is wrong with a file that is not TOML, in words, with its line and, where it can be guessed, the line mended."""

from __future__ import annotations

import re
from pathlib import Path

from pipeline.core.errors import InputError
from pipeline.core.units import unit

#: characters of a line that is worth mending
LONGEST = 300
_LINE = re.compile(r"\(at line (\d+)")
#: text in quotation marks, or a comment, both left alone; or a number and what stands after it like a unit
_PARTS = re.compile(
    r"""("[^"]*"|'[^']*'|\#.*)"""
    r"""|(?<![\w.])([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)[ \t]*"""
    r"""((?:[^\W\d_]|[%°])[^,\]}\#"'=]*)"""
)


def not_toml(path: Path, text: str, message: str) -> InputError:
    """The error of a file with this text, which the reader of TOML refuses with this message."""
    found, lines = _LINE.search(message), text.splitlines()
    number = int(found[1]) if found else 0
    line = lines[number - 1] if 0 < number <= len(lines) else ""
    quoted = _quoted(line) if len(line) <= LONGEST else line
    if quoted != line:
        rule = f"a quantity with a unit needs quotation marks: {line.strip()}"
        return InputError(f"{path}, line {number}", f"is not TOML: {rule}", f"write {quoted.strip()}")
    hint = None
    if "at the end of a table declaration" in message or "after a key" in message:
        hint = "names with other characters than letters A to z, digits, - and _ stand in quotation marks"
    return InputError(str(path), f"is not TOML: {message}", hint)


def _quoted(line: str) -> str:
    """The line with its quantities in quotation marks."""

    def mended(part: re.Match[str]) -> str:
        if part[1] is not None or unit(part[3]) is None:
            return part[0]
        rest = part[3][len(part[3].rstrip()) :]
        return f'"{part[2]} {part[3].strip()}"{rest}'

    return _PARTS.sub(mended, line)
