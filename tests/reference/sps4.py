"""Data of the 4-SPS/PS mechanism for the independent solutions, typed once more from the paper.

SI units. Masses and inertias: Wang & Wang (2019), Table 1; contact: Tables 3 and 6; drive: eq. (35).
World z is up, origin in the plane of the base ball centres; the platform frame starts parallel to the
world. The paper prints no joint positions: the layout of the scenes, and the one that was assumed before
it, with which the second derivations of clearance and flexibility were run.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

Array = np.ndarray

SIGNS = np.array([[1.0, 1.0], [1.0, -1.0], [-1.0, 1.0], [-1.0, -1.0]])


@dataclass(frozen=True)
class Layout:
    """Joint centres A_k in the platform frame and B_k in the world, shape (4, 3), and the start height [m]."""

    A: Array = field(repr=False)
    B: Array = field(repr=False)
    height: float

    @property
    def length(self) -> float:
        """Distance between the ball centres of a leg at the start [m]."""
        dx, dy, _ = self.A[0] - self.B[0]
        return float(np.sqrt(dx**2 + dy**2 + self.height**2))


def _placed(on_platform: list[float], on_base: list[float], height: float) -> Layout:
    A, B = (np.column_stack([SIGNS * place, np.zeros(4)]) for place in (on_platform, on_base))
    return Layout(A, B, height)


#: the layout identified from Table 8, that of the scenes
LAYOUT = _placed([0.1186215235792, 0.07], [0.15, 0.35], 0.23288976482063)
#: the layout that was assumed before
FIRST = _placed([0.086603, 0.05], [0.1, 0.173205], 0.35)


@dataclass(frozen=True)
class Rigid:
    """A body on the axis of its chain: mass [kg], principal moments about its centre [kg m^2]."""

    mass: float
    transverse: float
    axial: float


BALL = Rigid(0.36, 85.866e-6, 46.728e-6)
CYLINDER = Rigid(2.08, 7991.531e-6, 415.648e-6)
ROD = Rigid(0.21, 996.802e-6, 10.330e-6)
CENTRAL_ROD = Rigid(0.59, 2837.976e-6, 29.409e-6)
SOCKET = Rigid(0.30, 98.769e-6, 127.400e-6)
PLATE = Rigid(0.31, 1040.159e-6, 2080.267e-6)
#: centre of mass of a ball with its stem, from the ball's centre along the stem [m]
BALL_CENTRE = 5.4545e-3
#: centre of mass of a cylinder from B, and of a rod from A [m]
CYLINDER_CENTRE, ROD_CENTRE = 0.146, 0.160


def _joined(parts: list[tuple[Rigid, float]]) -> tuple[float, float, float, float]:
    """Mass, first moment, transverse second moment about the origin, axial moment, of bodies along one axis."""
    mass = sum(p.mass for p, _ in parts)
    first = sum(p.mass * s for p, s in parts)
    second = sum(p.transverse + p.mass * s * s for p, s in parts)
    return mass, first, second, sum(p.axial for p, _ in parts)


#: lower part of a leg (ball, cylinder) about B, towards A
LOWER = _joined([(BALL, BALL_CENTRE), (CYLINDER, CYLINDER_CENTRE)])
#: upper part of a leg (rod, ball) about A, towards B
UPPER = _joined([(BALL, BALL_CENTRE), (ROD, ROD_CENTRE)])
#: rod and ball of the central chain, which only slide along z [kg]
CENTRAL_MASS = CENTRAL_ROD.mass + BALL.mass


@dataclass(frozen=True)
class Plate:
    """The platform with its five sockets: mass, centre [m] and inertia about the platform origin."""

    mass: float
    centre: Array = field(repr=False)
    inertia: Array = field(repr=False)


def platform(layout: Layout, plate_height: float = 0.0, socket_height: float = 0.0) -> Plate:
    """The merged platform; heights of the centres of mass above the plane of the joint centres [m]."""
    places = [np.zeros(3), *layout.A]
    bodies = [(PLATE, np.array([0.0, 0.0, plate_height]))]
    bodies += [(SOCKET, p + np.array([0.0, 0.0, socket_height])) for p in places]
    mass = sum(b.mass for b, _ in bodies)
    centre = sum(b.mass * p for b, p in bodies) / mass
    inertia = sum(
        np.diag([b.transverse, b.transverse, b.axial]) + b.mass * (p @ p * np.eye(3) - np.outer(p, p))
        for b, p in bodies
    )
    return Plate(mass, centre, inertia)


@dataclass(frozen=True)
class Contact:
    """The clearance joint A1 (Tables 3 and 6; the coefficient of restitution is assumed)."""

    clearance: float = 0.5e-3
    ball_radius: float = 0.02
    youngs_modulus: float = 2.068e11
    poisson: float = 0.29
    restitution: float = 0.9
    mu_static: float = 0.15
    mu_dynamic: float = 0.1
    v_static: float = 0.2e-3
    v_dynamic: float = 10e-3
    floor: float = 1e-6

    @property
    def stiffness(self) -> float:
        """K [N/m^1.5], eq. (26) for two equal materials."""
        sigma = (1.0 - self.poisson**2) / (np.pi * self.youngs_modulus)
        socket = self.ball_radius + self.clearance
        return float(4.0 / (3.0 * np.pi * 2.0 * sigma) * np.sqrt(socket * self.ball_radius / self.clearance))

    @property
    def hysteresis(self) -> float:
        """Factor of d'/d'0 in eq. (25)."""
        return 0.75 * (1.0 - self.restitution**2)


STROKE = 0.06


def drive(t: float, side: int = 1) -> tuple[float, float, float]:
    """Extension [m], speed and acceleration of legs 1 and 2 (eq. 35); side +1/-1 chooses the limit at a break."""
    rises = t < 0.09 if side > 0 else t <= 0.09
    inside = (0.0 <= t < 0.18) if side > 0 else (0.0 < t <= 0.18)
    if not inside:
        return 0.0, 0.0, 0.0
    x = t / 0.09 if rises else (t - 0.09) / 0.09
    sign = 1.0 if rises else -1.0
    s = STROKE * x * x * (3.0 - 2.0 * x)
    rate = sign * STROKE * 6.0 * x * (1.0 - x) / 0.09
    acceleration = sign * STROKE * (6.0 - 12.0 * x) / 0.09**2
    return (s if rises else STROKE - s), rate, acceleration


def leg_lengths(layout: Layout, t: float, side: int = 1) -> tuple[Array, Array, Array]:
    """Distances between ball centres of the four legs and their two time derivatives, each shape (4,)."""
    moved = np.array([1.0, 1.0, 0.0, 0.0])
    s, rate, acceleration = drive(t, side)
    return layout.length + s * moved, rate * moved, acceleration * moved
