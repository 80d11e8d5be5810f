"""Wear of a contact: the sliding distance of its surfaces, and the normal force over it.

The sliding velocity is that of the material points at the contact, spin included, so that rolling causes no wear; it
needs no friction law.  Source: Archard (1953), Journal of Applied Physics 24, 981-988 (depth over force and way);
Flores (2009), Mechanism and Machine Theory 44, 1211-1222 (in joints with clearance).
"""

from __future__ import annotations

from flexclear.dynamics import memory as m

#: ledger variables of each contact: sliding distance [m], and time integral of normal force times sliding speed [N m]
LEDGER = m.layout("sliding load_path")
