"""One evaluation against Pinocchio's `constraintDynamics` and MuJoCo's `mj_forward`, on the same rigid loops.

The N-four-bar of `growth`, leaning, in the same state in all three; the uprights' accelerations are compared.  And
against Pinocchio's `aba` on open chains of hinged links, from 5 to 300.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from importlib.metadata import version

import numpy as np

from benchmarks.families.growth import four_bars, hinged
from benchmarks.family import Case, Family, Record, each
from benchmarks.mechanisms import Mechanism, State, evaluation_time
from benchmarks.page import Columns, short, spread, table
from benchmarks.peers_models import CHAINS, LEAN, PEERS, bent
from benchmarks.timing import interleaved, slope
from flexclear.pipeline.core.system.progress import silent
from flexclear.pipeline.dynamics import memory as m
from flexclear.pipeline.dynamics.run.evaluation import closure_rows
from flexclear.pipeline.dynamics.run.evaluation.start import consistent_start
from flexclear.pipeline.dynamics.run.trajectory import integrate

LOOPS = (5, 20)
LINKS = (5, 10, 20, 40, 80, 150, 300)
#: evaluations of a round, for one loop
EVALUATIONS, ROUNDS = 10_000, 15


def cases() -> list[Case]:
    """Each number of loops against each program, and each number of links of an open chain."""
    closed = [Case(f"{name}, {loops} loops", (name, loops)) for loops in LOOPS for name in PEERS]
    return closed + [Case(f"{name}, {links} links", (name, links)) for links in LINKS for name in CHAINS]


def _of_chain(name: str, links: int) -> Record:
    """Evaluations of an open chain, by the kernels and, where there is such, by straight code; and those of its run."""
    peer, mine = CHAINS[name](links), Mechanism(name, hinged(links), {})
    engine, straight = mine.general_engine(), mine.engine()
    start, order = consistent_start(engine), [hinge.start for hinge in engine.model.numbering.coordinates[1:]]
    integrate(engine, start, silent)
    evaluations, y, nq = int(engine.n[m.EVALUATIONS]), start.copy(), engine.model.nq
    y[: nq + engine.model.nv] = 0.0
    for k, (angle, rate) in enumerate(zip(*bent(links), strict=True)):
        y[engine.model.numbering.positions[k + 1].start], y[nq + order[k]] = angle, rate
    state = State(engine.start, np.zeros(0), np.zeros(0), y)
    ours, theirs = closure_rows.evaluate(engine, y, state.t)[engine.model.speeds][order], peer.hinges()
    repeat = max(EVALUATIONS // links, 10)
    tasks = {"theirs": partial(peer.time, repeat), "ours": partial(evaluation_time, engine, state, repeat)}
    if straight.has_straight_code:
        tasks["straight"] = partial(evaluation_time, straight, state, repeat)
    times = interleaved(tasks, ROUNDS)
    return {
        "by": name,
        "links": links,
        "apart": float(np.abs(theirs - ours).max() / np.abs(theirs).max()),
        "evaluations": evaluations,
        "way": "articulated inertias" if engine.model.parts.articulated else "mass matrix",
        **{label: found.record("us") for label, found in times.items()},
        "ratio": times["theirs"].over(times["ours"]),
        "straight_ratio": times["theirs"].over(times["straight"]) if "straight" in times else None,
    }


def _record(name: str, loops: int) -> Record:
    peer, mine = PEERS[name](loops), Mechanism(name, four_bars(loops, LEAN), {})
    engine = mine.general_engine()
    state = State(engine.start, np.zeros(0), np.zeros(0), consistent_start(engine))
    links, numbering = engine.model.links, engine.model.numbering
    uprights = [numbering.coordinates[i][0] for i, link in enumerate(links) if i and link.kind == "revolute"]
    ours = np.sort(closure_rows.evaluate(engine, state.y, state.t)[engine.model.speeds][uprights])
    repeat = max(EVALUATIONS // loops, 10)
    tasks: dict[str, Callable[[], float]] = {"theirs": partial(peer.time, repeat)}
    for label, one in (("ours", engine), ("straight", mine.engine())):
        tasks[label] = partial(evaluation_time, one, state, repeat)
    times = interleaved(tasks, ROUNDS)
    apart = np.abs(np.sort(peer.hinges()) - ours).max() / np.abs(ours).max()
    return {
        "by": name,
        "loops": loops,
        "apart": float(apart),
        "versions": {package: version(package) for package in ("pin", "mujoco")},
        **{label: found.record("us") for label, found in times.items()},
        "ratio": times["theirs"].over(times["ours"]),
        "straight_ratio": times["theirs"].over(times["straight"]),
    }


def show(records: list[Record]) -> str:
    """Both tables."""
    chains = [r for r in records if "links" in r]
    parts = [_of_loops([r for r in records if "loops" in r]), _of_chains(chains) if chains else ""]
    return "\n\n".join(part for part in parts if part)


def _of_chains(records: list[Record]) -> str:
    """The table of open chains."""
    columns: Columns = {
        "program": lambda r: r["by"],
        "links": lambda r: str(r["links"]),
        "theirs [us]": lambda r: spread(r["theirs"], "us", 1),
        "straight [us]": lambda r: spread(r["straight"], "us", 2) if "straight" in r else "",
        "ratio": lambda r: f"{r['straight_ratio']:.1f}" if "straight" in r else "",
        "kernels [us]": lambda r: spread(r["ours"], "us", 2),
        "ratio ": lambda r: f"{r['ratio']:.1f}",
        "by": lambda r: r["way"],
        "accelerations differ by": lambda r: short(r["apart"]),
        "evaluations of 0.2 s": lambda r: str(r["evaluations"]),
    }
    shown = table(records, columns)
    if len(records) == 1:
        return shown
    exponent = slope([r["links"] for r in records], [r["ours"]["us"] for r in records])
    return f"{shown}\n\nTime grows as the number of links to the power {exponent:.2f}."


def _of_loops(records: list[Record]) -> str:
    """The table of closed loops."""
    if not records:
        return ""
    columns: Columns = {
        "program": lambda r: r["by"],
        "loops": lambda r: str(r["loops"]),
        "theirs [us]": lambda r: spread(r["theirs"], "us", 1),
        "straight [us]": lambda r: spread(r["straight"], "us", 2),
        "ratio": lambda r: f"{r['straight_ratio']:.1f}",
        "kernels [us]": lambda r: spread(r["ours"], "us", 2),
        "ratio ": lambda r: f"{r['ratio']:.1f}",
        "accelerations differ by": lambda r: short(r["apart"]),
    }
    versions = records[-1]["versions"]
    return f"{table(records, columns)}\n\nPinocchio {versions['pin']}, MuJoCo {versions['mujoco']}."


FAMILY = Family(
    what="one evaluation against Pinocchio and MuJoCo",
    takes="3 min",
    page="benchmarks.md",
    cases=cases,
    measure=each(lambda case: [(_of_chain if case.of[0] in CHAINS else _record)(*case.of)]),
    show=show,
    needs=("pinocchio", "peers"),
)
