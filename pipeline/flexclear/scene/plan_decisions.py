"""Decisions of a plan: whether each effect stays, by what evidence, and how the planned scene is integrated."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from flexclear.scene.variants import Effect

#: kinds of evidence, cheapest first
BOUND, RESPONSE, PILOT, NONE = "bound", "response", "pilot", "none"
#: description of each kind of evidence
EVIDENCE = {
    BOUND: "a bound from the ideal motion",
    RESPONSE: "the first-order response along the ideal motion",
    PILOT: "screening runs",
    NONE: "not examined",
}
#: reason why an effect stays that no run has examined
NOT_WORTH = "omitting it would save less time than examining it costs"

#: reason why an effect stays that could be removed
NO_CHEAPER = "omitting it makes the run no cheaper"


@dataclass(frozen=True)
class Decision:
    """Decision on one effect. estimate, uncertainty: of the effect size by quantity [SI]; infinite where unknown."""

    effect: Effect
    kept: bool
    evidence: str
    reason: str
    estimate: Mapping[str, float] = field(default_factory=dict)
    uncertainty: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Plan:
    """All decisions. requested: accuracy by quantity [SI].

    integrator, rtol: of the planned run; empty integrator: as in the scene. modes: elastic coordinates of remaining
    flexible bodies that need fewer than they have. integration: estimated error of the integration by quantity [SI].
    evaluations: of the right-hand side in all runs of the plan. runs: their number. uncoupled: names of parts that
    nothing couples to the requested quantities. ledger_tolerance: of the planned run, where it differs from the usual
    one. constant: watched quantities that never change in the ideal mechanism, for which nothing is planned.
    """

    decisions: tuple[Decision, ...]
    requested: Mapping[str, float]
    integrator: str
    rtol: float
    integration: Mapping[str, float]
    modes: Mapping[str, int]
    evaluations: int
    runs: int
    uncoupled: tuple[str, ...] = ()
    ledger_tolerance: float | None = None
    constant: tuple[str, ...] = ()

    @property
    def removed_effects(self) -> tuple[Effect, ...]:
        """The effects that the plan removes."""
        return tuple(d.effect for d in self.decisions if not d.kept)
