"""Elastic forces of tight fits, by the key `form` of a normal law. To add one: a module here, its name in `_Elastic` of
scene/clearance, a line in the table, and a case in tests/properties/test_conforming_contact.

Each has ``resolve(joint) -> Conforming``, from radii and materials; it raises ValueError, in words, for a joint or a
clearance that it does not cover.
"""

from __future__ import annotations

from flexclear.dynamics.contact.conforming import esdu_78035, goldsmith, johnson, liu, pereira, radzimovsky, winkler

CONFORMING = {
    "johnson": johnson.resolve,
    "radzimovsky": radzimovsky.resolve,
    "goldsmith": goldsmith.resolve,
    "esdu-78035": esdu_78035.resolve,
    "liu": liu.resolve,
    "pereira": pereira.resolve,
    "winkler": winkler.resolve,
}
