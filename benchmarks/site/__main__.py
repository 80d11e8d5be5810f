"""``python -m benchmarks.site``: write the pages of docs/ that follow from the sources; ``--check``: compare only."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from functools import partial

from benchmarks.page import DOCS
from benchmarks.site import keys, reference

#: page below docs/ -> function that returns its text
PAGES: dict[str, Callable[[], str]] = {
    "reference/python.md": reference.python,
    "datasets.md": reference.datasets,
    "datasets/variables.csv": reference.variables,
    "reference/quantities.md": reference.quantities,
    **{f"reference/{kind}.md": partial(keys.page, kind) for kind in keys.HEADS},
}


def main(arguments: list[str] | None = None) -> int:
    """Write or compare the pages; return 1 when a comparison finds outdated pages, else 0."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.site", description=__doc__)
    parser.add_argument("--check", action="store_true", help="tell which pages are out of date; write nothing")
    options = parser.parse_args(arguments)
    old = stale()
    for page, text in old.items():
        if options.check:
            print(f"docs/{page} is not what the sources say: python -m benchmarks.site writes it again")
        else:
            (DOCS / page).parent.mkdir(parents=True, exist_ok=True)
            (DOCS / page).write_text(text, encoding="utf-8", newline="\n")
            print(f"docs/{page}")
    return int(options.check and bool(old))


def stale() -> dict[str, str]:
    """Return the new texts of the outdated pages, by page."""
    made = {page: make() for page, make in PAGES.items()}
    present = {page: (DOCS / page).read_text(encoding="utf-8") for page in made if (DOCS / page).is_file()}
    return {page: text for page, text in made.items() if present.get(page) != text}


if __name__ == "__main__":
    sys.exit(main())
