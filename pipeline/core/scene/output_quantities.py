"""What a sweep keeps of each point, by name: a quantity, and what of it.

``platform.velocity.largest`` is ``<quantity>.<reduction>``; `pipeline.core.scene.requested_accuracy` lists the
quantities. `pipeline.core.quantities` reduces a series to such a number.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass

from flexclear.pipeline.core.registry import suggestion
from flexclear.pipeline.core.scene.requested_accuracy import KINDS, Quantity, parse

#: reduction -> what it says of a series
SERIES = {
    "largest": "largest magnitude over the run",
    "rms": "root of the mean square magnitude over the time",
    "mean": "mean over the time",
    "final": "value at the end",
    "series": "values at the regular output times",
    "sections": "values once in each period of the laws",
}
#: the same of what contacts do
OF_CONTACTS = {
    "peak_force": {"largest": "largest normal force of the contact"},
    "impulse": {"final": "impulse of the normal force over the run"},
    "impact_times": {
        "count": "impacts with an approach above 1e-4 m/s",
        "first": "time of the first of them",
        "last": "time of the last of them",
    },
}
#: reductions that need the quantity at all output times, and those whose value has no direction
THROUGHOUT, MAGNITUDES = ("largest", "rms", "mean", "series"), ("largest", "rms")
#: quantities that are examined once in each period: a contact that happens to be open then says nothing by its force
OF_SECTIONS = ("position", "orientation", "velocity", "angular_velocity")
#: quantities with one component
SCALARS = ("drive_force",)


@dataclass(frozen=True, slots=True)
class Recorded:
    """A quantity and the reduction of it that is recorded."""

    quantity: Quantity
    reduction: str

    @property
    def name(self) -> str:
        """As a sweep writes it in full."""
        return f"{self.quantity.name}.{self.reduction}"

    @property
    def meaning(self) -> str:
        """In words."""
        return f"{self.quantity.name}: {reductions(self.quantity.kind)[self.reduction]}"

    @property
    def dims(self) -> tuple[str, ...]:
        """Dimensions of its value at one point."""
        time = {"series": ("time",), "sections": ("section",)}.get(self.reduction, ())
        kind = self.quantity.kind
        if kind in OF_CONTACTS or kind in SCALARS or self.reduction in MAGNITUDES:
            return time
        return (*time, "quat" if kind == "orientation" else "axis")

    @property
    def throughout(self) -> bool:
        """Whether it needs the regular output times."""
        return self.quantity.kind not in OF_CONTACTS and self.reduction in THROUGHOUT


def reductions(kind: str) -> dict[str, str]:
    """The reductions that a kind of quantity has, and what they say."""
    if kind == "orientation":
        # a mean of quaternions is no rotation, and their magnitude is one
        return {name: SERIES[name] for name in ("final", "series", "sections")}
    without = {name: text for name, text in SERIES.items() if name != "sections" or kind in OF_SECTIONS}
    return OF_CONTACTS.get(kind, without)


def parse_recorded(text: str, owners: Mapping[str, Collection[str]]) -> Recorded:
    """What is called `text`; the reduction may be left out where a quantity has one only.

    owners: as of `requested.parse`.  Raises ValueError that names what could have been meant.
    """
    head, _, last = text.rpartition(".")
    if last in KINDS:
        only = list(reductions(last))
        if len(only) > 1:
            raise ValueError(f"what of '{text}' is kept? write {' or '.join(f'{text}.{name}' for name in only)}")
        return Recorded(parse(text, owners), only[0])
    if head.rpartition(".")[2] not in KINDS:
        raise ValueError(
            f"'{text}' is no quantity: write <owner>.<quantity>.<reduction>, as in 'platform.velocity.largest' "
            f"({suggestion(head.rpartition('.')[2] or last, list(KINDS))})"
        )
    quantity = parse(head, owners)
    known = reductions(quantity.kind)
    if last not in known:
        raise ValueError(f"'{quantity.name}' has no '{last}' ({suggestion(last, list(known))})")
    return Recorded(quantity, last)
