"""Normal contact laws. To add one: a module here, a line below; the property tests pick it up.

Each module has ``parameters(law, stiffness)`` (four numbers for the kernel) and the kernels
``force(depth, rate, impact_rate, p)`` and ``stored(depth, p)``; p holds the four numbers.
"""

KIND = "normal law"
NAMES = {"hertz": "hertz:Hertz", "lankarani-nikravesh": "lankarani_nikravesh:LankaraniNikravesh"}
