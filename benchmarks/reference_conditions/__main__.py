"""``python -m benchmarks.reference_conditions``: bring all runs up to date, write docs/reference-conditions.md."""

from __future__ import annotations

# first of all: it pins BLAS to one thread, which NumPy reads when it is imported
import pipeline  # noqa: F401  isort: skip

import argparse
import json
import sys
from pathlib import Path
from typing import Any

from benchmarks.reference_conditions import measure, page
from pipeline.core.errors import FlexclearError
from stages.run import workplace

DOCS = Path(__file__).parents[2] / "docs"
DATA = DOCS / "reference-conditions" / "measured.json"
GROUPS = ("statics", "mesh", "frequencies", "far", "clearance")
MEMBERS = 8


def main() -> int:
    """Measure what is asked for, keep the numbers beside the page, write the page; exit code as of `flexclear`."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.reference_conditions", description=__doc__)
    parser.add_argument("--only", action="append", choices=GROUPS, help="only this group; the others stay as they were")
    parser.add_argument("--page", action="store_true", help="only write the page again from the kept numbers")
    parser.add_argument(
        "--members",
        type=int,
        default=MEMBERS,
        help="members of each ensemble (of sets beyond 13 coordinates, half of them)",
    )
    options = parser.parse_args()
    DATA.parent.mkdir(parents=True, exist_ok=True)
    rows: dict[str, Any] = json.loads(DATA.read_text()) if DATA.is_file() else {}
    try:
        for group in [] if options.page else options.only or GROUPS:
            rows[group] = _measured(group, options.members)
            DATA.write_text(json.dumps(rows, indent=1))
            print(f"{group}: {len(rows[group])} rows", file=sys.stderr, flush=True)
    except FlexclearError as error:
        print(error, file=sys.stderr)
        return error.exit_code
    print(page.write(rows, DOCS))
    return 0


def _measured(group: str, members: int) -> list[measure.Row]:
    if group == "statics":
        return list(measure.static_rows())
    if group == "mesh":
        return list(measure.mesh_rows())
    if group == "frequencies":
        return list(measure.frequency_rows())
    if group == "far":
        return list(measure.far_rows(workplace()))
    return list(measure.clearance_rows(workplace(), members))


if __name__ == "__main__":
    sys.exit(main())
