"""Compiled forms of normal forces; laws that share a form differ in numbers only.

Each module has the kernels ``force(depth, rate, impact_rate, law) -> (elastic, damping)``, with a sum >= 0, and
``stored(depth, law)``; law has the fields of `contact.law.Numbers`.
"""

KIND = "form of a normal law"
NAMES = {"elastic": "elastic", "hysteretic": "hysteretic", "linear-damper": "linear_damper"}
