"""``python -m benchmarks.stability [--seed N] [--random N]``: run all cases, write docs/stability.md."""

from __future__ import annotations

import argparse
import os
import sys

from benchmarks.stability import cases, page
from benchmarks.stability.mechanism import ROOT
from benchmarks.stability.run import row, run_all


def main() -> None:
    """Run the atlas and say on stderr where it stands."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.stability", description=__doc__)
    parser.add_argument("--seed", type=int, default=cases.SEED, help="seed of the random cases")
    parser.add_argument("--random", type=int, default=cases.RANDOM, metavar="N", help="number of random cases")
    parser.add_argument("--sweep", action="append", help="only this sweep (may be repeated); no page is written")
    options = parser.parse_args()
    chosen = [c for c in cases.cases(options.seed, options.random) if not options.sweep or c.sweep in options.sweep]
    rows = []
    for case, result in run_all(chosen, os.cpu_count() or 1):
        rows.append(row(case, result))
        print(f"[{len(rows)}/{len(chosen)}] {_told(rows[-1])}", file=sys.stderr, flush=True)
    if not options.sweep:
        command = f"python -m benchmarks.stability --seed {options.seed} --random {options.random}"
        page.write(rows, ROOT / "docs", options.seed, command)
        print(ROOT / "docs" / "stability.md")


def _told(found: dict[str, object]) -> str:
    value = "" if found["sweep"] == "random" else f" {found[str(found['sweep'])]:.6g}"
    numbers = f"{found['evaluations']} evaluations, energy {found['ledger']:.1e}, {found['seconds']:.1f} s"
    return f"{found['sweep']}{value}: {found['verdict']} {numbers} {found['reason']}"


if __name__ == "__main__":
    main()
