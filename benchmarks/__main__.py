"""`python -m benchmarks [group ...]`: measure, print tables, append to the log, write docs/benchmarks.md."""

from __future__ import annotations

# first of all: it pins BLAS to one thread, which NumPy reads when it is imported
import pipeline  # noqa: F401  isort: skip

import argparse
import sys
from importlib import import_module

from benchmarks import log, page
from pipeline.core.errors import FlexclearError


def main() -> int:
    """Run the groups asked for; exit code as of the command `flexclear`."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description="What things cost, and against what.")
    parser.add_argument("groups", nargs="*", metavar="GROUP", help=f"some of {', '.join(page.GROUPS)}; default: all")
    parser.add_argument("--dry", action="store_true", help="print only; leave log and page alone")
    options = parser.parse_args()
    unknown = [name for name in options.groups if name not in page.GROUPS]
    if unknown:
        parser.error(f"no group is called {', '.join(unknown)}; known: {', '.join(page.GROUPS)}")
    try:
        for group in options.groups or page.GROUPS:
            _run(group, options.dry)
    except FlexclearError as error:
        print(error, file=sys.stderr)
        return error.exit_code
    return 0


def _run(group: str, dry: bool) -> None:
    module = import_module(f"benchmarks.{page.GROUPS[group]}")
    results = []
    for result in module.measure():
        results.append(result)
        print(".", end="", file=sys.stderr, flush=True)
    print(file=sys.stderr)
    if not results:
        return
    print(f"{module.TITLE}\n\n{module.show(results)}\n", flush=True)
    if not dry:
        log.append(group, results)
        page.write()


if __name__ == "__main__":
    sys.exit(main())
