"""Normal contact laws. To add one: a module here named like the law, its name, or the class of its keys, in
scene/clearance, a line in the table below, and a case in tests/properties/test_dynamics_laws.

Each has ``resolve(law, stiffness, mass) -> Resolved`` (see `contact.law`): the numbers for one of the compiled forms in
`contact.form`, and the restitution of a free impact. It raises ValueError, in words, for what it cannot deliver.
"""

from __future__ import annotations

from collections.abc import Callable

from flexclear.dynamics.contact.law import Resolved
from flexclear.dynamics.contact.normal import (
    carvalho_martins,
    flores,
    gonthier,
    herbert_mcwhannell,
    hertz,
    hu_guo,
    hunt_crossley,
    kelvin_voigt,
    lankarani_nikravesh,
    lee_wang,
    zhiying_qishao,
)

NORMAL_LAWS: dict[str, Callable[..., Resolved]] = {
    "hertz": hertz.resolve,
    "hunt-crossley": hunt_crossley.resolve,
    "herbert-mcwhannell": herbert_mcwhannell.resolve,
    "lee-wang": lee_wang.resolve,
    "lankarani-nikravesh": lankarani_nikravesh.resolve,
    "gonthier": gonthier.resolve,
    "flores": flores.resolve,
    "hu-guo": hu_guo.resolve,
    "zhiying-qishao": zhiying_qishao.resolve,
    "carvalho-martins": carvalho_martins.resolve,
    "kelvin-voigt": kelvin_voigt.resolve,
}
