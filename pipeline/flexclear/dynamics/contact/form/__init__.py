"""Compiled forms of normal forces; laws that share a form differ in numbers only.

Each module has the kernels ``force(depth, rate, impact_rate, law) -> (elastic, damping)``, with a sum >= 0, and
``stored(depth, law)``, and the function ``depth(force, law)``, the inverse of the elastic force; law has the fields of
`contact.law.Numbers`.
"""

from __future__ import annotations

from flexclear.dynamics.contact.expression import Laws
from flexclear.dynamics.contact.form import elastic, expression, hysteretic, linear_damper

FORMS = Laws({"elastic": elastic, "hysteretic": hysteretic, "linear-damper": linear_damper}, expression.form_of)
