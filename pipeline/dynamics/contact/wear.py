"""What wears a contact: how far its surfaces slide on each other, and with what force.

The sliding velocity is that of the material points at the contact, spin included, so that rolling wears nothing; it
needs no friction law.  Source: Archard (1953), Journal of Applied Physics 24, 981-988 (depth over force and way);
Flores (2009), Mechanism and Machine Theory 44, 1211-1222 (in joints with clearance).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from flexclear.pipeline.dynamics import memory as m
from flexclear.pipeline.dynamics.contact.forces import point_velocity, tangential
from flexclear.pipeline.dynamics.kernels import kernel
from flexclear.pipeline.dynamics.vectors import at, dot, scale, sub


def wearing(contacts: Callable) -> Callable:
    """The kernel of the contacts that also books sliding distance and load path of those that wear."""

    @kernel
    def wear(h, f, w, k):
        """Rates of contact k among those that wear, which is closed: sliding speed, and normal force times it."""
        c = m.WORN.contact(h, k)
        o, numbers = m.TOUCH.row(h, c), m.CONTACT_NUMBERS.row(h, c)
        outer, inner = m.SITE_FRAMES.row(h, m.CONTACTS.outer(h, c)), m.SITE_FRAMES.row(h, m.CONTACTS.inner(h, c))
        point = at(w, o + m.TOUCH.point)
        radius = f[numbers + m.CONTACT_NUMBERS.radius]
        normal = scale(1.0 / radius, sub(point, at(w, inner + m.FRAME.origin)))
        slip = tangential(normal, sub(point_velocity(w, inner, point), point_velocity(w, outer, point)))
        speed, slots = np.sqrt(dot(slip, slip)), h[m.LEDGER_RATE] + h[m.WEAR_SLOT] + m.WEAR_LEDGER.size * k
        w[slots + m.WEAR_LEDGER.sliding] = speed
        w[slots + m.WEAR_LEDGER.load_path] = speed * w[o + m.TOUCH.normal_force]

    @kernel
    def wear_if_closed(h, f, w, n, k):
        if n[n[m.MODE] + m.WORN.contact(h, k)] == 1:
            wear(h, f, w, k)

    @kernel
    def with_wear(h, f, w, n):
        contacts(h, f, w, n)
        for k in range(h[m.N_WORN]):
            wear_if_closed(h, f, w, n, k)

    return with_wear
