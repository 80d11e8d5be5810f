"""Forms of normal forces: what is compiled. Several laws share one and differ in numbers only.

Each module has the kernels ``force(depth, rate, impact_rate, law) -> (elastic, damping)``, whose sum never pulls, and
``stored(depth, law)``; law has the fields of `contact.law.Numbers`.
"""

KIND = "form of a normal law"
NAMES = {"elastic": "elastic", "hysteretic": "hysteretic", "linear-damper": "linear_damper"}
