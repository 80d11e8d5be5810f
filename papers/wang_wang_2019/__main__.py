"""Every figure and table of the paper, and the page with all of them: ``python -m papers.wang_wang_2019``."""

from __future__ import annotations

import argparse
import os
import sys

import flexclear as fc
from flexclear.applications import add_options, check, open_workplace
from papers.wang_wang_2019 import tasks


def main() -> None:
    """Bring everything on the page up to date and print where the page is.

    Parts that fail are left out of the page and raised after the page is written.
    """
    parser = argparse.ArgumentParser(prog="python -m papers.wang_wang_2019", description=__doc__)
    add_options(parser, "jobs", "limit", "said")
    options = parser.parse_args()
    workplace = open_workplace(options)
    outcome = tasks.bring(workplace)
    check(outcome)
    print(os.path.relpath(workplace.store.root / "report" / "index.html"))


if __name__ == "__main__":
    sys.exit(fc.exit_code(main))
