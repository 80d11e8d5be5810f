"""Warnings and errors of a run whose contacts left the validity range of their laws."""

from __future__ import annotations

import json
from collections.abc import Sequence
from math import e
from typing import TYPE_CHECKING, Any

import numpy as np

from flexclear.dynamics.contact.form.logarithmic import LIMIT_DEPTH
from flexclear.dynamics.contact.surfaces import SURFACES
from flexclear.system.errors import SolverError

if TYPE_CHECKING:
    from flexclear.dynamics.contact.law import Resolved

#: contact size, as a fraction of the inner radius, above which Hertz's theory no longer holds
SMALL_CONTACT = 0.3
#: penetration, as a fraction of the inner radius, above which no contact law holds
SHALLOW = 0.1
#: penetration over the clearance up to which the form 'johnson' holds
JOHNSON = 4.0 * LIMIT_DEPTH / e**2
#: moments below this fraction of the weight times the size of a mechanism tilt no pin
NO_MOMENT = 1e-6


def warnings(name: str, joint: Any, law: Resolved, depth: float, force: float) -> list[str]:
    """Return warnings about a contact that was used outside the range of its law; empty for none.

    name: of the contact, in words.  depth, force: largest penetration [m] and normal force [N] of the run.
    """
    found = [] if law.warning is None else [f"{name}: {law.warning}"]
    if not joint.radius:
        return found  # the end of a coordinate has no surfaces
    surfaces = SURFACES[joint.type]
    size = surfaces.contact_size(joint, depth, force)
    form = getattr(joint.normal, "form", None)
    if joint.normal.needs_materials and form is None and size > SMALL_CONTACT * joint.radius:
        found.append(
            f"{name}: the contact radius reaches {size:.3g} m, {size / joint.radius:.2g} of the inner "
            f"surface's radius; the stiffness from radii and materials (Hertz) holds below {SMALL_CONTACT:g}"
            f"{_instead(joint, depth)}"
        )
    if depth > law.deepest:
        found.append(
            f"{name}: the penetration reaches {depth:.3g} m, but the form '{form}' holds to {law.deepest:.3g} m"
            f"{_instead(joint, depth)}"
        )
    if depth > SHALLOW * joint.radius:
        found.append(
            f"{name}: the penetration reaches {depth:.3g} m, {depth / joint.radius:.2g} of the "
            f"inner surface's radius; contact laws hold below {SHALLOW:g}: "
            "choose a stiffer contact, a slower impact or smaller loads"
        )
    return found


def _instead(joint: Any, depth: float) -> str:
    """Return the form of a tight fit that holds at a penetration [m], as a remedy; empty where none does."""
    if joint.type == "clearance-spherical":
        return "; for a lined socket normal.form = 'winkler' holds"
    if joint.type != "clearance-revolute" or joint.normal.needs_materials is False:
        return ""
    form = "johnson" if depth < JOHNSON * joint.clearance else "pereira"
    return f"; of a tight fit, normal.form = '{form}' does"


def tilting(name: str, joint: Any, moment: float, force: float) -> str:
    """Return a warning about a pin that its joint's constraint keeps from tilting; empty where its contact could.

    name: of the contact, in words.  moment: mean of the constraint's moment across the axis [N m].  force: mean normal
    force [N], which could act at either end of the pin.
    """
    if moment <= 0.5 * joint.length * force:
        return ""
    return (
        f"{name}: it holds its pin parallel to the axis by {moment:.3g} N m on average, more than its contact, with "
        f"{force:.3g} N on a pin of {1e3 * joint.length:.4g} mm, can carry. With its clearance the pin would tilt, by "
        f"up to {2.0 * joint.clearance / joint.length:.2g} rad: an axial_clearance lets it, as do clearance-spherical "
        "joints, at both ends of a pin or one for each of several hinges on an axis"
    )


def deepest(events: np.ndarray, touch: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the largest penetration [m] and normal force [N] of every contact, over its events and the observed rows.

    events: named fields of EVENT, (events,).  touch: named fields of TOUCH, (rows, contacts).
    """
    depths = np.fmax.reduce(-touch["gap"], axis=0, initial=0.0)
    forces = np.fmax.reduce(touch["normal_force"], axis=0, initial=0.0)
    for c in range(touch.shape[1]):
        own = events[events["contact"] == c]
        depths[c] = np.fmax.reduce(own["peak_depth"], initial=depths[c])
        forces[c] = np.fmax.reduce(own["peak_force"], initial=forces[c])
    return depths, forces


def refuse_deep(name: str, joint: Any, depth: float) -> None:
    """Raise SolverError when the inner centre has passed through the outer surface: penetration [m] above the radius.

    name: of the contact, in words.
    """
    if problem := pressed_through(name, joint, depth):
        raise SolverError(f"{problem}: choose a stiffer contact, a slower impact or smaller loads")


def pressed_through(name: str, joint: Any, depth: float) -> str:
    """Return the error text for a contact that `refuse_deep` refuses; empty for others."""
    if not depth > joint.radius > 0.0:
        return ""
    return (
        f"{name}: the penetration reached {depth:.3g} m, more than the inner surface's radius "
        f"({joint.radius:.3g} m), so that the inner surface's centre passed the "
        "outer surface, where no contact law holds"
    )


def laws(contacts: Sequence[tuple[Any, ...]], resolved: Sequence[Resolved]) -> str:
    """Return the resolved law of every contact as JSON, for the dataset's attributes."""
    found = {
        name: {
            "law": joint.normal.law,
            **({"form": joint.normal.form} if getattr(joint.normal, "form", None) else {}),
            "exponent": law.numbers.exponent if law.numbers.stiffness else None,
            "stiffness": law.numbers.stiffness or None,
            "restitution_parameter": law.parameter,
            "delivered_restitution": law.delivered,
            "friction": None if joint.friction is None else joint.friction.law,
        }
        for (name, joint, *_), law in zip(contacts, resolved, strict=True)
    }
    return json.dumps(found, sort_keys=True)
