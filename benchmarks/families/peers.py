"""One evaluation against Pinocchio's `constraintDynamics` and MuJoCo's `mj_forward`, on the same rigid loops.

The N-four-bar of `growth`, leaning, in the same state in all three; the uprights' accelerations are compared.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from importlib.metadata import version

import numpy as np

from benchmarks.families.growth import four_bars
from benchmarks.family import Case, Family, Measured, Record
from benchmarks.mechanisms import Mechanism, State, evaluation_time
from benchmarks.page import Columns, short, spread, table
from benchmarks.peers_models import LEAN, PEERS
from benchmarks.timing import interleaved
from flexclear.pipeline.dynamics.run.start import consistent_start

LOOPS = (5, 20)
#: evaluations of a round, for one loop
EVALUATIONS, ROUNDS = 10_000, 15


def cases() -> list[Case]:
    """Each number of loops against each program."""
    return [Case(f"{name}, {loops} loops", (name, loops)) for loops in LOOPS for name in PEERS]


def measure(cases: Sequence[Case], jobs: int) -> Measured:
    """A record for each; both take turns in one process."""
    for case in cases:
        yield case, [_record(*case.of)]


def _record(name: str, loops: int) -> Record:
    peer, engine = PEERS[name](loops), Mechanism(name, four_bars(loops, LEAN), {}).engine()
    state = State(engine.start, np.zeros(0), np.zeros(0), consistent_start(engine))
    links, numbering = engine.model.links, engine.model.numbering
    uprights = [numbering.coordinates[i][0] for i, link in enumerate(links) if i and link.kind == "revolute"]
    ours = np.sort(engine.evaluate(state.y, state.t)[engine.model.speeds][uprights])
    repeat = max(EVALUATIONS // loops, 10)
    tasks: dict[str, Callable[[], float]] = {"theirs": partial(peer.time, repeat)}
    for label, straight in (("ours", False), ("straight", True)):
        tasks[label] = partial(evaluation_time, engine, state, repeat, straight=straight)
    times = interleaved(tasks, ROUNDS)
    apart = np.abs(np.sort(peer.hinges()) - ours).max() / np.abs(ours).max()
    return {
        "by": name,
        "loops": loops,
        "apart": float(apart),
        "versions": {package: version(package) for package in ("pin", "mujoco")},
        **{label: found.told("us") for label, found in times.items()},
        "ratio": times["theirs"].over(times["ours"]),
        "straight_ratio": times["theirs"].over(times["straight"]),
    }


def show(records: list[Record]) -> str:
    """The table."""
    columns: Columns = {
        "program": lambda r: r["by"],
        "loops": lambda r: str(r["loops"]),
        "theirs [us]": lambda r: spread(r["theirs"], "us", 1),
        "ours [us]": lambda r: spread(r["ours"], "us", 2),
        "ratio": lambda r: f"{r['ratio']:.1f}",
        "ours, straight [us]": lambda r: spread(r["straight"], "us", 2),
        "ratio ": lambda r: f"{r['straight_ratio']:.1f}",
        "accelerations differ by": lambda r: short(r["apart"]),
    }
    versions = records[-1]["versions"]
    return f"{table(records, columns)}\n\nPinocchio {versions['pin']}, MuJoCo {versions['mujoco']}."


FAMILY = Family(
    what="one evaluation against Pinocchio and MuJoCo",
    takes="1 min",
    page="benchmarks.md",
    cases=cases,
    measure=measure,
    show=show,
    needs=("pinocchio", "peers"),
)
