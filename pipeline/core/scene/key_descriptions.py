"""What the keys of a part mean, in words, from the docstring of its class: ``key: text.  other, keys: text.``"""

from __future__ import annotations

import inspect
import re
from collections.abc import Collection

from flexclear.pipeline.core.scene.citations import docstring


def meanings(part: type, keys: Collection[str]) -> dict[str, str]:
    """Meaning of each of the keys that a class, or one that it is made from, describes in its docstring.

    >>> class Pin:
    ...     '''A pin.  radius: outer one.  from, to: its ends [m], of which
    ...     the second is free.'''
    >>> meanings(Pin, ["radius", "from", "to", "colour"])["from"]
    'its ends [m], of which the second is free'
    """
    descriptions: dict[str, str] = {}
    for owner in reversed(part.__mro__):
        descriptions |= _descriptions(" ".join(inspect.cleandoc(docstring(owner) or "").split()), keys)
    return descriptions


def _descriptions(text: str, keys: Collection[str]) -> dict[str, str]:
    if not keys:
        return {}
    one = "(?:" + "|".join(re.escape(key) for key in sorted(keys, key=len, reverse=True)) + ")"
    marks = list(re.finditer(rf"(?:^|(?<=[.;:] ))({one}(?:, {one}| and {one})*)( \[[^\]]*\])?: ", text))
    ends = [mark.start() for mark in marks[1:]] + [len(text)]
    descriptions: dict[str, str] = {}
    for mark, end in zip(marks, ends, strict=False):
        words = text[mark.end() : end].strip().removesuffix(".").removesuffix(";") + (mark[2] or "")
        descriptions |= dict.fromkeys(re.split(", | and ", mark[1]), words)
    return descriptions
