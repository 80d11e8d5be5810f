"""Mechanisms with change points, as scenes in tables of SI numbers, and their motion on the smooth branch.

Each has a closed form: of the four-bar the loop equation, whose elbow changes its side at every pass of the pose in
which all bars lie in one line; of the in-line slider-crank (Scott-Russell's) x = 2 r cos(crank).
"""

import numpy as np
from scipy.integrate import solve_ivp

from tests.properties.mechanisms import Table

#: a + d = b + c, to the bit in sums of these
FOUR_BAR = (0.2, 0.4, 0.3, 0.5)
GRAVITY = 9.81
#: masses and lengths of Scott-Russell's mechanism [kg], [m]
CRANK, ROD, SLIDER, RADIUS = 0.5, 0.8, 0.3, 0.2


def steady(angle: float, rate: float) -> Table:
    """A law that turns at a steady rate from an angle on."""
    return {"type": "polynomial", "coefficients": [angle, rate]}


def bar(mass: float, length: float, place: np.ndarray, angle: float) -> Table:
    """A thin bar with pins p and q at its ends, in the plane."""
    across = mass * length**2 / 12.0
    return {
        "type": "rigid", "mass": mass, "com": [0.5 * length, 0.0, 0.0], "inertia": [1e-3 * across, across, across],
        "pose": {"position": [*map(float, place), 0.0], "rotation_vector": [0.0, 0.0, float(angle)]},
        "frames": {"p": {}, "q": {"position": [length, 0.0, 0.0]}},
    }  # fmt: skip


def pin(first: str, second: str) -> Table:
    return {"type": "revolute", "between": [first, second]}


def elbow(angle: float, side: float, lengths: tuple[float, ...]) -> tuple[float, float]:
    """Angles of coupler and rocker for a crank angle; side: +1 or -1, of the elbow."""
    a, b, c, d = lengths
    B = a * np.array([np.cos(angle), np.sin(angle)])
    across = np.array([d, 0.0]) - B
    r = float(np.hypot(*across))
    cosine = np.clip((b * b + r * r - c * c) / (2.0 * b * r), -1.0, 1.0)
    coupler = float(np.arctan2(across[1], across[0]) + side * np.arccos(cosine))
    C = B + b * np.array([np.cos(coupler), np.sin(coupler)])
    return coupler, float(np.arctan2(C[1], C[0] - d))


def four_bar(angle: float, side: float = 1.0, lengths: tuple[float, ...] = FOUR_BAR, **more: object) -> Table:
    """A four-bar with its crank at an angle; lengths: crank, coupler, rocker, ground."""
    a, b, c, d = lengths
    coupler, rocker = elbow(angle, side, lengths)
    A, D = np.zeros(2), np.array([d, 0.0])
    B = a * np.array([np.cos(angle), np.sin(angle)])
    return {
        "title": "four-bar with a change point",
        "body": {
            "ground": {"type": "ground", "frames": {"A": {}, "D": {"position": [d, 0.0, 0.0]}}},
            "crank": bar(0.5, a, A, angle), "coupler": bar(0.5, b, B, coupler), "rocker": bar(0.5, c, D, rocker),
        },
        "joint": {
            "A": pin("ground.A", "crank.p"), "B": pin("crank.q", "coupler.p"),
            "C": pin("coupler.q", "rocker.q"), "D": pin("ground.D", "rocker.p"),
        },
        "load": {"gravity": {"type": "gravity", "acceleration": [0.0, -GRAVITY, 0.0]}},
        "time": {"end": 1.0}, "output": {"interval": 0.02}, **more,
    }  # fmt: skip


def driven(table: Table, joint: str, law: Table) -> Table:
    """The same, one joint driven."""
    return {**table, "drive": {"motor": {"joint": joint, "law": law}}}


def passes(angle: float) -> float:
    """Poses in one line that a crank at this angle has passed since 0, at pi, 3 pi, ..."""
    return float(np.floor((angle - np.pi) / (2.0 * np.pi)))


def smooth(angles: np.ndarray, side: float, lengths: tuple[float, ...] = FOUR_BAR) -> np.ndarray:
    """Angles of coupler and rocker, (n, 2), continued smoothly from the first crank angle on; side: of its elbow.

    The elbow's side changes in the pose in one line, where the loop equation's two solutions cross.
    """
    before = passes(float(angles[0]))
    return np.array([elbow(x, side * (-1.0) ** (passes(float(x)) - before), lengths) for x in angles])


def scott_russell(angle: float, radius: float = RADIUS, **more: object) -> Table:
    """Crank and rod of one length: with the crank upright the rod lies on it, and may turn with it."""
    pinned = radius * np.array([np.cos(angle), np.sin(angle)])
    along = {"axes": {"z": [1.0, 0.0, 0.0], "x": [0.0, 0.0, 1.0]}}
    swing = SLIDER * radius**2
    return {
        "title": "Scott-Russell",
        "body": {
            "ground": {"type": "ground", "frames": {"O": {}, "guide": along}},
            "crank": bar(CRANK, radius, np.zeros(2), angle), "rod": bar(ROD, radius, pinned, -angle),
            "slider": {
                "type": "rigid", "mass": SLIDER, "inertia": [swing, swing, swing],
                "pose": {"position": [2.0 * radius * float(np.cos(angle)), 0.0, 0.0]},
                "frames": {"pin": {}, "guide": along},
            },
        },
        "joint": {
            "O": pin("ground.O", "crank.p"), "C": pin("crank.q", "rod.p"), "A": pin("rod.q", "slider.pin"),
            "guide": {"type": "prismatic", "between": ["ground.guide", "slider.guide"]},
        },
        "load": {"gravity": {"type": "gravity", "acceleration": [0.0, -GRAVITY, 0.0]}},
        "time": {"end": 1.0}, "output": {"interval": 0.02}, **more,
    }  # fmt: skip


def falling(angle: float, rate: float, times: np.ndarray) -> np.ndarray:
    """Crank angle of a free Scott-Russell mechanism on the branch x = 2 r cos(angle), from its one equation of motion.

    Reduced mass I(angle) = crank and rod about their ends and centres, slider with x' = -2 r sin(angle) angle'.
    """
    r = RADIUS
    crank, rod = CRANK * r**2 / 3.0, ROD * r**2 / 12.0

    def rhs(_: float, y: np.ndarray) -> list[float]:
        s, c = np.sin(y[0]), np.cos(y[0])
        # the rod's centre is at (1.5 r cos, 0.5 r sin)
        inertia = crank + rod + ROD * (2.25 * s * s + 0.25 * c * c) * r**2 + SLIDER * (2.0 * r * s) ** 2
        change = 2.0 * s * c * (2.0 * ROD * r**2 + 4.0 * SLIDER * r**2)
        weight = GRAVITY * (0.5 * CRANK + 0.5 * ROD) * r * c
        return [y[1], (-weight - 0.5 * change * y[1] ** 2) / inertia]

    known = solve_ivp(rhs, (0.0, times[-1]), [angle, rate], "DOP853", t_eval=times, rtol=1e-13, atol=1e-13)
    return np.asarray(known.y[0])
