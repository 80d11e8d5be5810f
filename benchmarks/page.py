"""docs/benchmarks.md from the last log lines: `python -m benchmarks.page`."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import Any

from benchmarks.log import LOG, latest

PAGE = Path(__file__).parents[1] / "docs" / "benchmarks.md"
#: groups in the order in which they run and are shown, and the module of each
GROUPS = {"evaluation": "evaluation", "runs": "runs", "growth": "growth", "exudyn": "peer"}
HEAD = """# Benchmarks

Written by `python -m benchmarks` from `benchmarks/log.jsonl`; do not edit. `make bench` measures everything again,
`python -m benchmarks GROUP ...` some of it: {groups}.

All times are processor time on one thread, warm (kernels compiled, bundles made). What is compared is measured in
turns; ratios are medians of the ratios of neighbours. "± x %" is half the range of the middle half of the repeats.
"""


def write(log: Path = LOG, page: Path = PAGE) -> None:
    """Write the page; groups that were never measured are left out."""
    page.write_text(text(latest(log)))


def text(lines: dict[str, dict[str, Any]]) -> str:
    """The page of the log lines of some groups."""
    sections = [HEAD.format(groups=", ".join(f"`{name}`" for name in GROUPS))]
    for group in GROUPS:
        if group in lines:
            sections.append(_section(group, lines[group]))
    return "\n".join(sections)


def _section(group: str, line: dict[str, Any]) -> str:
    module = import_module(f"benchmarks.{GROUPS[group]}")
    what = "\n\n".join((m.__doc__ or "").strip() for m in (module, *getattr(module, "EXPLAINED_BY", ())))
    versions = ", ".join(f"{name} {number}" for name, number in line["versions"].items())
    where = f"Measured {line['date']} on {line['cpu']}; {versions}."
    return f"## {module.TITLE}\n\n{what}\n\n{where}\n\n{module.show(line['results'])}\n"


if __name__ == "__main__":
    write()
