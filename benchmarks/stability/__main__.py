"""``python -m benchmarks.stability [--seed N] [--random N] [--sweep NAME]``: run the atlas, write docs/stability.md."""

from __future__ import annotations

# first of all: it pins BLAS to one thread, which NumPy reads when it is imported
import pipeline  # noqa: F401  isort: skip

import argparse
import os
import sys
from pathlib import Path
from typing import Any

from benchmarks.stability import cases, crew, page
from benchmarks.stability.cases import Case
from benchmarks.stability.mechanism import ROOT
from benchmarks.stability.memory import Memory
from benchmarks.stability.outcome import WRONG
from benchmarks.stability.page import Row
from benchmarks.stability.run import run_case


def main() -> int:
    """Run the atlas and say on stderr where it stands; exit code 1 when a case finished wrong."""
    options = _options()
    chosen = [c for c in cases.cases(options.seed, options.random) if not options.sweep or c.sweep in options.sweep]
    rows = run(chosen, Memory(trusting=options.trust), options.jobs)
    if not options.sweep:
        command = f"python -m benchmarks.stability --seed {options.seed} --random {options.random}"
        print(page.write(rows, options.into, options.seed, command))
    return 1 if any(row.outcome.verdict == WRONG for row in rows) else 0


def _options() -> Any:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.stability", description=__doc__)
    parser.add_argument("--seed", type=int, default=cases.SEED, help="seed of the random cases")
    parser.add_argument("--random", type=int, default=cases.RANDOM, metavar="N", help="number of random cases")
    parser.add_argument("--sweep", action="append", help="only this sweep (may be repeated); no page is written")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, metavar="N", help="processes; default: all")
    parser.add_argument("--into", type=Path, default=ROOT / "docs", metavar="FOLDER", help="where the page goes")
    parser.add_argument("--trust", action="store_true", help="keep what finished with older sources")
    return parser.parse_args()


def run(chosen: list[Case], memory: Memory, jobs: int) -> list[Row]:
    """Every case with its outcome, in the order of the cases; what is known is not run again."""
    known = {case: outcome for case in chosen if (outcome := memory.recall(case)) is not None}
    todo = [case for case in chosen if case not in known]
    print(f"{len(known)} of {len(chosen)} cases are known, {len(todo)} to run", file=sys.stderr, flush=True)
    for done, (case, outcome) in enumerate(crew.outcomes(todo, jobs, run_case), start=1):
        memory.learn(case, outcome)
        known[case] = outcome
        print(f"[{done}/{len(todo)}] {Row(case, outcome).told()}", file=sys.stderr, flush=True)
    return [Row(case, known[case]) for case in chosen]


if __name__ == "__main__":
    sys.exit(main())
