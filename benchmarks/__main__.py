"""``python -m benchmarks [FAMILY ...]``: measure, log, and write the measured parts of docs/."""

from __future__ import annotations

import argparse
import os
import sys
import time
from dataclasses import replace
from fnmatch import fnmatch
from pathlib import Path

from benchmarks import families, log, page, processes
from benchmarks.family import WRONG, Case, Family, Record
from flexclear.post.plotting.table import pipe_table
from flexclear.scene.registry import suggestion
from flexclear.system.errors import INTERRUPTED, FlexclearError, InputError
from flexclear.workflow.progress import Monitor, duration


def main(arguments: list[str] | None = None) -> int:
    """Measure, list or write pages as the options say; return the exit code of `flexclear`, or 1 for a wrong case."""
    options = _parser().parse_args(arguments)
    try:
        chosen = {name: page.named(name) for name in options.families or families.NAMES}
        if options.list:
            print(_listed(chosen))
            return 0
        if options.page:
            _write({family.page for family in chosen.values()}, options)
            return 0
        return int(any([_run(name, family, options) for name, family in chosen.items()]))
    except FlexclearError as error:
        print(f"benchmarks: {error}", file=sys.stderr)
        return error.exit_code
    except KeyboardInterrupt:
        print("\nbenchmarks: interrupted; cases that were finished are kept", file=sys.stderr)
        return INTERRUPTED


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description="What this program costs, and holds.")
    parser.add_argument("families", nargs="*", metavar="FAMILY", help=f"{', '.join(families.NAMES)}; default: all")
    parser.add_argument("--list", action="store_true", help="what there is, how long it takes; measure nothing")
    parser.add_argument("--page", action="store_true", help="only write the pages again from the log")
    parser.add_argument("--only", action="append", metavar="PATTERN", help="only cases of such names (may be repeated)")
    parser.add_argument("--dry", action="store_true", help="print only; leave log and pages alone")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, metavar="N", help="processes; default: all")
    parser.add_argument("--trust", action="store_true", help="keep what finished with older sources")
    parser.add_argument("--set", action="append", default=[], metavar="NAME=N", help="other settings; see --list")
    parser.add_argument("--into", type=Path, metavar="FOLDER", help="write log and pages there, not in this project")
    return parser


def _listed(chosen: dict[str, Family]) -> str:
    rows = []
    for name, family in chosen.items():
        settings = ", ".join(f"{key}={value}" for key, value in family.settings.items())
        count = str(len(family.cases(**family.settings)))
        rows.append((name, family.what, count, family.takes, f"docs/{family.page}", settings))
    return pipe_table(("family", "what it measures", "cases", "takes", "page", "settings"), rows)


def _run(name: str, family: Family, options: argparse.Namespace) -> bool:
    """Measure a family, print and log the records; return True when a case went wrong."""
    settings = _settings(name, family, options)
    if family.needs is not None and not processes.installed(family.needs[0]):
        library, extra = family.needs
        print(f"{name}: {library} is not installed; .venv/bin/python -m pip install -e '.[{extra}]' brings it")
        return False
    if family.children and (why := processes.lacking()):
        print(f"{name}: {why}")
        return False
    every = family.cases(**settings)
    cases = [case for case in every if any(fnmatch(case.name, pattern) for pattern in options.only or ["*"])]
    if not cases:
        known = suggestion(options.only[0], [case.name for case in every])
        raise InputError(f"--only {options.only[0]}", f"no case of {name} has such a name", known)
    memory = log.Memory(name, family, trusting=options.trust)
    found = _measured(name, family, cases, memory, options.jobs)
    records = [record for case in cases for record in found[case.name]]
    shown = family.show(records)
    print(shown if isinstance(shown, str) else "\n\n".join(shown.values()), end="\n\n", flush=True)
    if not options.dry:
        session = replace(log.today(), records=records)
        log.append(_logs(options) / f"{name}.jsonl", session, history=family.times)
        _write({family.page}, options)
    memory.forget(cases)
    return any(record.get("verdict") == WRONG for record in records)


def _measured(name: str, family: Family, cases: list[Case], memory: log.Memory, jobs: int) -> dict[str, list[Record]]:
    """Return the records by case; cases with valid earlier results are not measured again."""
    found = {case.name: known for case in cases if (known := memory.recall(case)) is not None}
    todo = [case for case in cases if case.name not in found]
    say, begun = Monitor().say, time.monotonic()
    say(f"{name}: {len(found)} of {len(cases)} cases are known, {len(todo)} to measure; takes {family.takes}")
    digits = log.DIGITS if family.times else None
    for done, (case, records) in enumerate(family.measure(todo, jobs) if todo else (), start=1):
        found[case.name] = log.plain([{"case": case.name, **record} for record in records], digits)
        memory.learn(case, found[case.name])
        outcome = "".join(f" {record[key]}" for record in records for key in ("verdict", "reason") if record.get(key))
        say(f"{name} [{done}/{len(todo)}] {case.name}:{outcome} after {duration(time.monotonic() - begun)}")
    return found


def _settings(name: str, family: Family, options: argparse.Namespace) -> dict[str, int]:
    """Return the family's settings, changed by `--set`; raise InputError when a change lacks --into and --dry."""
    found = dict(family.settings)
    for text in options.set:
        key, _, value = text.partition("=")
        if key not in found or not value.isdecimal():
            known = ", ".join(f"{key}=N" for key in found) or "it has none"
            raise InputError(f"--set {text}", f"is no setting of {name}", f"known: {known}")
        found[key] = int(value)
    if found != family.settings and options.into is None and not options.dry:
        raise InputError("--set", "would put other cases in the place of those of this project", "say --into FOLDER")
    return found


def _logs(options: argparse.Namespace) -> Path:
    return log.FOLDER if options.into is None else options.into / "log"


def _write(pages: set[str], options: argparse.Namespace) -> None:
    for name in sorted(pages):
        print(page.write(name, _logs(options), options.into or page.DOCS))


if __name__ == "__main__":
    sys.exit(main())
