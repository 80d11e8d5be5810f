"""Every figure and table of the paper, and the page with all of them: ``python -m papers.wang_wang_2019``."""

from __future__ import annotations

import argparse
import sys

import flexclear as fc
from flexclear.post.render import gl
from flexclear.stages.workplace import add_options, check, open_workplace, relative
from flexclear.study.report import publish_page
from papers.wang_wang_2019 import tasks


def main() -> None:
    """Bring everything on the page up to date and print where the page is.

    Parts that fail are left out of the page and raised after the page is written.
    """
    parser = argparse.ArgumentParser(prog="python -m papers.wang_wang_2019", description=__doc__)
    parser.add_argument("--folder", action="store_true", help="write a folder with the page and its pictures")
    add_options(parser, "jobs", "limit", "said")
    options = parser.parse_args()
    workplace = open_workplace(options)
    outcome = tasks.bring(workplace)
    if gl.state().endswith("none"):
        workplace.monitor.say(f"shapes are drawn as lines and there is no film: {gl.remedy()}")
    check(outcome)
    page = workplace.store.root / "report" / "index.html"
    if options.folder:
        page = publish_page(page.parent, "folder", page.read_bytes(), folder=True)
    print(relative(page))


if __name__ == "__main__":
    sys.exit(fc.exit_code(main))
