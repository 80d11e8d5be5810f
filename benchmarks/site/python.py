"""docs/reference/python.md: what `import flexclear` brings, from its docstrings."""

from __future__ import annotations

import inspect

import flexclear as fc

HEAD = """# Python

`import flexclear as fc` brings the functions below. All but `load_scene`, `edited` and `open` bring results up to date
first: what is fresh comes from the cache. Examples run as tests. What the datasets hold is in
[datasets.md](../datasets.md), which errors there are at the end of this page.

"""
ERRORS = """## What stays

Public are the names in `fc.__all__`, the keys of scene files, recipes and sweeps, the commands with their options and
exit codes, and the variables of [datasets.md](../datasets.md). A release that breaks one of them has a new first
number. Before that the old name works for at least one release and warns (`DeprecationWarning`, or one line of the
command), and CHANGELOG.md names what replaces it. Everything else may change with each release, `flexclear.pipeline`
and `flexclear.stages` included.

## Errors

All are `fc.FlexclearError`: `fc.InputError` where something given is wrong (the message names the place, the value, the
rule and the remedy), `fc.SolverError` where a computation refuses or gives up (with the time, the part and the reason),
and `fc.ResourceError` where the machine lacks memory or disk. The command ends with the exit codes 2, 3 and 4 for them.
"""


def text() -> str:
    """The page."""
    names = [name for name in fc.__all__ if inspect.isfunction(getattr(fc, name, None))]
    return HEAD + "".join(_section(name) for name in names) + ERRORS


def _section(name: str) -> str:
    function = getattr(fc, name)
    signature = str(inspect.signature(function)).replace("'", "")
    text, _, example = (inspect.getdoc(function) or "").partition("\n\n>>> ")
    shown = f"```python\n>>> {example}\n```\n\n" if example else ""
    return f"## {name}\n\n```python\nfc.{name}{signature}\n```\n\n{text}\n\n{shown}"
