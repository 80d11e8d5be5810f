"""Arguments of expressions, each read by one kernel; `compile.formulas` composes loads from these kernels."""

from __future__ import annotations

import numpy as np  # noqa: F401

from flexclear.dynamics import gauge
from flexclear.dynamics.kernels import kernel
from flexclear.dynamics.loads.fields import law, line, number  # noqa: F401
from flexclear.dynamics.loads.lookup import curve, surface  # noqa: F401
from flexclear.dynamics.vectors import add, dot, scale, sub  # noqa: F401


@kernel
def index(d, k, i):
    """Return the i-th index that load k reads: the index of a site, or of a gauge."""
    return d.looks[d.loads[k].look0 + i].index


@kernel
def constant(d, k, i):
    """Return the i-th number of the expression of load k."""
    return number(d, k, 3 + i)


@kernel
def position(d, k, i):
    """Return the origin of a site in the world."""
    return add(d.site_frames[index(d, k, i)].origin, (number(d, k, 0), number(d, k, 1), number(d, k, 2)))


@kernel
def velocity(d, k, i):
    """Return the velocity of a site's origin."""
    return d.site_frames[index(d, k, i)].velocity


@kernel
def omega(d, k, i):
    """Return the angular velocity of a site."""
    return d.site_frames[index(d, k, i)].omega


@kernel
def coordinate(d, k, i):
    """Return a joint coordinate, with full turns counted."""
    value, _, _, _ = gauge.counted(d, index(d, k, i))
    return value


@kernel
def coordinate_rate(d, k, i):
    """Return the rate of a joint coordinate."""
    _, rate, _, _ = gauge.counted(d, index(d, k, i))
    return rate


@kernel
def note(d, k, i, value):
    """Store the i-th watched value of load k, at whose zero the slope jumps; guards watch it."""
    bend = d.load_bends[d.loads[k].bend0 + i]
    bend.now = value
