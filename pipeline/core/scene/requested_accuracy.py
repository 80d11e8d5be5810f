"""Quantities of interest by name: what `[accuracy]` may ask for, and what is examined where nothing is asked.

A quantity is ``<owner>.<kind>``, e.g. ``platform.position`` or ``A1.peak_force``. How runs hold them and differ in
them is known to `pipeline.core.quantities`, which needs NumPy; a command that finds everything fresh does not.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass

from flexclear.pipeline.core.registry import suggestion


@dataclass(frozen=True, slots=True)
class Kind:
    """What may own such a quantity, its physical dimensions, and the variable of the run that holds it."""

    owner: str
    dimensions: tuple[str, ...]
    unit: str
    variable: str


KINDS: dict[str, Kind] = {
    "position": Kind("body", ("length",), "m", "position"),
    "orientation": Kind("body", ("angle",), "rad", "quaternion"),
    "velocity": Kind("body", ("velocity",), "m/s", "velocity"),
    "angular_velocity": Kind("body", ("angular velocity",), "rad/s", "angular_velocity"),
    "force": Kind("joint", ("force",), "N", "joint_force"),
    "moment": Kind("joint", ("torque",), "N m", "joint_moment"),
    "drive_force": Kind("drive", ("force", "torque"), "N or N m", "drive_force"),
    "peak_force": Kind("contact", ("force",), "N", "event_peak_force"),
    "impulse": Kind("contact", ("impulse",), "N s", "contact_impulse"),
    "impact_times": Kind("contact", ("time",), "s", "event_time"),
}


@dataclass(frozen=True, slots=True)
class Quantity:
    """One quantity of one part of a scene."""

    owner: str
    kind: str

    @property
    def name(self) -> str:
        """As `[accuracy]` writes it."""
        return f"{self.owner}.{self.kind}"

    @property
    def unit(self) -> str:
        """SI unit of its values and errors."""
        return KINDS[self.kind].unit


def parse(text: str, owners: Mapping[str, Collection[str]]) -> Quantity:
    """The quantity called `text`.

    owners: names of the scene's parts by what they are (body, joint, drive, contact).
    Raises ValueError that names what could have been meant.
    """
    owner, _, kind = text.rpartition(".")
    if kind not in KINDS:
        raise ValueError(f"there is no quantity '{kind}' ({suggestion(kind, list(KINDS))})")
    known = owners.get(KINDS[kind].owner, ())
    if owner not in known:
        raise ValueError(
            f"'{kind}' belongs to a {KINDS[kind].owner}, and none is called '{owner}' "
            f"({suggestion(owner, sorted(known)) if known else 'the scene has none'})"
        )
    return Quantity(owner, kind)


def usual(joints: Mapping[str, Collection[str]], contacts: Collection[str]) -> list[Quantity]:
    """What is asked of a scene that names nothing: motion of the body with most joints, a reaction, the contacts.

    joints: the bodies that each joint connects, in the scene's order; contacts: those with clearance.
    """
    bodies = [body for pair in joints.values() for body in pair]
    if not bodies:
        return []
    central = max(dict.fromkeys(bodies), key=bodies.count)
    chosen = [Quantity(central, kind) for kind in ("position", "orientation", "velocity")]
    ideal = [name for name, pair in joints.items() if central in pair and name not in contacts]
    chosen += [Quantity(name, "force") for name in ideal[:1]]
    return chosen + [Quantity(name, kind) for name in contacts for kind in ("peak_force", "impulse", "impact_times")]
