"""Sections of a flexible rod that loads stiffen: what it resists beyond its modal stiffness."""

from __future__ import annotations

from typing import Any, NamedTuple

from flexclear.dynamics.mechanics.closures import Rows
from flexclear.dynamics.mechanics.flexible import by_mode, weighted_sum
from flexclear.dynamics.mechanics.trees import Numbers
from flexclear.dynamics.routines.calls import routine
from flexclear.dynamics.specialise.symbols import cos, sin
from flexclear.dynamics.vectors import ZERO, Symmetric, Vector, dot


class Station(NamedTuple):
    """A section of a rod: rotation and curvature per mode, a row per axis; stiffness of twist and bending."""

    rotation: Rows
    curvature: Rows
    stiffness: Symmetric


@routine
def curvature(theta: Vector, kappa: Vector, station: Station, q: Numbers) -> tuple[Vector, Vector]:
    """Add the parts of some modes to rotation and curvature at a station."""
    return weighted_sum(by_mode(station.rotation), q, theta), weighted_sum(by_mode(station.curvature), q, kappa)


def strained(theta: Vector, kappa: Vector) -> tuple[Any, Any, Vector]:
    """Return cosine and sine of the twist of a section, and its strain in twisted axes."""
    c, s = cos(theta[0]), sin(theta[0])
    twist = kappa[0] - 0.5 * (theta[1] * kappa[2] - theta[2] * kappa[1])
    return c, s, Vector([twist, c * kappa[1] + s * kappa[2], c * kappa[2] - s * kappa[1]])


@routine
def resisting(stiffness: Symmetric, theta: Vector, kappa: Vector) -> tuple[Vector, Vector]:
    """Return what a rod's section resists beyond the modal stiffness, per rotation and per curvature.

    Rods resist bending in the axes of their twisted sections, and bending across bending twists them.
    """
    c, s, strain = strained(theta, kappa)
    torque, m2, m3 = stiffness @ strain
    half = 0.5 * torque
    on_rotation = Vector([m2 * strain[2] - m3 * strain[1], -half * kappa[2], half * kappa[1]])
    on_curvature = Vector([torque, c * m2 - s * m3 + half * theta[2], s * m2 + c * m3 - half * theta[1]])
    return on_rotation, on_curvature - stiffness @ kappa


@routine
def bent_forces(forces: Numbers, station: Station, on_rotation: Vector, on_curvature: Vector) -> list[Any]:
    """Add what a section resists to the forces that some modes need."""
    both = zip(forces, by_mode(station.rotation), by_mode(station.curvature), strict=True)
    return [f + dot(on_rotation, turn) + dot(on_curvature, curve) for f, turn, curve in both]


@routine
def bend(forces: Numbers, station: Station, q: Numbers) -> tuple[list[Any], tuple[Vector, Vector]]:
    """Add the forces of a rod's elastic energy beyond that of its modal stiffness, at a station, to those on modes, and
    return its rotation and curvature."""
    section = curvature(ZERO, ZERO, station, q)
    return bent_forces(forces, station, *resisting(station.stiffness, *section)), section


@routine
def bending_energy(stiffness: Symmetric, section: tuple[Vector, Vector], elastic: Any) -> Any:
    """Return the sum with a rod's elastic energy beyond that of its modal stiffness, at a station; see `bend`."""
    _, _, strain = strained(*section)
    return elastic + 0.5 * (dot(strain, stiffness @ strain) - dot(section[1], stiffness @ section[1]))
