"""Layouts of the 4-SPS/PS mechanism with two vertical planes of symmetry: kinematics, and layouts that fit Table 8.

Joints are at A = (+-ax, +-ay, 0) of the platform and B = (+-bx, +-by, 0) of the base. Legs 1 and 2 at +x are driven
together, legs 3 and 4 are held, so that the platform rises and turns about y alone.

At the start the platform is level. A change of leg 1 alone then lifts and turns the platform as half of that change in
legs 1 and 2 does (the other half twists it about x and z). Legs 3 and 4 are held, so that the lines A3, A4 do not move
and dz = ax dangle. With n the direction of the legs, 2 n_z dz = 1/2. Both sensitivities are largest at the start; so

    ax = dz / dangle,    height / leg length = n_z = 1 / (4 dz),

and the other three numbers of a layout, ay, bx, by, are free. Table 8 prints the clearance times dz and dangle.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from itertools import combinations, product
from typing import Any

import numpy as np

from flexclear.scene.load import load_scene
from flexclear.scene.schema import Scene
from flexclear.stages.scenes import find_scene
from papers.wang_wang_2019.deviations import Deviation
from papers.wang_wang_2019.published import TABLE3, TABLE8

#: length that scales rotations in all condition numbers here [m]
SCALE = 0.1
#: stroke of legs 1 and 2, eq. (35) [m], and number of positions on it
STROKE, PLACES = 0.06, 25
#: limits of Newton's method for the height: iterations, and last change [m]
ITERATIONS, CONVERGED = 30, 1e-14
#: signs of x and y of the joints of legs 1 to 4
SIGNS = np.array([[1.0, 1.0], [1.0, -1.0], [-1.0, 1.0], [-1.0, -1.0]])


@dataclass(frozen=True)
class Layout:
    """Positions of the joints and start height of the platform's joints [m]."""

    ax: float
    ay: float
    bx: float
    by: float
    height: float

    @property
    def A(self) -> np.ndarray:
        """Joints of the platform in its frame, shape (4, 3) [m]."""
        return np.column_stack([SIGNS * [self.ax, self.ay], np.zeros(4)])

    @property
    def B(self) -> np.ndarray:
        """Joints of the base, shape (4, 3) [m]."""
        return np.column_stack([SIGNS * [self.bx, self.by], np.zeros(4)])

    @property
    def leg(self) -> float:
        """Length of a leg between its ball centres at the start [m]."""
        return float(np.linalg.norm(self.A[0] + [0.0, 0.0, self.height] - self.B[0]))


@dataclass(frozen=True)
class Answer:
    """Response of a layout over the stroke.

    dz, dangle: largest change of height [m/m] and of the angle about y [rad/m] per change of leg 1's length.
    lift [m], tilt [rad]: over the whole stroke.  condition: largest condition number.  room: least distance between the
    axes of two legs, or of a leg and the central chain [m].
    """

    dz: float
    dangle: float
    lift: float
    tilt: float
    condition: float
    room: float


def poses(layout: Layout, extensions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return heights [m] and angles about y [rad] of the platform for extensions of legs 1 and 2 [m]; both (n,).

    Newton's method yields the height; ValueError where the legs do not reach.
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
    """Return the platform's joints relative to its centre in world axes, shape (n, 4, 3)."""
    x, y = layout.A[:, 0], layout.A[:, 1]
    c, s = np.cos(angles)[:, None], np.sin(angles)[:, None]
    return np.stack([x * c, np.broadcast_to(y, (len(angles), 4)), -x * s], axis=2)


def jacobians(layout: Layout, heights: np.ndarray, angles: np.ndarray) -> np.ndarray:
    """Return the rates of the legs' lengths per rate of the height and of the rotation vector, shape (n, 4, 4)."""
    r = turned(layout, angles)
    d = r + np.array([0.0, 0.0, 1.0]) * heights[:, None, None] - layout.B
    n = d / np.linalg.norm(d, axis=2, keepdims=True)
    return np.concatenate([n[:, :, 2:], np.cross(r, n)], axis=2)


@cache
def answer(layout: Layout) -> Answer:
    """Return the response of a layout; raise ValueError where the legs do not reach over the stroke."""
    heights, angles = poses(layout, np.linspace(0.0, STROKE, PLACES))
    J = jacobians(layout, heights, angles)
    moves = np.abs(np.linalg.inv(J)[:, :, 0]).max(axis=0)
    condition = np.linalg.cond(J @ np.diag([1.0, 1.0 / SCALE, 1.0 / SCALE, 1.0 / SCALE])).max()
    # in a pose turned about y alone the angle asin R[0, 2] changes at the rate of the rotation about y
    motion = float(moves[0]), float(moves[2]), float(np.ptp(heights)), float(np.abs(angles).max())
    return Answer(*motion, float(condition), _clear_distance(layout, heights, angles))


def _clear_distance(layout: Layout, heights: np.ndarray, angles: np.ndarray) -> float:
    """Return the least distance between the axes of two legs, or of a leg and the central chain [m]."""
    up = np.array([0.0, 0.0, 1.0])
    tops = turned(layout, angles) + up * heights[:, None, None]
    below, above = np.broadcast_to(-up, (len(heights), 3)), up * heights[:, None]
    feet = np.broadcast_to(layout.B, tops.shape)
    bars = [(feet[:, k], tops[:, k]) for k in range(4)] + [(below, above)]
    return min(_distance(*one, *other) for one, other in combinations(bars, 2))


def _distance(a: np.ndarray, b: np.ndarray, c: np.ndarray, d: np.ndarray) -> float:
    """Return the least distance of segments a-b and c-d, pairs of rows (n, 3): inside both, or from an end of one."""
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
#: sensitivities of Table 8 [m/m, rad/m]
DZ, DANGLE = 1e-3 * TABLE8.displacement / CLEARANCE, TABLE8.angle / CLEARANCE
#: step and ranges of the grid on which layouts are searched [m]
STEP = 0.01
GRID = {"ay": (0.02, 0.08), "bx": (0.02, 0.36), "by": (0.02, 0.40)}
#: limits [m]: leg lengths between ball centres, so that rods stay in their cylinders; the platform's joints lie within
#: the circle through the corners of its 200 mm plate; distances of two cylinders (radius 20 mm) and sockets (25 mm)
SHORTEST, LONGEST, REACH, CYLINDERS, SOCKETS = 0.32, 0.46, 0.1 * np.sqrt(2.0), 0.04, 0.05
WORST_CONDITION = 10.0
#: the layout that was assumed before: joints of the platform on a circle of 100 mm, those of the base on one of 200 mm
FIRST = Layout(0.086603, 0.05, 0.1, 0.173205, 0.35)
#: relative tolerance of the sensitivities: half a unit of the third of four printed digits, so that layouts whose
#: largest value lies near the start count as well
AGREES = 1e-3


def fitted(ay: float, bx: float, by: float) -> Layout:
    """Return the layout with Table 8's sensitivities at the start and these three free numbers [m]."""
    ax, upright = DZ / DANGLE, 1.0 / (4.0 * DZ)
    across = float(np.hypot(ax - bx, ay - by))
    return Layout(ax, ay, bx, by, across * upright / np.sqrt(1.0 - upright**2))


def admissible(layout: Layout) -> bool:
    """Return True when legs and sockets of a layout can be built; its motion is not checked."""
    return bool(
        layout.leg >= SHORTEST
        and layout.leg + STROKE <= LONGEST
        and np.hypot(layout.ax, layout.ay) <= REACH
        and 2.0 * min(layout.ay, layout.bx, layout.by) >= SOCKETS
    )


def family(step: float = STEP) -> list[Layout]:
    """Return the admissible layouts on the grid with Table 8's sensitivities over the stroke and room for the legs."""
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
            found.append(layout)
    return found


def by_condition(members: list[Layout]) -> list[Layout]:
    """Return the members by rising condition number over the stroke."""
    return sorted(members, key=lambda layout: answer(layout).condition)


def chosen(members: list[Layout]) -> Layout:
    """Return the member with the least condition number over the stroke, which is farthest from a singular layout."""
    return by_condition(members)[0]


def on_the_plate(layout: Layout) -> bool:
    """Return True when the platform's joint centres lie over its square plate in some orientation of the plate."""
    half = REACH / np.sqrt(2.0)
    return bool(max(layout.ax, layout.ay) <= half or layout.ax + layout.ay <= REACH)


#: distances along a leg [m]: lower end and centre of the rod from A down, centre of the cylinder from B up
ROD_END, ROD_CENTRE, CYLINDER_CENTRE = 0.28, 0.16, 0.146
#: central chain: distances of its rod's centre and lower end below the joint [m]
CENTRAL_ROD, CENTRAL_END = 0.16, 0.28


def edits(layout: Layout, *, flexible: bool = False, along: float = 0.0, aside: float = 0.0) -> dict[str, Any]:
    """Return every scene value that the layout determines, by key path.

    flexible: True when rod 1 is flexible.  along: distance of the prismatic joints from the rods' lower ends [m].
    aside: initial distance of leg 1's ball from the centre of its socket [m]; the leg is turned about B1, as far
    downwards as possible.
    """
    found: dict[str, Any] = {"body.platform.pose.position": [0.0, 0.0, layout.height]}
    for k in range(4):
        found[f"body.platform.frames.A{k + 1}.position"] = layout.A[k].tolist()
        found[f"body.ground.frames.B{k + 1}.position"] = layout.B[k].tolist()
        found |= _leg(layout, k, flexible=flexible and k == 0, along=along, aside=aside if k == 0 else 0.0)
    found["body.ground.frames.Z.position"] = [0.0, 0.0, layout.height - CENTRAL_END]
    found["body.central_rod.pose.position"] = [0.0, 0.0, layout.height - CENTRAL_ROD]
    return {place: _floats(value) for place, value in found.items()}


def _leg(layout: Layout, k: int, *, flexible: bool, along: float, aside: float) -> dict[str, Any]:
    """Return the poses of a leg's bodies: z from B to A, x horizontal; flexible rod: x from B to A, y horizontal."""
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
    """Return a platform's deviation from the ideal one as a record: angle [rad], z [m], velocity [m/s]."""
    return {"angle": effect.angle, "displacement": effect.displacement, "velocity": effect.velocity}


def _floats(value: Any) -> Any:
    """Return numbers as plain floats, which TOML and JSON can hold."""
    if isinstance(value, dict):
        return {key: _floats(v) for key, v in value.items()}
    return [float(v) for v in value] if isinstance(value, list | tuple) else float(value)


def scene(name: str, layout: Layout, more: dict[str, Any] | None = None, *, aside: float = 0.0) -> Scene:
    """Return a scene of the paper's mechanism with this layout and further edits."""
    plain = load_scene(find_scene(name))
    return load_scene(find_scene(name), edits(layout, flexible="rod1" in plain.flexible(), aside=aside) | (more or {}))
