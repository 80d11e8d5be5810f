"""Stress recovery by kind of body; its variables are part of a bundle when a scene requests stress.

To add one: a module here with ``recover(mesh, modes, gauges) -> dict``, the variables STRESS of the contract, and a
line below.
"""

from __future__ import annotations

from flexclear.structure.stress import beam, solid

RECOVERIES = {"beam": beam.recover, "solid": solid.recover}
