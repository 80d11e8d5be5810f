"""Layouts that are symmetric to both vertical planes: kinematics, and those that have the sensitivities of Table 8.

Joints are at A = (+-ax, +-ay, 0) of the platform and B = (+-bx, +-by, 0) of the base; legs 1 and 2 at +x are driven
together, 3 and 4 held, so that the platform rises and turns about y alone.

At the start the platform is level. A change of leg 1 alone then lifts and turns it as half of that change in legs 1
and 2 does (the other half twists it about x and z): legs 3 and 4 are held, so that the lines A3, A4 stay where they are
and dz = ax dangle. With n the direction of the legs, 2 n_z dz = 1/2. Both are largest at the start; so

    ax = dz / dangle,    height / leg length = n_z = 1 / (4 dz),

and the other three numbers of a layout, ay, bx, by, are free. Table 8 prints the clearance times dz and
dangle.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations, product
from typing import Any

import numpy as np

from flexclear.commands.scenes import find_scene
from flexclear.papers.wang_wang_2019.deviations import Deviation
from flexclear.papers.wang_wang_2019.published import TABLE3, TABLE8
from flexclear.pipeline.core.scene.load import load_scene
from flexclear.pipeline.core.scene.schema import Scene

#: length in units of which turns are counted in condition numbers, as everywhere here [m]
SCALE = 0.1
#: stroke of legs 1 and 2, eq. (35) [m], and places on it that are looked at
STROKE, PLACES = 0.06, 25
#: of Newton's method for the height, and when it is there [m]
ITERATIONS, CONVERGED = 30, 1e-14
#: signs of x and y of the joints of legs 1 to 4
SIGNS = np.array([[1.0, 1.0], [1.0, -1.0], [-1.0, 1.0], [-1.0, -1.0]])


@dataclass(frozen=True)
class Layout:
    """Places of the joints and start height of the platform's [m]."""

    ax: float
    ay: float
    bx: float
    by: float
    height: float

    @property
    def A(self) -> np.ndarray:
        """Joints of the platform in its frame, (4, 3)."""
        return np.column_stack([SIGNS * [self.ax, self.ay], np.zeros(4)])

    @property
    def B(self) -> np.ndarray:
        """Joints of the base, (4, 3)."""
        return np.column_stack([SIGNS * [self.bx, self.by], np.zeros(4)])

    @property
    def leg(self) -> float:
        """Length of a leg between its ball centres at the start [m]."""
        return float(np.linalg.norm(self.A[0] + [0.0, 0.0, self.height] - self.B[0]))


@dataclass(frozen=True)
class Answer:
    """What a layout does over the stroke.

    dz, dangle: largest change of height [m/m] and of the angle about y [rad/m] per change of leg 1's length.
    lift [m], tilt [rad]: of the whole stroke.  condition: the largest.  room: least distance of two legs' axes, or of
    one and the central chain's [m].
    """

    dz: float
    dangle: float
    lift: float
    tilt: float
    condition: float
    room: float


def poses(layout: Layout, extensions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Heights [m] and angles about y [rad] of the platform when legs 1 and 2 are longer by so much [m]; both (n,).

    Newton's method for the height; ValueError where the legs do not reach.
    """
    driven, held = (layout.leg + extensions) ** 2, layout.leg**2
    ax, bx, across = layout.ax, layout.bx, (layout.ay - layout.by) ** 2
    drop, mean = (driven - held) / (4.0 * ax), 0.5 * (driven + held)
    z = layout.height + 0.5 * extensions
    for _ in range(ITERATIONS):
        sine = -drop / z
        if not np.all(np.abs(sine) < 1.0):
            break
        cosine = np.sqrt(1.0 - sine**2)
        miss = ax**2 + bx**2 - 2.0 * ax * bx * cosine + across + z**2 - mean
        step = miss / (2.0 * z - 2.0 * ax * bx * sine**2 / (cosine * z))
        z = z - step
        if np.abs(step).max() < CONVERGED:
            return z, np.arcsin(-drop / z)
    raise ValueError(f"the legs of {layout} do not reach over the stroke")


def turned(layout: Layout, angles: np.ndarray) -> np.ndarray:
    """Joints of the platform from its centre, world axes, shape (n, 4, 3)."""
    x, y = layout.A[:, 0], layout.A[:, 1]
    c, s = np.cos(angles)[:, None], np.sin(angles)[:, None]
    return np.stack([x * c, np.broadcast_to(y, (len(angles), 4)), -x * s], axis=2)


def jacobians(layout: Layout, heights: np.ndarray, angles: np.ndarray) -> np.ndarray:
    """Rates of the legs' lengths per rate of the height and of the rotation vector, shape (n, 4, 4)."""
    r = turned(layout, angles)
    d = r + np.array([0.0, 0.0, 1.0]) * heights[:, None, None] - layout.B
    n = d / np.linalg.norm(d, axis=2, keepdims=True)
    return np.concatenate([n[:, :, 2:], np.cross(r, n)], axis=2)


def answer(layout: Layout, stroke: float = STROKE) -> Answer:
    """The layout's answer; ValueError where it cannot make the stroke."""
    heights, angles = poses(layout, np.linspace(0.0, stroke, PLACES))
    J = jacobians(layout, heights, angles)
    moves = np.abs(np.linalg.inv(J)[:, :, 0]).max(axis=0)
    condition = np.linalg.cond(J @ np.diag([1.0, 1.0 / SCALE, 1.0 / SCALE, 1.0 / SCALE])).max()
    # of the angle asin R[0, 2] in a pose turned about y alone the rate is that of the rotation about y
    motion = float(moves[0]), float(moves[2]), float(np.ptp(heights)), float(np.abs(angles).max())
    return Answer(*motion, float(condition), _room(layout, heights, angles))


def _room(layout: Layout, heights: np.ndarray, angles: np.ndarray) -> float:
    """Least distance of the axes of two legs, or of a leg and the central chain."""
    up = np.array([0.0, 0.0, 1.0])
    tops = turned(layout, angles) + up * heights[:, None, None]
    below, above = np.broadcast_to(-up, (len(heights), 3)), up * heights[:, None]
    feet = np.broadcast_to(layout.B, tops.shape)
    bars = [(feet[:, k], tops[:, k]) for k in range(4)] + [(below, above)]
    return min(_apart(*one, *other) for one, other in combinations(bars, 2))


def _apart(a: np.ndarray, b: np.ndarray, c: np.ndarray, d: np.ndarray) -> float:
    """Least distance of segments a-b and c-d, pairs of rows (n, 3): inside both, or from an end of one."""
    u, v, w = b - a, d - c, a - c
    uu, uv, vv, uw, vw = (np.sum(x * y, axis=1) for x, y in ((u, u), (u, v), (v, v), (u, w), (v, w)))
    free = np.maximum(uu * vv - uv**2, 1e-300)
    fractions = [((uv * vw - vv * uw) / free, (uu * vw - uv * uw) / free)]
    fractions += [(np.full(len(a), e), np.clip((vw + e * uv) / vv, 0.0, 1.0)) for e in (0.0, 1.0)]
    fractions += [(np.clip((e * uv - uw) / uu, 0.0, 1.0), np.full(len(a), e)) for e in (0.0, 1.0)]
    least = np.inf
    for s, t in fractions:
        inside = (s >= 0.0) & (s <= 1.0) & (t >= 0.0) & (t <= 1.0)
        distance = np.linalg.norm(w + s[:, None] * u - t[:, None] * v, axis=1)
        least = min(least, float(distance[inside].min(initial=np.inf)))
    return least


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


#: places along a leg [m]: rod's lower end and centre from A1 down, cylinder's centre from B up
ROD_END, ROD_CENTRE, CYLINDER_CENTRE = 0.28, 0.16, 0.146
#: the central chain: centre of its rod below the joint, lower end of the rod below it
CENTRAL_ROD, CENTRAL_END = 0.16, 0.28


def edits(layout: Layout, *, flexible: bool = False, along: float = 0.0, aside: float = 0.0) -> dict[str, Any]:
    """All that the layout decides, by place.

    flexible: whether rod 1 is.  along: where the prismatic joints are on the rods, from the lower ends [m].
    aside: leg 1 starts turned about B1, so that its ball is so far from the centre of its socket [m], downwards as far
    as that goes.
    """
    found: dict[str, Any] = {"body.platform.pose.position": [0.0, 0.0, layout.height]}
    for k in range(4):
        found[f"body.platform.frames.A{k + 1}.position"] = layout.A[k].tolist()
        found[f"body.ground.frames.B{k + 1}.position"] = layout.B[k].tolist()
        found |= _leg(layout, k, flexible=flexible and k == 0, along=along, aside=aside if k == 0 else 0.0)
    found["body.ground.frames.Z.position"] = [0.0, 0.0, layout.height - CENTRAL_END]
    found["body.central_rod.pose.position"] = [0.0, 0.0, layout.height - CENTRAL_ROD]
    return {place: _plain(value) for place, value in found.items()}


def _leg(layout: Layout, k: int, *, flexible: bool, along: float, aside: float) -> dict[str, Any]:
    """Poses of a leg's bodies: z along it from B to A, x horizontal; of a flexible rod x along it, y horizontal."""
    way = layout.A[k] + [0.0, 0.0, layout.height] - layout.B[k]
    length = float(np.linalg.norm(way))
    if aside:
        down = np.array([0.0, 0.0, -1.0])
        across = down - way * (down @ way) / length**2
        way = way + aside * across / np.linalg.norm(across)
    axis, level = way / np.linalg.norm(way), np.array([-way[1], way[0], 0.0])
    pose = {"z": axis.tolist(), "x": level.tolist()}

    def at(distance: float) -> list[float]:
        return (layout.B[k] + distance * axis).tolist()

    n = k + 1
    rod: dict[str, Any] = {"position": at(length - ROD_CENTRE), "axes": pose}
    if flexible:
        rod = {"position": at(length - ROD_END), "axes": {"x": axis.tolist(), "y": level.tolist()}}
    return {
        f"body.cylinder{n}.pose": {"position": at(CYLINDER_CENTRE), "axes": pose},
        f"body.cylinder{n}.frames.P.position": [0.0, 0.0, length - ROD_END - CYLINDER_CENTRE + along],
        f"body.rod{n}.pose": rod,
    }


def deviation_row(effect: Deviation) -> dict[str, float]:
    """A row on how far a platform is from the ideal one: angle [rad], z [m], its rate [m/s]."""
    return {"angle": effect.angle, "displacement": effect.displacement, "velocity": effect.velocity}


def _plain(value: Any) -> Any:
    """Numbers as TOML and JSON have them."""
    if isinstance(value, dict):
        return {key: _plain(v) for key, v in value.items()}
    return [float(v) for v in value] if isinstance(value, list | tuple) else float(value)


def scene(name: str, layout: Layout, more: dict[str, Any] | None = None, *, aside: float = 0.0) -> Scene:
    """A scene of the paper's mechanism with this layout. more: other edits."""
    plain = load_scene(find_scene(name))
    return load_scene(find_scene(name), edits(layout, flexible="rod1" in plain.flexible(), aside=aside) | (more or {}))
