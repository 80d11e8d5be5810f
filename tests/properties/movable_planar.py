"""Planar mechanisms in space of known mobility: closed loops, parallel cranks, lazy tongs, Peaucellier's inversor."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from tests.properties.movable import Array, Joint, Mechanism, Random, X, Z, across, axes, link, unit

#: number of links, and which of them are joined, the ground being 0
LOOPS: dict[str, tuple[int, list[tuple[int, int]]]] = {
    "four-bar": (4, [(0, 1), (1, 2), (2, 3), (3, 0)]),
    "five-bar": (5, [(0, 1), (1, 2), (2, 3), (3, 4), (4, 0)]),
    "Watt's six-bar": (6, [(0, 1), (1, 2), (2, 3), (3, 0), (2, 4), (4, 5), (5, 3)]),
    "Stephenson's six-bar": (6, [(0, 1), (1, 2), (2, 3), (3, 0), (2, 4), (4, 5), (5, 0)]),
    "eight-bar": (8, [(0, 1), (0, 2), (0, 3), (1, 4), (2, 4), (2, 5), (3, 6), (4, 7), (5, 7), (5, 6)]),
}


def planar(
    random: Random,
    name: str,
    links: int,
    pairs: Sequence[tuple[int, int]],
    points: Array,
    sliding: Sequence[int] = (),
    loose: Sequence[int] = (),
) -> Mechanism:
    """A mechanism in the plane z = 0, its joints at `points` of it, somewhat above or below.

    Three freedoms a link, of which a joint takes two; a clearance gives them back.  sliding, loose: numbers of joints
    that are prismatic, or have clearance.
    """
    joints = {}
    for k, (a, b) in enumerate(pairs):
        p = np.array([*points[k], random.uniform(-0.3, 0.3)])
        kind = "clearance-revolute" if k in loose else "prismatic" if k in sliding else "revolute"
        R = axes(across(random)) if k in sliding else axes(Z, across(random))
        joints[f"pin{k}"] = Joint(kind, link(a), link(b), p, R)
    bodies = {link(k): np.array([*random.uniform(-1.0, 1.0, 2), 0.1]) for k in range(1, links)}
    return Mechanism(name, bodies, joints, 3 * (links - 1) - 2 * len(pairs) + 2 * len(loose))


def loop(random: Random, name: str, sliding: Sequence[int] = (), loose: Sequence[int] = ()) -> Mechanism:
    """One of `LOOPS`, its joints anywhere."""
    links, pairs = LOOPS[name]
    points: list[Array] = []
    while len(points) < len(pairs):
        p = random.uniform(-1.0, 1.0, 2)
        if all(np.linalg.norm(p - q) > 0.8 / np.sqrt(len(pairs)) for q in points):
            points.append(p)
    reported = f"{name}, sliding {list(sliding)}, loose {list(loose)}"
    return planar(random, reported, links, pairs, np.array(points), sliding, loose)


def parallel_cranks(random: Random, cranks: int, angle: float | None = None) -> Mechanism:
    """A bar on several equal parallel cranks: two would do, in the plane too. At the angle 0 they are singular."""
    angle = random.uniform(0.4, 2.7) if angle is None else angle
    arm = unit(angle) * random.uniform(0.3, 1.0)
    feet = np.linspace(-1.0, 1.0, cranks)[:, None] * unit(0.0)
    pairs = [(0, 2 + k) for k in range(cranks)] + [(1, 2 + k) for k in range(cranks)]
    found = planar(random, f"{cranks} parallel cranks", cranks + 2, pairs, np.vstack([feet, feet + arm]))
    return replace(found, mobility=1)


def scissors(random: Random, stages: int) -> Mechanism:
    """Lazy tongs: pairs of bars crossed in the middle, the first one hinged to the ground and sliding on it."""
    angle = random.uniform(0.3, 1.2)
    dx, dy = 0.5 * unit(angle)
    pairs: list[tuple[int, int]] = []
    points: list[tuple[float, float]] = []
    for k in range(stages):
        one, other, y = 1 + 2 * k, 2 + 2 * k, 2.0 * dy * k
        if k:  # at the corners the bars change sides
            pairs += [(other - 2, one), (one - 2, other)]
            points += [(-dx, y), (dx, y)]
        pairs.append((one, other))
        points.append((0.0, y + dy))
    slider = 2 * stages + 1
    pairs += [(0, 1), (slider, 2), (0, slider)]
    points += [(-dx, 0.0), (dx, 0.0), (dx, 0.0)]
    found = planar(random, f"{stages} scissors", slider + 1, pairs, np.array(points))
    last = f"pin{len(pairs) - 1}"
    rail = replace(found.joints[last], kind="prismatic", R=axes(X, Z))
    return replace(found, joints={**found.joints, last: rail})


def peaucellier(random: Random) -> Mechanism:
    """The inversor of Peaucellier and Lipkin: pin8 moves on the line on which its x stays.

    Links 1 and 2: the long bars; 3 and 4: from them to the crank 7; 5 and 6: from them to the tracing point.
    """
    short, base, angle = random.uniform(0.45, 0.6), random.uniform(0.4, 0.5), random.uniform(0.2, 0.6)
    O, Q = np.zeros(2), np.array([base, 0.0])
    P = Q + base * unit(2.0 * angle)  # on the circle about Q through O
    near = float(np.linalg.norm(P))
    far, along = (1.0 - short**2) / near, P / near
    middle = 0.5 * (near + far) * along
    up = np.sqrt(short**2 - (0.5 * (far - near)) ** 2) * np.array([-along[1], along[0]])
    A, B, D = middle + up, middle - up, far * along
    pairs = [(0, 1), (0, 2), (1, 3), (3, 5), (2, 4), (4, 6), (3, 4), (4, 7), (5, 6), (0, 7)]
    return planar(random, "Peaucellier", 8, pairs, np.array([O, O, A, A, B, B, P, P, D, Q]))
