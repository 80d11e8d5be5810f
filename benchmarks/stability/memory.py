"""Outcomes that are known already, so that an atlas which was interrupted goes on, and one after a fix is short.

A line of JSON each, below the results.  The key says on what an outcome depends: the scene, the program's sources that
a simulation reaches, and the atlas's own.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable
from dataclasses import asdict
from functools import cache
from pathlib import Path

from benchmarks.stability.cases import Case
from benchmarks.stability.mechanism import ROOT, Parameters, scene
from benchmarks.stability.outcome import FINISHED, Outcome
from pipeline.core.artifacts.paths import results_root
from pipeline.core.workflow.fingerprint import Sources
from stages import s4_simulate

FOLDER = Path("stability")
OWN = ("mechanism", "outcome", "run")
CHAIN = ("stages.s1_mesh", "stages.s2_modes", "stages.s3_bundle", "pipeline.dynamics")


class Memory:
    """Outcomes by case.

    trusting: an outcome of older sources stands when the run finished; what did not is made again.
    """

    def __init__(self, folder: Path | None = None, *, trusting: bool = False) -> None:
        self.file = (folder or results_root() / FOLDER) / "outcomes.jsonl"
        self.trusting = trusting
        self.lines: dict[str, tuple[str, Outcome]] = {}
        if self.file.exists():
            for line in self.file.read_text().splitlines():
                found = json.loads(line)
                self.lines[found["case"]] = (found["sources"], Outcome(**found["outcome"]))

    def recall(self, case: Case) -> Outcome | None:
        """The outcome of a case, when it is known."""
        made_of, outcome = self.lines.get(_name(case.parameters), ("", None))
        if outcome is None or made_of == sources(case.parameters):
            return outcome
        return outcome if self.trusting and outcome.verdict == FINISHED else None

    def learn(self, case: Case, outcome: Outcome) -> None:
        """Keep an outcome, at once."""
        name, made_of = _name(case.parameters), sources(case.parameters)
        self.lines[name] = (made_of, outcome)
        self.file.parent.mkdir(parents=True, exist_ok=True)
        with self.file.open("a") as file:
            file.write(json.dumps({"case": name, "sources": made_of, "outcome": asdict(outcome)}) + "\n")


def _name(parameters: Parameters) -> str:
    return json.dumps(asdict(parameters), sort_keys=True)


def sources(parameters: Parameters) -> str:
    """Digest of all source that the outcome of a case depends on."""
    own = [(Path(__file__).parent / f"{name}.py").read_bytes() for name in OWN]
    return _digest(frozenset({*CHAIN, *s4_simulate.modules(scene(parameters))}), tuple(own))


@cache
def _digest(roots: frozenset[str], own: Iterable[bytes]) -> str:
    parts = hashlib.sha256()
    for name, module in sorted(_tree().closure(roots).items()):
        parts.update(f"{name} {module.digest}\n".encode())
    for text in own:
        parts.update(text)
    return parts.hexdigest()


@cache
def _tree() -> Sources:
    return Sources(ROOT)
