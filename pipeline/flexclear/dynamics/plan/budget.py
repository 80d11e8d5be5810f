"""Error budget of a plan: the requested accuracy, the part that dropped effects use up, and the decisions."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from flexclear.artifacts.effect_size import Influence
from flexclear.artifacts.points import Point
from flexclear.dynamics.linear.clearance_response import OF_POSE
from flexclear.dynamics.plan.screening_runs import ScreeningRuns
from flexclear.scene.plan_decisions import PILOT, Decision
from flexclear.scene.variants import Effect

#: fraction of the requested accuracy that dropped effects may use up together; the rest is for errors without estimate
BUDGET = 0.75
#: uncertainty of the effect of rigid bodies' impacts on rates and forces where bodies are flexible, as a fraction
OF_IMPACTS = 0.5
#: uncertainty of an effect size measured with the tolerance of screening runs, as a fraction of the effect size
OF_SCREENING = 0.15
#: possible increase of an effect size over the rest of the time, when a run covers only a part, as a fraction
WHOLE = 1.0


@dataclass(frozen=True)
class Integration:
    """Integration of the planned scene. level: of modes, None: all.  error: by quantity [SI], NaN where unknown.

    ledger_tolerance: energy error beyond which the run is refused, where it differs from the default.
    evaluations, reference: evaluations of a run over all the time, and of its reference run, where known.
    """

    integrator: str
    rtol: float
    error: Mapping[str, float]
    level: int | None = None
    ledger_tolerance: float | None = None
    evaluations: float = np.nan
    reference: float = np.nan


#: the planned run equals that of the scene: integrator and tolerance stay
UNCHANGED = Integration("", 0.0, {})


@dataclass
class Search:
    """State of the decisions. used: spent budget by quantity, as fractions of the requested accuracy."""

    runs: ScreeningRuns
    requested: dict[str, float]
    used: dict[str, float] = field(default_factory=dict)
    decisions: dict[str, Decision] = field(default_factory=dict)

    @property
    def dropped(self) -> list[Effect]:
        """Effects that have been dropped."""
        return [d.effect for d in self.decisions.values() if not d.kept]

    def fits(self, upper: Mapping[str, float], budget: float = BUDGET) -> bool:
        """Return True when effect sizes of at most `upper` fit into the remaining budget, for all quantities."""
        return all(
            self.used.get(name, 0.0) + upper.get(name, np.inf) / self.requested[name] <= budget
            for name in self.requested
        )

    def compare(
        self, changed: Point, reference: Point, *, flexible: bool = False, fraction: float = 1.0
    ) -> tuple[dict[str, Influence], dict[str, float]]:
        """Return effect sizes, with the uncertainties of screening runs and over all of the time, and upper bounds.

        flexible: bodies of the scene are flexible, those of both points may be rigid.  fraction: of the time of both.
        """
        poses, sizes = {q.name for q in self.runs.chosen if q.kind in OF_POSE}, dict[str, Influence]()
        for name, i in self.runs.differences(changed, reference).items():
            of_impacts = OF_IMPACTS if flexible and name not in poses else 0.0
            part = possible_increase(fraction) + OF_SCREENING + of_impacts
            sizes[name] = Influence(i.difference, i.uncertainty + part * i.difference)
        return sizes, upper_bounds(sizes)

    def spend(self, upper: Mapping[str, float]) -> None:
        """Subtract effect sizes from the budget."""
        for name in self.requested:
            self.used[name] = self.used.get(name, 0.0) + upper[name] / self.requested[name]

    def decide(
        self,
        effect: Effect,
        kept: bool,
        evidence: str,
        reason: str,
        estimate: Mapping[str, float] | None = None,
        uncertainty: Mapping[str, float] | None = None,
    ) -> None:
        """Record the decision about an effect."""
        self.decisions[effect.name] = Decision(effect, kept, evidence, reason, estimate or {}, uncertainty or {})

    def judge(
        self, effect: Effect, why: str, upper: Mapping[str, float], sizes: Mapping[str, Influence], besides: str = ""
    ) -> None:
        """Record what screening runs show of an effect: upper bounds `upper`, and effect sizes `sizes`.

        why: reason to drop the effect; empty where it stays, for a reason that `besides` precedes.
        """
        difference = {name: influence.difference for name, influence in sizes.items()}
        uncertainty = {name: influence.uncertainty for name, influence in sizes.items()}
        reason = why or besides + reason_to_keep(upper, self.requested)
        self.decide(effect, not why, PILOT, reason, difference, uncertainty)


def upper_bounds(sizes: Mapping[str, Influence]) -> dict[str, float]:
    """Return the upper bounds of effect sizes."""
    return {name: influence.most for name, influence in sizes.items()}


def possible_increase(fraction: float) -> float:
    """Return by how much an effect size of runs over a fraction of the time may grow over all of it, as a fraction."""
    return 0.0 if fraction == 1.0 else WHOLE


def reason_to_keep(upper: Mapping[str, float], requested: Mapping[str, float]) -> str:
    """Return the reason why an effect stays: its largest possible change, in words."""
    name = max(requested, key=lambda n: upper[n] / requested[n])
    if not np.isfinite(upper[name]):
        return f"without it {name} cannot be determined, or has another number of impacts"
    return f"without it {name} may change by {upper[name] / requested[name]:.2g} times the requested accuracy"
