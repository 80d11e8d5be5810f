"""Text of a scene from its parts: TOML with comments."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from textwrap import wrap
from typing import Any

import numpy as np

#: largest number of characters of a line of the head
WIDTH = 110


@dataclass
class Draft:
    """A scene while it is put together.

    parts: family, name -> keys of the part; comments: family and name -> what is said above a part, or a family.
    changed, lost: sentences of the head on what differs from the robot's file, and on what is not taken over.
    """

    parts: dict[str, dict[str, dict[str, Any]]] = field(default_factory=dict)
    comments: dict[str, str] = field(default_factory=dict)
    changed: list[str] = field(default_factory=list)
    lost: list[str] = field(default_factory=list)

    def add(self, family: str, name: str, part: dict[str, Any], comment: str = "") -> None:
        """Add a part, with a comment if it has one."""
        self.parts.setdefault(family, {})[name] = part
        if comment:
            self.comments[f"{family}.{name}"] = comment


def scene_text(head: Sequence[str], top: Mapping[str, Any], draft: Draft, end: Mapping[str, Any]) -> str:
    """Return the text of a scene.

    head: paragraphs of comments before it.  top: keys and tables before the parts.  end: tables after them.
    """
    lines = [line for paragraph in head for line in _comment(paragraph) or ["#"]]
    lines += [f"{key} = {value(one)}" for key, one in top.items() if not isinstance(one, Mapping)]
    tables = [("", f"[{key}]", *_keys(one)) for key, one in top.items() if isinstance(one, Mapping)]
    lines += [line for table in tables for line in table]
    for family, parts in draft.parts.items():
        lines += ["", *_comment(draft.comments.get(family, family))]
        for name, part in parts.items():
            lines += [
                "",
                *_comment(draft.comments.get(f"{family}.{name}", "")),
                f"[{family}.{_key(name)}]",
                *_keys(part),
            ]
    for key, one in end.items():
        lines += ["", f"[{key}]", *_keys(one)]
    return "\n".join(lines) + "\n"


def _comment(text: str) -> list[str]:
    """Return the lines of a comment; a text that begins with "- " is an item of a list, an empty one is none."""
    plain = "".join(c if c.isprintable() else " " for c in text)
    if plain.startswith("  "):  # a command
        return [f"# {plain}"]
    indent = "  " if plain.startswith("- ") else ""
    return [f"# {line}" for line in wrap(plain, WIDTH, subsequent_indent=indent, break_long_words=False)]


def _keys(part: Mapping[str, Any]) -> Iterator[str]:
    """Yield the lines of a part; of tables of tables, such as frames, a line each."""
    for key, one in part.items():
        if isinstance(one, Mapping) and all(isinstance(inner, Mapping) for inner in one.values()) and one:
            yield from (f"{key}.{_key(name)} = {value(inner)}" for name, inner in one.items())
        elif isinstance(one, list) and one and isinstance(one[0], Mapping):
            yield from (f"{key} = [", *(f"    {value(inner)}," for inner in one), "]")
        else:
            yield f"{key} = {value(one)}"


def _key(name: str) -> str:
    """Return a key, in quotes where it needs them."""
    return name if re.fullmatch(r"[A-Za-z0-9_-]+", name) else json.dumps(name)


def value(one: Any) -> str:
    """Return a value as TOML; numbers with 15 digits, which leave out rounding."""
    if isinstance(one, bool):
        return str(one).lower()
    if isinstance(one, (float, int, np.floating, np.integer)):
        return f"{float(one) + 0.0:.15g}"
    if isinstance(one, str):
        return json.dumps(one, ensure_ascii=False)
    if isinstance(one, Mapping):
        inner = ", ".join(f"{_key(key)} = {value(item)}" for key, item in one.items())
        return f"{{ {inner} }}" if inner else "{}"
    return f"[{', '.join(value(item) for item in one)}]"
