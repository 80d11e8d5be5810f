"""Mechanisms whose mobility is known by construction, as scenes: of any size, turned anyhow, in any order.

Geometry is that of the world at the start; `scene` gives every body a frame of its own, so that rounding differs from
one side of a joint to the other. Mobilities of units that share no loop add up.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipeline.core.algebra import rotation_vector_to_matrix
from tests.properties.mechanisms import Table

Array = np.ndarray
WORLD = "world"
#: what a clearance-revolute joint holds beside its contact
FREEDOMS = {"revolute": 1, "prismatic": 1, "cylindrical": 2, "universal": 2, "planar": 3, "spherical": 3,
            "clearance-revolute": 3, "clearance-spherical": 6}  # fmt: skip


@dataclass(frozen=True)
class Joint:
    """A joint between two bodies: its point, and the axes (columns) of its first frame.

    turn: angle about z by which the second frame starts ahead of the first.
    """

    kind: str
    a: str
    b: str
    p: Array
    R: Array
    turn: float = 0.0


@dataclass(frozen=True)
class Mechanism:
    """Bodies by name with their centres of mass, joints by name, and the known mobility."""

    name: str
    bodies: dict[str, Array]
    joints: dict[str, Joint]
    mobility: int


def axes(z: Array, x: Array | None = None) -> Array:
    """Axes with a given z, and x as near to a given direction as can be."""
    z = np.asarray(z, dtype=float) / np.linalg.norm(z)
    guess = np.eye(3)[int(np.argmin(np.abs(z)))] if x is None else np.asarray(x, dtype=float)
    x = guess - z * (z @ guess)
    x = x / np.linalg.norm(x)
    return np.column_stack([x, np.cross(z, x), z])


def any_turn(random: np.random.Generator) -> Array:
    """A rotation, all alike likely."""
    q = random.normal(size=4)
    w, x, y, z = q / np.linalg.norm(q)
    K = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + 2.0 * w * K + 2.0 * K @ K


# --- units -------------------------------------------------------------------------------------------------------

Z, X = np.array([0.0, 0.0, 1.0]), np.array([1.0, 0.0, 0.0])
#: joints on one axis (z; x lies across it) between the same two bodies, and what they leave free together
COAXIAL: tuple[tuple[str, str, int], ...] = (
    ("revolute", "revolute", 1), ("revolute", "cylindrical", 1), ("revolute", "spherical", 1),
    ("revolute", "clearance-revolute", 1), ("revolute", "clearance-spherical", 1), ("revolute", "planar", 1),
    ("cylindrical", "cylindrical", 2), ("cylindrical", "spherical", 1), ("cylindrical", "prismatic", 1),
    ("cylindrical", "clearance-revolute", 1), ("cylindrical", "clearance-spherical", 2),
    ("prismatic", "prismatic", 1), ("planar", "planar", 3), ("planar", "spherical", 1),
    ("planar", "clearance-revolute", 3), ("clearance-revolute", "clearance-revolute", 3),
    ("clearance-revolute", "spherical", 1), ("spherical", "spherical", 1), ("spherical", "clearance-spherical", 3),
)  # fmt: skip


def coaxial(random: np.random.Generator, first: str, second: str, mobility: int) -> Mechanism:
    """A door: two joints between the wall and one body, at places along a common axis."""
    places = sorted(random.uniform(-1.0, 1.0, 2))
    kinds = [first, second] if random.random() < 0.5 else [second, first]
    joints = {
        f"hinge{k}": Joint(kind, WORLD, "door", p * Z, axes(Z, _across(random)), random.uniform(-1.0, 1.0))
        for k, (kind, p) in enumerate(zip(kinds, places, strict=True))
    }
    return Mechanism(f"{first} and {second}", {"door": random.uniform(-1.0, 1.0, 3)}, _turnless(joints), mobility)


def parallel(random: np.random.Generator, kinds: Sequence[str], mobility: int) -> Mechanism:
    """Joints with parallel axes between the wall and one body, anywhere."""
    joints = {
        f"rail{k}": Joint(kind, WORLD, "table", random.uniform(-1.0, 1.0, 3), axes(Z, _across(random)))
        for k, kind in enumerate(kinds)
    }
    return Mechanism(" and ".join(kinds), {"table": random.uniform(-1.0, 1.0, 3)}, joints, mobility)


def hinges(random: np.random.Generator, count: int) -> Mechanism:
    """A door on many hinges."""
    joints = {
        f"hinge{k}": Joint("revolute", WORLD, "door", p * Z, axes(Z, _across(random)))
        for k, p in enumerate(random.uniform(-1.0, 1.0, count))
    }
    return Mechanism(f"{count} hinges", {"door": random.uniform(-1.0, 1.0, 3)}, joints, 1)


def slotted(random: np.random.Generator) -> Mechanism:
    """On a plane, and along a rail that lies in it."""
    joints = {
        "plane": Joint("planar", WORLD, "sledge", random.uniform(-1.0, 1.0, 3), axes(Z, _across(random))),
        "rail": Joint("prismatic", WORLD, "sledge", random.uniform(-1.0, 1.0, 3), axes(_across(random))),
    }
    return Mechanism("rail on a plane", {"sledge": random.uniform(-1.0, 1.0, 3)}, joints, 1)


def planar(
    random: np.random.Generator, name: str, links: int, pairs: Sequence[tuple[int, int]],
    points: Array | None = None, sliding: Sequence[int] = (), loose: Sequence[int] = (),
) -> Mechanism:  # fmt: skip
    """A planar mechanism in space: link 0 is the ground; every joint has its point in the plane and height off it.

    mobility: three freedoms a link, two taken by a joint, two given back by a clearance.
    """
    if points is None:
        points = _spread(random, len(pairs))
    joints = {}
    for k, (a, b) in enumerate(pairs):
        p = np.array([*points[k], random.uniform(-0.3, 0.3)])
        kind = "clearance-revolute" if k in loose else "prismatic" if k in sliding else "revolute"
        R = axes(_across(random)) if k in sliding else axes(Z, _across(random))
        joints[f"pin{k}"] = Joint(kind, _link(a), _link(b), p, R)
    bodies = {_link(k): np.array([*random.uniform(-1.0, 1.0, 2), 0.1]) for k in range(1, links)}
    freedoms = 3 * (links - 1) - 2 * len(pairs) + 2 * len(loose)
    return Mechanism(name, bodies, joints, freedoms)


#: links that are joined, the ground being 0
LOOPS = {
    "four-bar": (4, [(0, 1), (1, 2), (2, 3), (3, 0)]),
    "five-bar": (5, [(0, 1), (1, 2), (2, 3), (3, 4), (4, 0)]),
    "Watt": (6, [(0, 1), (1, 2), (2, 3), (3, 0), (2, 4), (4, 5), (5, 3)]),
    "Stephenson": (6, [(0, 1), (1, 2), (2, 3), (3, 0), (2, 4), (4, 5), (5, 0)]),
    "double butterfly": (8, [(0, 1), (0, 2), (0, 3), (1, 4), (2, 4), (2, 5), (3, 6), (4, 7), (5, 7), (5, 6)]),
}


def loop(random: np.random.Generator, name: str, sliding: Sequence[int] = (), loose: Sequence[int] = ()) -> Mechanism:
    """A closed planar loop, or several."""
    links, pairs = LOOPS[name]
    told = f"{name}, sliding {list(sliding)}, loose {list(loose)}"
    return planar(random, told, links, pairs, sliding=sliding, loose=loose)


def parallel_cranks(random: np.random.Generator, cranks: int) -> Mechanism:
    """A bar on several equal parallel cranks: two would do, in the plane too."""
    arm = _unit(random.uniform(0.4, 2.7)) * random.uniform(0.3, 1.0)
    feet = np.linspace(-1.0, 1.0, cranks)[:, None] * _unit(0.0) + random.uniform(-0.1, 0.1, (cranks, 2))
    pairs = [(0, 2 + k) for k in range(cranks)] + [(1, 2 + k) for k in range(cranks)]
    found = planar(random, f"{cranks} parallel cranks", cranks + 2, pairs, np.vstack([feet, feet + arm]))
    return replace(found, mobility=1)


def scissors(random: np.random.Generator, stages: int) -> Mechanism:
    """A lazy tongs: pairs of bars crossed in the middle, the first one hinged and sliding on the ground."""
    angle, half = random.uniform(0.3, 1.2), 0.5
    dx, dy = half * np.cos(angle), half * np.sin(angle)
    pairs, points, sliding = [], [], []
    for k in range(stages):
        a, b, y = 1 + 2 * k, 2 + 2 * k, 2.0 * dy * k
        if k:
            pairs += [(b - 2, a), (a - 2, b)]  # corners: the bars change sides
            points += [(-dx, y), (dx, y)]
        pairs.append((a, b))
        points.append((0.0, y + dy))
    slider = 2 * stages + 1
    pairs += [(0, 1), (slider, 2), (0, slider)]
    points += [(-dx, 0.0), (dx, 0.0), (dx, 0.0)]
    sliding.append(len(pairs) - 1)
    found = planar(random, f"{stages} scissors", slider + 1, pairs, np.array(points))
    rail = replace(found.joints[f"pin{sliding[0]}"], kind="prismatic", R=axes(X, Z))
    return replace(found, joints={**found.joints, f"pin{sliding[0]}": rail}, mobility=1)


def peaucellier(random: np.random.Generator) -> Mechanism:
    """Peaucellier and Lipkin's inversor: eight links, ten hinges."""
    long, short, turn = 1.0, random.uniform(0.45, 0.6), random.uniform(0.2, 0.6)
    base = random.uniform(0.4, 0.5)
    O, Q = np.zeros(2), np.array([base, 0.0])
    P = Q + base * _unit(2.0 * turn)  # on the circle through O
    r = float(np.linalg.norm(P))
    far = (long**2 - short**2) / r
    mid, along = 0.5 * (r + far), P / r
    up = np.sqrt(short**2 - (0.5 * (far - r)) ** 2) * np.array([-along[1], along[0]])
    A, B, D = mid * along + up, mid * along - up, far * along
    # 1, 2: long bars; 3, 4: to the crank's pin; 5, 6: to the tracing point; 7: the crank
    pairs = [(0, 1), (0, 2), (1, 3), (3, 5), (2, 4), (4, 6), (3, 4), (4, 7), (5, 6), (0, 7)]
    return planar(random, "Peaucellier", 8, pairs, np.array([O, O, A, A, B, B, P, P, D, Q]))


def spherical(random: np.random.Generator, links: int, balls: int = 0) -> Mechanism:
    """Hinges around a point; balls in it give two more freedoms each."""
    bodies = {_link(k): random.uniform(-1.0, 1.0, 3) for k in range(1, links)}
    joints = {}
    for k in range(links):
        z = any_turn(random) @ Z
        ball = k < balls
        p = np.zeros(3) if ball else z * random.uniform(0.3, 1.0)
        joints[f"pin{k}"] = Joint("spherical" if ball else "revolute", _link(k), _link((k + 1) % links), p, axes(z))
    return Mechanism(f"spherical loop of {links}, {balls} balls", bodies, joints, links - 3 + 2 * balls)


def sarrus(random: np.random.Generator, walls: int, loose: Sequence[int] = ()) -> Mechanism:
    """A platform on folding walls whose hinges point different ways; loose: walls whose middle hinge is a journal."""
    height, reach = random.uniform(0.5, 1.0), random.uniform(0.2, 0.8)
    bodies, joints = {"platform": np.array([0.0, 0.0, height])}, {}
    for k in range(walls):
        angle = np.pi * (k + random.uniform(-0.2, 0.2)) / walls + (np.pi if random.random() < 0.5 else 0.0)
        out, R = np.array([*_unit(angle), 0.0]), axes(np.array([-np.sin(angle), np.cos(angle), 0.0]))
        foot, knee = random.uniform(0.3, 0.6) * out, None
        knee, top = foot + reach * out + 0.5 * height * Z, foot + height * Z
        bodies |= {f"low{k}": 0.5 * (foot + knee), f"high{k}": 0.5 * (top + knee)}
        along = R[:, 2]
        shift = [random.uniform(-0.3, 0.3) * along for _ in range(3)]
        joints |= {
            f"foot{k}": Joint("revolute", WORLD, f"low{k}", foot + shift[0], R),
            f"knee{k}": Joint(
                "clearance-revolute" if k in loose else "revolute", f"low{k}", f"high{k}", knee + shift[1], R
            ),
            f"top{k}": Joint("revolute", f"high{k}", "platform", top + shift[2], R),
        }
    return Mechanism(f"Sarrus with {walls} walls, loose {list(loose)}", bodies, joints, 1 + 2 * len(loose))


def bennett(random: np.random.Generator) -> Mechanism:
    """Four skew hinges; sines of the twists are as the lengths (Bennett 1903)."""
    a, b = random.uniform(0.6, 1.2), random.uniform(0.2, 0.5)
    lengths, twists = (np.sin(a), np.sin(b)), (a, b)
    first = random.uniform(0.5, 2.5)
    second = 2.0 * np.arctan(np.sin(0.5 * (b + a)) / np.sin(0.5 * (b - a)) / np.tan(0.5 * first))
    H, lines = np.eye(4), []
    for k, angle in enumerate((first, second, -first, -second)):
        lines.append((H[:3, 3].copy(), H[:3, 2].copy()))
        c, s, ca, sa = np.cos(angle), np.sin(angle), np.cos(twists[k % 2]), np.sin(twists[k % 2])
        l = lengths[k % 2]
        H = H @ np.array([[c, -s * ca, s * sa, l * c], [s, c * ca, -c * sa, l * s], [0.0, sa, ca, 0.0], [0, 0, 0, 1.0]])
    assert np.allclose(H, np.eye(4), atol=1e-13)
    return _hinged(random, "Bennett", lines)


def bricard(random: np.random.Generator, symmetric: str) -> Mechanism:
    """Six hinges, three of them the half turn of the others about a line, or their mirror image (Bricard 1897)."""
    lines = [(random.uniform(-1.0, 1.0, 3), any_turn(random) @ Z) for _ in range(3)]
    if symmetric == "line":
        half = np.diag([-1.0, -1.0, 1.0])
        lines += [(half @ p, half @ z) for p, z in lines]
    else:
        flat, mirror = np.diag([1.0, 1.0, 0.0]), np.diag([1.0, 1.0, -1.0])
        first, middle = lines[0], (random.uniform(-1.0, 1.0, 3), any_turn(random) @ Z)
        one, other = ((flat @ p, flat @ z / np.linalg.norm(flat @ z)) for p, z in (first, middle))
        lines = [one, lines[1], lines[2], other, *((mirror @ p, -mirror @ z) for p, z in (lines[2], lines[1]))]
    return _hinged(random, f"Bricard with a {symmetric} of symmetry", lines)


def _hinged(random: np.random.Generator, name: str, lines: Sequence[tuple[Array, Array]]) -> Mechanism:
    """A closed chain with one hinge on each line."""
    n = len(lines)
    bodies = {_link(k): random.uniform(-1.0, 1.0, 3) for k in range(1, n)}
    joints = {
        f"hinge{k}": Joint("revolute", _link(k), _link((k + 1) % n), p + random.uniform(-0.3, 0.3) * z, axes(z))
        for k, (p, z) in enumerate(lines)
    }
    return Mechanism(name, bodies, joints, 1)


def hexapod(random: np.random.Generator, legs: int) -> Mechanism:
    """A platform on legs with universal, sliding and ball joints: each gives what it takes."""
    bodies, joints = {"platform": np.array([0.0, 0.0, 1.0])}, {}
    for k in range(legs):
        foot = np.array([*(_unit(2.0 * np.pi * k / legs) * random.uniform(0.8, 1.2)), 0.0])
        top = np.array([*(_unit(2.0 * np.pi * (k + 0.5) / legs) * random.uniform(0.4, 0.6)), 1.0])
        along = (top - foot) / np.linalg.norm(top - foot)
        bodies |= {f"low{k}": foot + 0.2 * (top - foot), f"high{k}": foot + 0.8 * (top - foot)}
        x = np.cross(along, _unit3(random))
        joints |= {
            f"foot{k}": Joint("universal", WORLD, f"low{k}", foot, _perpendicular(x, along)),
            f"slide{k}": Joint("prismatic", f"low{k}", f"high{k}", 0.5 * (foot + top), axes(along)),
            f"top{k}": Joint("spherical", f"high{k}", "platform", top, any_turn(random)),
        }
    return Mechanism(f"hexapod with {legs} legs", bodies, joints, 6)


def translating(random: np.random.Generator, legs: int) -> Mechanism:
    """Tsai's platform: universal, sliding, universal legs with parallel outer and parallel inner axes only translate.

    Each leg forbids one turn; three do, more are redundant.
    """
    bodies, joints = {"platform": np.array([0.0, 0.0, 1.0])}, {}
    for k in range(legs):
        angle = 2.0 * np.pi * (k + random.uniform(-0.1, 0.1)) / legs
        foot, top = np.array([*_unit(angle), 0.0]), np.array([*(0.5 * _unit(angle + random.uniform(0.2, 0.5))), 1.0])
        along = (top - foot) / np.linalg.norm(top - foot)
        outer = np.array([-np.sin(angle), np.cos(angle), 0.0])
        R = _perpendicular(outer, along)
        bodies |= {f"low{k}": foot + 0.2 * (top - foot), f"high{k}": foot + 0.8 * (top - foot)}
        joints |= {
            f"foot{k}": Joint("universal", WORLD, f"low{k}", foot, R),
            f"slide{k}": Joint("prismatic", f"low{k}", f"high{k}", 0.5 * (foot + top), axes(along)),
            f"top{k}": Joint("universal", "platform", f"high{k}", top, R),
        }
    return Mechanism(f"translating platform with {legs} legs", bodies, joints, 3)


def hung(random: np.random.Generator, rods: int) -> Mechanism:
    """A plate on equal parallel rods with universal joints at both ends, whose axes are parallel: it translates.

    More than three rods are redundant: a Stewart platform with superfluous legs of fixed length.
    """
    along = rotation_vector_to_matrix(random.uniform(-0.5, 0.5, 3)) @ Z
    R, length = _perpendicular(X, along), random.uniform(0.5, 1.0)
    bodies, joints = {"plate": length * along}, {}
    for k in range(rods):
        foot = np.array([*(_unit(2.0 * np.pi * k / rods) * random.uniform(0.5, 1.0)), random.uniform(-0.2, 0.2)])
        bodies[f"rod{k}"] = foot + 0.5 * length * along
        joints |= {
            f"foot{k}": Joint("universal", WORLD, f"rod{k}", foot, R),
            f"top{k}": Joint("universal", "plate", f"rod{k}", foot + length * along, R),
        }
    return Mechanism(f"plate on {rods} rods", bodies, joints, 2)


def _perpendicular(x: Array, along: Array) -> Array:
    """Axes with a given x whose y is across another direction."""
    x = x / np.linalg.norm(x)
    y = np.cross(along, x)
    y = y / np.linalg.norm(y)
    return np.column_stack([x, y, np.cross(x, y)])


def _unit(angle: float) -> Array:
    return np.array([np.cos(angle), np.sin(angle)])


def _unit3(random: np.random.Generator) -> Array:
    return any_turn(random) @ Z


def _across(random: np.random.Generator) -> Array:
    return np.array([*_unit(random.uniform(0.0, 2.0 * np.pi)), 0.0])


def _link(k: int) -> str:
    return WORLD if k == 0 else f"link{k}"


def _spread(random: np.random.Generator, count: int) -> Array:
    """Points in a plane, none near another."""
    points = [random.uniform(-1.0, 1.0, 2)]
    while len(points) < count:
        p = random.uniform(-1.0, 1.0, 2)
        if min(np.linalg.norm(p - q) for q in points) > 0.8 / np.sqrt(count):
            points.append(p)
    return np.array(points)


def _turnless(joints: dict[str, Joint]) -> dict[str, Joint]:
    """Only joints that turn about z alone may start turned."""
    turning = ("revolute", "cylindrical", "planar", "clearance-revolute")
    return {n: j if j.kind in turning else replace(j, turn=0.0) for n, j in joints.items()}


# --- many units in one --------------------------------------------------------------------------------------------


def placed(unit: Mechanism, prefix: str, base: str, size: float, R: Array, p: Array) -> Mechanism:
    """The unit under other names, of another size, turned and moved, its ground being a body `base`."""

    def name(body: str) -> str:
        return base if body == WORLD else f"{prefix}{body}"

    bodies = {name(b): p + size * R @ com for b, com in unit.bodies.items()}
    joints = {
        f"{prefix}{n}": replace(j, a=name(j.a), b=name(j.b), p=p + size * R @ j.p, R=R @ j.R)
        for n, j in unit.joints.items()
    }
    return Mechanism(unit.name, bodies, joints, unit.mobility)


def together(random: np.random.Generator, units: Sequence[Mechanism], spread: float = 1.0) -> Mechanism:
    """Units side by side or one on a body of another: their mobilities add up."""
    bodies: dict[str, Array] = {}
    joints: dict[str, Joint] = {}
    for k, unit in enumerate(units):
        base = random.choice([WORLD, *bodies])
        size = float(np.exp(random.uniform(-1.0, 1.0)))
        added = placed(unit, f"u{k}_", str(base), size, any_turn(random), spread * random.uniform(-1.0, 1.0, 3))
        bodies, joints = bodies | added.bodies, joints | added.joints
    name = " + ".join(unit.name for unit in units)
    return Mechanism(name, bodies, joints, sum(unit.mobility for unit in units))


# --- scenes -------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Setting:
    """How a mechanism is written down. size: metres of its unit; density of its bodies [kg per cubed size].

    own_frames: whether each body has a frame of its own, or that of the world.
    """

    size: float = 1.0
    R: Array | None = None
    p: tuple[float, float, float] = (0.0, 0.0, 0.0)
    density: float = 1.0
    shuffled: bool = False
    own_frames: bool = False


def scene(unit: Mechanism, random: np.random.Generator, setting: Setting, **more: object) -> Table:
    """The scene of a mechanism."""
    R = np.eye(3) if setting.R is None else setting.R
    here = placed(unit, "", WORLD, setting.size, R, setting.size * np.asarray(setting.p))
    frames: dict[str, Table] = {name: {} for name in [WORLD, *here.bodies]}
    poses = {WORLD: (np.zeros(3), np.zeros(3))}
    for name, com in here.bodies.items():
        vector = _unit3(random) * random.uniform(0.0, 3.0) if setting.own_frames else np.zeros(3)
        at = com + setting.size * random.uniform(-0.3, 0.3, 3) if setting.own_frames else np.zeros(3)
        poses[name] = (at, vector)
    joints = {}
    for name, joint in here.joints.items():
        ends = (joint.a, "a", joint.R), (joint.b, "b", joint.R @ rotation_vector_to_matrix(joint.turn * Z))
        for body, side, A in ends:
            at, vector = poses[body]
            inward = rotation_vector_to_matrix(vector).T
            frames[body][f"{name}_{side}"] = {
                "position": (inward @ (joint.p - at)).tolist(),
                "axes": {"z": (inward @ A[:, 2]).tolist(), "x": (inward @ A[:, 0]).tolist()},
            }
        joints[name] = {"type": joint.kind, "between": [f"{joint.a}.{name}_a", f"{joint.b}.{name}_b"]}
        if joint.kind.startswith("clearance"):
            joints[name] |= _clearance(joint.kind, setting.size)
    bodies: Table = {WORLD: {"type": "ground", "frames": frames[WORLD]}}
    for name, com in here.bodies.items():
        at, vector = poses[name]
        mass = setting.density * setting.size**3 * random.uniform(0.5, 2.0)
        bodies[name] = {
            "type": "rigid", "mass": mass, "com": (rotation_vector_to_matrix(vector).T @ (com - at)).tolist(),
            "inertia": (mass * setting.size**2 * np.array([0.04, 0.06, 0.07])).tolist(),
            "pose": {"position": at.tolist(), "rotation_vector": vector.tolist()}, "frames": frames[name],
        }  # fmt: skip
    if setting.shuffled:
        bodies, joints = _shuffled(random, bodies), _shuffled(random, joints)
        for joint in joints.values():
            if random.random() < 0.5 and joint["type"] != "universal" and not joint["type"].startswith("clearance"):
                joint["between"] = joint["between"][::-1]
    return {"title": unit.name, "body": bodies, "joint": joints, "time": {"end": 1.0}} | more


def _shuffled(random: np.random.Generator, parts: Table) -> Table:
    return {name: parts[name] for name in random.permutation(list(parts)).tolist()}


def _clearance(kind: str, size: float) -> Table:
    bearing = {"pin_radius": 1e-2 * size, "length": 2e-2 * size}
    ball = {"ball_radius": 1e-2 * size}
    return {
        "clearance": 1e-4 * size, "normal": {"law": "flores", "restitution": 0.8, "stiffness": 1e9},
        **(bearing if kind == "clearance-revolute" else ball),
    }  # fmt: skip


def _make(kind: str, random: np.random.Generator) -> Mechanism:
    return UNITS[kind](random)


def _loops() -> dict[str, Callable[[np.random.Generator], Mechanism]]:
    """Every planar loop as it is, with one joint sliding, and with every joint in turn loose."""
    found: dict[str, Callable[[np.random.Generator], Mechanism]] = {}
    for name, (_, pairs) in LOOPS.items():
        found[name] = lambda random, name=name: loop(random, name)
        found[f"{name}, one slides"] = lambda random, name=name, n=len(pairs): loop(random, name, [random.integers(n)])
        for k in range(len(pairs)):
            found[f"{name}, {k} loose"] = lambda random, name=name, k=k: loop(random, name, loose=[k])
        for count in (2, 3):
            found[f"{name}, {count} loose"] = lambda random, name=name, n=len(pairs), count=count: loop(
                random, name, loose=random.permutation(n)[:count].tolist()
            )
    return found


UNITS: dict[str, Callable[[np.random.Generator], Mechanism]] = {
    **{f"{a} and {b}": lambda random, a=a, b=b, m=m: coaxial(random, a, b, m) for a, b, m in COAXIAL},
    "parallel rails": lambda random: parallel(random, ["prismatic"] * 3, 1),
    "parallel planes": lambda random: parallel(random, ["planar"] * 3, 3),
    "parallel shafts": lambda random: parallel(random, ["planar", "clearance-revolute"], 3),
    "three hinges": lambda random: hinges(random, 3),
    "five hinges": lambda random: hinges(random, 5),
    "rail on a plane": slotted,
    **_loops(),
    "slider-crank, pin loose": lambda random: loop(random, "four-bar", [3], [random.integers(3)]),
    "slider-crank, two pins loose": lambda random: loop(random, "four-bar", [3], random.permutation(3)[:2].tolist()),
    "slider-crank, three pins loose": lambda random: loop(random, "four-bar", [3], [0, 1, 2]),
    "parallelogram": lambda random: parallel_cranks(random, 2),
    "three parallel cranks": lambda random: parallel_cranks(random, 3),
    "five parallel cranks": lambda random: parallel_cranks(random, 5),
    "scissors": lambda random: scissors(random, 1),
    "four scissors": lambda random: scissors(random, 4),
    "Peaucellier": peaucellier,
    "spherical four-bar": lambda random: spherical(random, 4),
    "spherical five-bar": lambda random: spherical(random, 5),
    "spherical four-bar with a ball": lambda random: spherical(random, 4, 1),
    "Sarrus": lambda random: sarrus(random, 2),
    "Sarrus with three walls": lambda random: sarrus(random, 3),
    "Sarrus with five walls": lambda random: sarrus(random, 5),
    "Sarrus, loose": lambda random: sarrus(random, 2, [random.integers(2)]),
    "Sarrus, two loose": lambda random: sarrus(random, 3, [0, 2]),
    "Bennett": bennett,
    "Bricard with a line": lambda random: bricard(random, "line"),
    "Bricard with a plane": lambda random: bricard(random, "plane"),
    "hexapod": lambda random: hexapod(random, 6),
    "hexapod with eight legs": lambda random: hexapod(random, 8),
    "translating platform": lambda random: translating(random, 3),
    "translating platform, five legs": lambda random: translating(random, 5),
    "plate on three rods": lambda random: hung(random, 3),
    "plate on six rods": lambda random: hung(random, 6),
    "plate on nine rods": lambda random: hung(random, 9),
}
