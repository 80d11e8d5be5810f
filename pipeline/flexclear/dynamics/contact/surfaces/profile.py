r"""Profiles of worn surfaces: the depth that wear has taken at each direction from a surface's centre.

A pin's or journal's depth is a periodic cubic spline over the angle :math:`\theta` about z, through the middles of the
sectors. That of a ball or socket is bicubic over this angle and :math:`\zeta`, the direction's component along z,
through the middles of the bands and the mean of the last band at either pole.

With depths :math:`h` along the line of centres the gap is :math:`g = c + h_o(R_A^T n) + h_i(R_B^T n) - |p|`. Force and
moment are :math:`N \nabla g` with respect to the position and the orientation of the inner body, so that they do the
work that the gap's change takes from the contact.
Source: Flores (2009), Mechanism and Machine Theory 44, 1211-1222 (worn radii by angle); Mukras et al. (2010), Journal
of Tribology 132, 031604 (clearance whose shape and size follow from wear).
"""

from __future__ import annotations

from math import pi
from typing import Any, NamedTuple

import numpy as np

from flexclear.dynamics.contact.surfaces.separation import Separation, across
from flexclear.dynamics.specialise.intervals import NOWHERE, cubic, interval, slope
from flexclear.dynamics.specialise.symbols import arctan2, larger, select, sqrt
from flexclear.dynamics.vectors import AXES, Vector, cross, dot


class Worn(NamedTuple):
    """A separation of worn surfaces.

    arm: from the inner centre to the contact.  steepness: of the gap over the position.  moment: of a normal force of
    1 N on the inner body, about its centre, without the force at the contact.
    """

    separation: Separation
    arm: Vector
    steepness: Any
    moment: Vector


def levels(count: int) -> int:
    """Return how often as many intervals are halved to find one."""
    return (count - 1).bit_length()


def numbers(depths: np.ndarray) -> tuple[tuple[int, ...], list[float]]:
    """Return the halvings and the numbers of a profile; depths: by band and sector [m], of pins in one band."""
    from scipy.interpolate import CubicSpline

    bands, sectors = depths.shape
    angles = 2.0 * pi * (np.arange(sectors + 1) + 0.5) / sectors
    around = CubicSpline(angles, np.column_stack([depths, depths[:, :1]]), axis=1, bc_type="periodic").c[::-1]
    values, axes = np.moveaxis(around, 0, 1), [angles]  # (interval, power, band)
    if bands > 1:
        heights = np.concatenate([[-1.0], 2.0 * (np.arange(bands) + 0.5) / bands - 1.0, [1.0]])
        poles = np.zeros((2, sectors, 4))
        poles[..., 0] = depths[[0, -1]].mean(axis=1, keepdims=True)
        rows = np.concatenate([poles[:1], np.moveaxis(values, 2, 0), poles[1:]])
        values = np.moveaxis(CubicSpline(heights, rows).c[::-1], (1, 0), (1, 3))  # (sector, band, power, power)
        axes.append(heights)
    else:
        values = values[..., 0]
    return _pack(axes, values)


def _pack(axes: list[np.ndarray], values: np.ndarray) -> tuple[tuple[int, ...], list[float]]:
    """Return halvings of the axes, and the numbers of a profile: starts of intervals, then their polynomials."""
    halvings = tuple(levels(len(axis) - 1) for axis in axes)
    room = np.zeros([*(2**n for n in halvings), *([4] * len(axes))])
    room[tuple(slice(len(axis) - 1) for axis in axes)] = values
    starts = [[*axis[:-1], *[NOWHERE] * (2**n - len(axis) + 1)] for axis, n in zip(axes, halvings, strict=True)]
    return halvings, [*(float(x) for row in starts for x in row), *room.ravel().tolist()]


def separate(profile: Any, sizes: Any, frames: Any, near: Separation, v: Vector) -> Worn:
    """Return the separation of worn surfaces from that of round ones.

    profile: halvings, and the numbers of the outer and the inner surface.  sizes: with `clearance` and `radius`.
    frames: motion of both.  v: of the inner centre as seen from the outer frame.
    """
    (A, B), (halvings, outer, inner), n = frames, profile, near.normal
    (h_o, rise_o), (h_i, rise_i) = (
        _depth(numbers, halvings, frame.R_WB.T @ n) for frame, numbers in ((A, outer), (B, inner))
    )
    G_o, G_i, distance = A.R_WB @ rise_o, B.R_WB @ rise_i, sizes.clearance - near.gap
    # 1e-300: centres that coincide have no contact, whatever the direction
    uphill = n - (1.0 / larger(distance, 1e-300)) * (G_o + G_i)
    turn, steepness = cross(n, G_i), sqrt(dot(uphill, uphill))
    normal, arm = (1.0 / steepness) * uphill, (sizes.radius - h_i) * n
    approach = dot(uphill, v) + dot(turn, B.omega - A.omega)
    worn = Separation(near.gap + h_o + h_i, approach, normal, near.turning, near.offset)
    return Worn(worn, arm, steepness, cross(arm, normal) - (1.0 / steepness) * turn)


def _depth(numbers: Any, halvings: tuple[int, ...], d: Vector) -> tuple[Any, Vector]:
    """Return the depth at a direction in the surface's frame, and its slope over a turn of that direction."""
    angle = arctan2(d[1], d[0])
    angle = select(angle < numbers[0], angle + 2.0 * pi, angle)
    i = interval(numbers, 0, halvings[0], angle)
    s, first = angle - numbers[i], sum(2**n for n in halvings)
    around = cross(AXES[2], d)
    if len(halvings) == 1:
        at = first + 4 * i
        return cubic(numbers, at, s), slope(numbers, at, s) * around
    begins = 1 << halvings[0]
    j = interval(numbers, begins, halvings[1], d[2])
    r, at = d[2] - numbers[begins + j], first + 16 * ((1 << halvings[1]) * i + j)
    rows = [cubic(numbers, at + 4 * k, r) for k in range(4)]
    rising = [slope(numbers, at + 4 * k, r) for k in range(4)]
    over_angle = rows[1] + s * (2.0 * rows[2] + 3.0 * s * rows[3])
    value, over_height = (c[0] + s * (c[1] + s * (c[2] + s * c[3])) for c in (rows, rising))
    # at a pole the depth does not depend on the angle
    aside = larger(d[0] * d[0] + d[1] * d[1], 1e-300)
    return value, (over_angle / aside) * around + over_height * across(d, AXES[2])
