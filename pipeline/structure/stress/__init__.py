"""What stress recovery needs of a body, by its kind; part of a bundle when a scene asks for it.

To add one: a module here with ``recover(mesh, modes, gauges) -> dict``, the variables STRESS of the contract, and a
line below.
"""

KIND = "stress recovery"
NAMES = {"beam": "beam:recover", "solid": "solid:recover"}
