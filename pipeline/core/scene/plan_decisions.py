"""What a plan decides: of each effect whether it stays, by what evidence, and how the planned scene is integrated."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from flexclear.pipeline.core.scene.variants import Effect

#: evidence, cheapest first
BOUND, RESPONSE, PILOT, NONE = "bound", "response", "pilot", "none"
#: what each says, in words
EVIDENCE = {
    BOUND: "a bound from the ideal motion",
    RESPONSE: "the first-order response along the ideal motion",
    PILOT: "short runs with and without it",
    NONE: "not examined",
}
#: why an effect stays for which no run was made
NOT_WORTH = "to leave it out would save no time worth the look"

#: why an effect stays that could be left out
NO_CHEAPER = "without it the run is not cheaper"


@dataclass(frozen=True)
class Decision:
    """What becomes of one effect. estimate, uncertainty: of its influence by quantity, SI; infinite where unknown."""

    effect: Effect
    kept: bool
    evidence: str
    reason: str
    estimate: Mapping[str, float] = field(default_factory=dict)
    uncertainty: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Mesh:
    """The finite elements of a body. given: how many it has.  called_for: how many what is requested calls for.

    frequency, compliance: largest errors of its mesh, as fractions, of its retained frequencies and of its frames'
    compliance.
    error: estimated error that the mesh makes in each quantity, at most [SI].
    """

    given: int
    called_for: int
    frequency: float
    compliance: float
    error: Mapping[str, float]


@dataclass(frozen=True)
class Plan:
    """All decisions. requested: by quantity [SI].  integrator, rtol: of the planned run; no integrator: as the scene.

    modes: elastic coordinates of flexible bodies that stay that need fewer than they have.
    integration: estimated error of the integration by quantity [SI].  evaluations: of the right-hand side, all that
    the plan has run.  runs: how many.  uncoupled: names of parts that nothing couples to the requested quantities.
    meshes: finite elements of flexible bodies whose recipes give them.  ledger_tolerance: of the planned run, where it
    is not the usual one.
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
    meshes: Mapping[str, Mesh] = field(default_factory=dict)
    ledger_tolerance: float | None = None

    @property
    def gone(self) -> tuple[Effect, ...]:
        """The effects that are dropped."""
        return tuple(d.effect for d in self.decisions if not d.kept)
