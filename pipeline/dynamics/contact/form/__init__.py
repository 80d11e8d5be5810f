"""Forms of normal forces: what is compiled. Several laws share one and differ in numbers only.

Each module has the kernels ``force(depth, rate, impact_rate, p) -> (elastic, damping)`` and
``stored(depth, p)``; p holds four numbers. Their sum never pulls.
"""

KIND = "form of a normal law"
NAMES = {
    "elastic": "elastic:force",
    "hysteretic": "hysteretic:force",
    "linear-damper": "linear_damper:force",
}
