"""Wear of a contact: the sliding distance of its surfaces, and the normal force over it.

The sliding velocity is that of the material points at the contact, spin included, so that rolling causes no wear; it
needs no friction law.  Source: Archard (1953), Journal of Applied Physics 24, 981-988 (depth over force and way);
Flores (2009), Mechanism and Machine Theory 44, 1211-1222 (in joints with clearance).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from flexclear.dynamics import memory as m
from flexclear.dynamics.contact.forces import point_velocity, tangential
from flexclear.dynamics.kernels import kernel
from flexclear.dynamics.vectors import dot, scale, sub

#: ledger variables of each contact: sliding distance [m], and time integral of normal force times sliding speed [N m]
LEDGER = m.layout("sliding load_path")


def wearing(contacts: Callable) -> Callable:
    """Build the kernel of the contacts that also accumulates sliding distance and load path of those with wear."""

    @kernel
    def wear(d, k):
        """Store the rates of closed contact k of those with wear: sliding speed, and normal force times that speed."""
        c = d.worn[k].contact
        contact, touch = d.contacts[c], d.touch[c]
        outer, inner, point = d.site_frames[contact.outer], d.site_frames[contact.inner], touch.point
        normal = scale(1.0 / d.contact_numbers[c].radius, sub(point, inner.origin))
        slip = tangential(normal, sub(point_velocity(inner, point), point_velocity(outer, point)))
        speed, slots = np.sqrt(dot(slip, slip)), d.wear_slot + LEDGER.size * k
        d.ledger_rate[slots + LEDGER.sliding] = speed
        d.ledger_rate[slots + LEDGER.load_path] = speed * touch.normal_force

    @kernel
    def wear_if_closed(d, k):
        if d.mode[d.worn[k].contact] == 1:
            wear(d, k)

    @kernel
    def with_wear(d):
        contacts(d)
        for k in range(d.n_worn):
            wear_if_closed(d, k)

    return with_wear
