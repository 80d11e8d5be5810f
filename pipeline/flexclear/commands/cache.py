"""``flexclear cache``: size and integrity of the caches, the inputs of an artifact, and pruning."""

from __future__ import annotations

import argparse
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from stat import S_ISREG

from flexclear.artifacts import maintenance
from flexclear.artifacts.paths import kernel_root
from flexclear.dynamics.compile import files
from flexclear.dynamics.compile.folder import prune
from flexclear.stages.workplace import open_workplace
from flexclear.system.errors import InputError, ResourceError, terminal_text

ACTIONS = {
    "size": "stored bytes by stage",
    "check": "read everything and compare it with its digest; exit code 4 when something is damaged",
    "explain": "print the facts from which an artifact was computed",
    "prune": "remove damaged artifacts, and those that no scene shows any more",
}
#: days that artifacts which nothing shows stay stored: a return to an earlier value costs nothing in that time
DAYS = 30.0
#: number of faults that `check` prints
LISTED_FAULTS = 20


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments to its parser."""
    actions = parser.add_subparsers(dest="action", metavar="ACTION", required=True)
    for name, text in ACTIONS.items():
        below = actions.add_parser(name, help=text, description=f"{text[0].upper()}{text[1:]}.")
        if name == "explain":
            below.add_argument("what", metavar="FILE|KEY", help="a shown file, or a key or its beginning")


def run_command(options: argparse.Namespace) -> None:
    """Run the requested action."""
    {"size": _print_size, "check": _check, "explain": _explain, "prune": _prune}[options.action](options)


def _print_size(options: argparse.Namespace) -> None:
    store = open_workplace().store
    inventory = maintenance.inventory(store, whole=False)
    sizes: dict[str, list[int]] = {}
    for artifact in inventory.artifacts:
        sizes.setdefault(artifact.record.stage.partition("/")[0], []).append(artifact.size)
    for stage, each in sorted(sizes.items()):
        print(f"{stage:<12} {len(each):>6} artifacts {_megabytes(sum(each))}")
    shown = [path for path in store.root.rglob("*") if (store.root / "cache") not in path.parents]
    for name, paths in (("kernels", kernel_root().rglob("*")), ("shown", shown), ("orphans", inventory.orphans)):
        sizes_there = _sizes(paths)
        print(f"{name:<12} {len(sizes_there):>6} files     {_megabytes(sum(sizes_there))}")
    print(f"results in {store.root}, kernels in {kernel_root()}")


def _sizes(paths: Iterable[Path]) -> list[int]:
    """Return the sizes of those paths that are files [bytes]; files that other processes remove are skipped."""
    lines = []
    for path in paths:
        with suppress(FileNotFoundError):
            facts = path.stat()
            if S_ISREG(facts.st_mode):
                lines.append(facts.st_size)
    return lines


def _check(options: argparse.Namespace) -> None:
    store = open_workplace().store
    inventory = maintenance.inventory(store, whole=True)
    # a kernel without a checksum has not been compiled yet, or is about to be
    kernels = [path for path in kernel_root().glob("*/flexclear_*.py") if path.with_suffix(".sum").is_file()]
    others = {path for path in kernels if files.stored_by_another_build(path)}
    damaged = [path for path in kernels if path not in others and files.is_damaged(path)]
    in_results = maintenance.shown_faults(store, store.root)
    faults = [*inventory.damaged, *in_results, *(f"{path} is damaged" for path in damaged)]
    for fault in faults[:LISTED_FAULTS]:
        print(terminal_text(fault))
    if len(faults) > LISTED_FAULTS:
        print(f"... and {len(faults) - LISTED_FAULTS} more")
    text = (
        f"{len(inventory.artifacts)} artifacts, {len(faults)} faults, {len(inventory.orphans)} files without a record"
    )
    unused = f", {len(others)} unused of another build" if others else ""
    print(f"{text}; {len(kernels)} compiled kernels{unused}")
    if faults:
        raise ResourceError(
            "damaged files are never used: they are computed again when needed; `cache prune` removes them"
        )


def _explain(options: argparse.Namespace) -> None:
    store = open_workplace().store
    record = maintenance.find_record(store, options.what)
    if record is None:
        raise InputError(options.what, "is neither a shown file nor the beginning of a single key", "see results/runs")
    print(f"{record.stage} {record.key}")
    for name, digest in record.files.items():
        print(terminal_text(f"  holds {name}: sha256 {digest}"))
    for fact, value in record.computed_by.items():
        print(terminal_text(f"  computed by {fact}: {value}"))
    for fact, value in record.facts.items():
        print(terminal_text(f"  {fact}: {value}"))


def _prune(options: argparse.Namespace) -> None:
    store = open_workplace().store
    inventory = maintenance.inventory(store, whole=True)
    chosen = maintenance.list_prunable(store, inventory, DAYS * maintenance.DAY)
    broken = [a for a in inventory.artifacts if store.fault(a.record) is not None]
    chosen += [artifact for artifact in broken if artifact not in chosen]
    size = sum(artifact.size for artifact in chosen) + sum(path.stat().st_size for path in inventory.orphans)
    store.remove_leftovers()
    for artifact in chosen:
        maintenance.remove(store, artifact)
    for path in (*inventory.orphans, *inventory.unreadable):
        maintenance.remove_file(path)
    kernels = sum(prune(folder) for folder in kernel_root().glob("*") if folder.is_dir())
    print(f"removed {len(chosen)} artifacts and {len(inventory.orphans)} files without a record,{_megabytes(size)}")
    if kernels:
        print(f"removed {kernels} compiled kernels")


def _megabytes(size: int) -> str:
    return f"{size / 1e6:>10.1f} MB"
