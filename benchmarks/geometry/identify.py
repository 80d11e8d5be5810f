"""Layouts that have the sensitivities of Table 8, in closed form, and the one that is taken.

At the start the platform is level. A change of leg 1 alone then lifts and turns it as half of that change in legs 1
and 2 does (the other half twists it about x and z): legs 3 and 4 are held, so that the lines A3, A4 stay where they are
and dz = ax dangle. With n the direction of the legs, 2 n_z dz = 1/2. Both are largest at the start; so

    ax = dz / dangle,    height / leg length = n_z = 1 / (4 dz),

and the other three numbers of a layout, ay, bx, by, are free. Table 8 prints the clearance times dz and
dangle.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np

from benchmarks.geometry.kinematics import STROKE, Answer, Layout, answer
from flexclear.papers.wang_wang_2019.published import TABLE3, TABLE8

CLEARANCE = TABLE3["socket_radius"] - TABLE3["ball_radius"]
#: sensitivities that Table 8 has [m/m, rad/m]
DZ, DANGLE = 1e-3 * TABLE8.displacement / CLEARANCE, TABLE8.angle / CLEARANCE
#: the layouts are looked for on this grid [m]
STEP = 0.01
GRID = {"ay": (0.02, 0.08), "bx": (0.02, 0.36), "by": (0.02, 0.40)}
#: limits: legs between ball centres, so that rods stay in their cylinders; joints of the platform within the circle
#: through the corners of its plate, 200 mm square; cylinders of 20 and sockets of 25 mm next to each other [m]
SHORTEST, LONGEST, REACH, CYLINDERS, SOCKETS = 0.32, 0.46, 0.1 * np.sqrt(2.0), 0.04, 0.05
WORST_CONDITION = 10.0
#: the layout that was assumed before: joints of the platform on a circle of 100 mm, those of the base on one of 200 mm
FIRST = Layout(0.086603, 0.05, 0.1, 0.173205, 0.35)
#: what is printed has four digits: sensitivities within half a unit of the third, so that those count that have their
#: largest value next to the start as well
AGREES = 1e-3


@dataclass(frozen=True)
class Member:
    """A layout of the family and its answer."""

    layout: Layout
    answer: Answer


def fitted(ay: float, bx: float, by: float) -> Layout:
    """The layout that has Table 8's sensitivities at the start, with these three numbers [m]."""
    ax, upright = DZ / DANGLE, 1.0 / (4.0 * DZ)
    across = float(np.hypot(ax - bx, ay - by))
    return Layout(ax, ay, bx, by, across * upright / np.sqrt(1.0 - upright**2))


def admissible(layout: Layout) -> bool:
    """Whether its legs and sockets can be built, before it is moved."""
    return bool(
        layout.leg >= SHORTEST
        and layout.leg + STROKE <= LONGEST
        and np.hypot(layout.ax, layout.ay) <= REACH
        and 2.0 * min(layout.ay, layout.bx, layout.by) >= SOCKETS
    )


def family(step: float = STEP) -> list[Member]:
    """All admissible layouts on the grid that keep Table 8's sensitivities over the stroke and whose legs have room."""
    axes = [np.arange(round(low / step), round(high / step) + 1) * step for low, high in GRID.values()]
    found = []
    for ay, bx, by in product(*axes):
        layout = fitted(float(ay), float(bx), float(by))
        if not admissible(layout):
            continue
        try:
            reached = answer(layout)
        except ValueError:
            continue
        off = max(abs(reached.dz / DZ - 1.0), abs(reached.dangle / DANGLE - 1.0))
        if off < AGREES and reached.condition <= WORST_CONDITION and reached.room >= CYLINDERS:
            found.append(Member(layout, reached))
    return found


def chosen(members: list[Member]) -> Member:
    """The rule: the least condition number over the stroke, that is the layout farthest from a singular one."""
    return min(members, key=lambda member: member.answer.condition)


def on_the_plate(layout: Layout) -> bool:
    """Whether the platform's joint centres lie over its square plate, however that is turned."""
    half = REACH / np.sqrt(2.0)
    return bool(max(layout.ax, layout.ay) <= half or layout.ax + layout.ay <= REACH)
