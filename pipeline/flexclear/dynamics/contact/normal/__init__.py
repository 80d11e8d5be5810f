"""Normal contact laws. To add one: a module here, a line below, and a case in tests/properties/test_dynamics_laws.

Each is a module, or the `LAW` in it, with its own ``exponent`` and with ``resolve(law, stiffness, mass) -> Resolved``
(see `contact.law`): the numbers for one of the compiled forms in `contact.form`, and the restitution of a free impact.
"""

from __future__ import annotations

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

NORMAL_LAWS = {
    "hertz": hertz,
    "hunt-crossley": hunt_crossley.LAW,
    "herbert-mcwhannell": herbert_mcwhannell.LAW,
    "lee-wang": lee_wang.LAW,
    "lankarani-nikravesh": lankarani_nikravesh.LAW,
    "gonthier": gonthier.LAW,
    "flores": flores.LAW,
    "hu-guo": hu_guo.LAW,
    "zhiying-qishao": zhiying_qishao.LAW,
    "carvalho-martins": carvalho_martins.LAW,
    "kelvin-voigt": kelvin_voigt,
}
