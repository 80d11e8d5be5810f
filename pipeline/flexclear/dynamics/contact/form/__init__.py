"""Forms of normal forces; laws that share a form differ in numbers only.

Each module has ``force(depth, rate, impact_rate, law) -> (elastic, damping)``, with a sum >= 0, and
``stored(depth, law)``, of numbers that may be symbols; and ``depth(force, law)``, the inverse of the elastic force. law
has the fields of `contact.law.Numbers`.
"""

from __future__ import annotations

from flexclear.dynamics.contact.form import elastic, hysteretic, linear_damper

FORMS = {"elastic": elastic, "hysteretic": hysteretic, "linear-damper": linear_damper}
