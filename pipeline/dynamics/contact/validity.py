"""What a run says when its contacts left the range for which their laws were made."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

from pipeline.core.registry import lookup
from pipeline.dynamics.contact.law import Resolved

#: above this share of the inner radius a contact is no longer small and Hertz's theory ends
SMALL = 0.3


def warnings(name: str, joint: Any, law: Resolved, depth: float, force: float) -> list[str]:
    """Sentences about a contact that was used outside the range of its law; empty when it was not.

    name: in words.  depth, force: largest penetration [m] and normal force [N] of the run.
    """
    found = [] if law.warning is None else [f"{name}: {law.warning}"]
    if joint.normal.stiffness is not None:
        return found
    surfaces = lookup("pipeline.dynamics.contact", joint.type, where=name)
    size = surfaces.contact_size(joint, depth, force)
    if size > SMALL * joint.radius:
        found.append(
            f"{name}: the contact grows to a radius of {size:.3g} m, {size / joint.radius:.2g} of the inner "
            f"surface's; its stiffness from radii and materials (Hertz) holds below {SMALL:g}"
        )
    return found


def laws(contacts: Sequence[tuple[str, Any, Any, Any]], resolved: Sequence[Resolved]) -> str:
    """What every contact was made with, as JSON for the dataset's attributes."""
    found = {
        name: {
            "law": joint.normal.law,
            "exponent": law.exponent,
            "stiffness": law.numbers[0],
            "restitution_parameter": law.parameter,
            "delivered_restitution": law.delivered,
            "friction": None if joint.friction is None else joint.friction.law,
        }
        for (name, joint, _, _), law in zip(contacts, resolved, strict=True)
    }
    return json.dumps(found, sort_keys=True)
