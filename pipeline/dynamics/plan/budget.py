"""The budget of a plan: the error that is requested, what dropped effects have spent of it, and what was decided."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from flexclear.pipeline.core.artifacts.effect_size import Influence
from flexclear.pipeline.core.scene.plan_decisions import PILOT, Decision
from flexclear.pipeline.core.scene.variants import Effect
from flexclear.pipeline.dynamics.linear.clearance_response import OF_POSE
from flexclear.pipeline.dynamics.plan.screening_runs import Pilots

#: fraction of the requested accuracy that dropped effects may use up together; the rest is for what is not estimated
BUDGET = 0.75
#: what flexible bodies may change of what impacts of rigid ones do to rates and forces, as a fraction of that
OF_IMPACTS = 0.5
#: what an influence measured with pilots' tolerance may be wrong by, as a fraction of it
OF_PILOT = 0.15
#: what the rest of the time may add to what a run over a part of it shows, as a fraction
WHOLE = 1.0


@dataclass(frozen=True)
class Chosen:
    """How the planned scene is integrated. level: of modes, None: all.  error: by quantity [SI], nan where unknown.

    ledger_tolerance: energy error beyond which the run is refused, where it is not the usual one.
    evaluations, reference: that a run of all the time takes, and one by what it was compared with, where that is known.
    """

    integrator: str
    rtol: float
    error: Mapping[str, float]
    level: int | None = None
    ledger_tolerance: float | None = None
    evaluations: float = np.nan
    reference: float = np.nan


#: the planned run is that of the scene: its integrator and tolerance stay
AS_IT_IS = Chosen("", 0.0, {})


@dataclass
class Search:
    """The state of the decisions. used: of the budget, by quantity, as fractions of the requested accuracy."""

    pilots: Pilots
    requested: dict[str, float]
    used: dict[str, float] = field(default_factory=dict)
    decisions: dict[str, Decision] = field(default_factory=dict)

    @property
    def gone(self) -> list[Effect]:
        """What has been dropped."""
        return [d.effect for d in self.decisions.values() if not d.kept]

    def fits(self, most: Mapping[str, float], budget: float = BUDGET) -> bool:
        """Whether influences of at most this much fit into what is left of the budget, for all quantities."""
        return all(
            self.used.get(name, 0.0) + most.get(name, np.inf) / self.requested[name] <= budget
            for name in self.requested
        )

    def spend(self, most: Mapping[str, float]) -> None:
        """Take influences out of the budget."""
        for name in self.requested:
            self.used[name] = self.used.get(name, 0.0) + most[name] / self.requested[name]

    def decide(
        self,
        effect: Effect,
        kept: bool,
        evidence: str,
        reason: str,
        estimate: Mapping[str, float] | None = None,
        uncertainty: Mapping[str, float] | None = None,
    ) -> None:
        """Write down what becomes of an effect."""
        self.decisions[effect.name] = Decision(effect, kept, evidence, reason, estimate or {}, uncertainty or {})

    def judge(
        self, effect: Effect, why: str, most: Mapping[str, float], seen: Mapping[str, Influence], besides: str = ""
    ) -> None:
        """Record what short runs show of an effect, at most and as it was seen.

        why: reason to drop it; empty where it stays, with `besides` before the reason of that.
        """
        difference = {name: influence.difference for name, influence in seen.items()}
        uncertainty = {name: influence.uncertainty for name, influence in seen.items()}
        reason = why or besides + too_much(most, self.requested)
        self.decide(effect, not why, PILOT, reason, difference, uncertainty)


def most_of(seen: Mapping[str, Influence]) -> dict[str, float]:
    """What influences may come to."""
    return {name: influence.most for name, influence in seen.items()}


def with_doubt(
    search: Search, effect_sizes: Mapping[str, Influence], soft: bool, more: float = 0.0
) -> dict[str, Influence]:
    """With what pilots may be wrong by, what flexible bodies may change of the impacts, and a fraction `more`."""
    kinds = {q.name: q.kind for q in search.pilots.chosen}
    doubled = {}
    for name, i in effect_sizes.items():
        fraction = more + OF_PILOT + (OF_IMPACTS if soft and kinds[name] not in OF_POSE else 0.0)
        doubled[name] = Influence(i.difference, i.uncertainty + fraction * i.difference)
    return doubled


def too_much(most: Mapping[str, float], requested: Mapping[str, float]) -> str:
    """Why an effect stays: what it may change most, in words."""
    name = max(requested, key=lambda n: most[n] / requested[n])
    if not np.isfinite(most[name]):
        return f"without it {name} cannot be determined, or has other events"
    return f"without it {name} may be off by {most[name] / requested[name]:.2g} times what is requested"
