"""Forms of normal forces; laws that share a form differ in numbers only.

Each module has ``force(depth, rate, impact_rate, law) -> (elastic, damping)``, with a sum >= 0, and
``stored(depth, law)``, of numbers that may be symbols; and ``depth(force, law)``, the inverse of the elastic force. law
has the fields of `contact.law.Numbers`.
"""

from __future__ import annotations

from flexclear.dynamics.contact.expression import Laws
from flexclear.dynamics.contact.form import (
    elastic,
    expression,
    hysteretic,
    layer_round_ball,
    layer_round_pin,
    linear_damper,
    liu,
    logarithmic,
)

FORMS = Laws(
    {
        "elastic": elastic,
        "hysteretic": hysteretic,
        "linear-damper": linear_damper,
        "logarithmic": logarithmic,
        "liu": liu,
        "layer-round-pin": layer_round_pin,
        "layer-round-ball": layer_round_ball,
    },
    expression.form_of,
)
