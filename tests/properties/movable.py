"""Mechanisms of known mobility as data, put together and written down as scenes of any size, turned anyhow.

Units are in `movable_planar` and `movable_spatial`, all of them by name in `movable_units`. Geometry is that of the
world at the start; `scene` may give every body a frame of its own, so that rounding differs from one side of a joint to
the other.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from flexclear.numerics.rotations import rotation_vector_to_matrix
from tests.properties.mechanisms import Table

Array = np.ndarray
Random = np.random.Generator
WORLD = "world"
X, Z = np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True)
class Joint:
    """A joint between two bodies: its point, and the axes (columns) of its first frame.

    turn: angle about z by which the second frame starts ahead of the first [rad].
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


@dataclass(frozen=True)
class Setting:
    """How a mechanism is written down. size: metres of its unit; density of its bodies: mass over size cubed [kg/m^3].

    p: where it stands, in units of its size.  shuffled: whether bodies, joints and the two sides of joints come in
    another order.  own_frames: whether each body has a frame of its own, or that of the world.
    """

    size: float = 1.0
    R: Array | None = None
    p: tuple[float, float, float] = (0.0, 0.0, 0.0)
    density: float = 1.0
    shuffled: bool = False
    own_frames: bool = False


def link(k: int) -> str:
    """Name of a numbered link, 0 being the ground."""
    return WORLD if k == 0 else f"link{k}"


def axes(z: Array, x: Array | None = None) -> Array:
    """Axes with a given z, and x as near to a given direction as can be."""
    z = np.asarray(z, dtype=float) / np.linalg.norm(z)
    guess = np.eye(3)[int(np.argmin(np.abs(z)))] if x is None else np.asarray(x, dtype=float)
    x = guess - z * (z @ guess)
    x = x / np.linalg.norm(x)
    return np.column_stack([x, np.cross(z, x), z])


def any_turn(random: Random) -> Array:
    """A rotation, all alike likely."""
    q = random.normal(size=4)
    w, x, y, z = q / np.linalg.norm(q)
    K = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + 2.0 * w * K + 2.0 * K @ K


def any_setting(random: Random) -> Setting:
    """Nanometres to kilometres, anywhere within a thousand sizes, of foam or of lead."""
    far = 10.0 ** random.uniform(-1.0, 3.0) * random.normal(size=3)
    return Setting(
        10.0 ** random.uniform(-9.0, 3.0), any_turn(random), tuple(far), 10.0 ** random.uniform(1.0, 4.0), True,
        bool(random.integers(2)),
    )  # fmt: skip


def unit(angle: float) -> Array:
    """Direction in the plane."""
    return np.array([np.cos(angle), np.sin(angle)])


def across(random: Random) -> Array:
    """A direction normal to z."""
    return np.array([*unit(random.uniform(0.0, 2.0 * np.pi)), 0.0])


def placed(made: Mechanism, prefix: str, base: str, size: float, R: Array, p: Array) -> Mechanism:
    """The mechanism under other names, of another size, turned and moved, its ground being a body `base`."""

    def name(body: str) -> str:
        return base if body == WORLD else f"{prefix}{body}"

    bodies = {name(b): p + size * R @ com for b, com in made.bodies.items()}
    joints = {
        f"{prefix}{n}": replace(j, a=name(j.a), b=name(j.b), p=p + size * R @ j.p, R=R @ j.R)
        for n, j in made.joints.items()
    }
    return Mechanism(made.name, bodies, joints, made.mobility)


def together(random: Random, parts: Sequence[Mechanism], decades: float = 0.5) -> Mechanism:
    """Mechanisms side by side or one on a body of another: they share no loop, so that their mobilities add up.

    decades: by how many powers of ten their sizes may differ.
    """
    bodies: dict[str, Array] = {}
    joints: dict[str, Joint] = {}
    for k, part in enumerate(parts):
        base = str(random.choice([WORLD, *bodies]))
        size, p = 10.0 ** random.uniform(-decades, 0.0), random.uniform(-1.0, 1.0, 3)
        added = placed(part, f"u{k}_", base, size, any_turn(random), p)
        bodies, joints = bodies | added.bodies, joints | added.joints
    return Mechanism(" + ".join(p.name for p in parts), bodies, joints, sum(p.mobility for p in parts))


def scene(made: Mechanism, random: Random, setting: Setting, **more: object) -> Table:
    """The scene of a mechanism; more: further tables of it."""
    R = np.eye(3) if setting.R is None else setting.R
    here = placed(made, "", WORLD, setting.size, R, setting.size * np.asarray(setting.p))
    poses = {WORLD: (np.zeros(3), np.zeros(3))}
    for name, com in here.bodies.items():
        own = (com + setting.size * random.uniform(-0.3, 0.3, 3), any_turn(random)[0] * random.uniform(0.0, 3.0))
        poses[name] = own if setting.own_frames else poses[WORLD]
    bodies: Table = {WORLD: {"type": "ground", "frames": {}}}
    for name, com in here.bodies.items():
        mass = setting.density * setting.size**3 * random.uniform(0.5, 2.0)
        at, vector = poses[name]
        inward = rotation_vector_to_matrix(vector).T
        moments = mass * setting.size**2 * inward @ R @ np.diag([0.04, 0.06, 0.07]) @ (inward @ R).T
        bodies[name] = {
            "type": "rigid", "mass": mass, "com": (inward @ (com - at)).tolist(),
            "inertia": (0.5 * (moments + moments.T)).tolist(),
            "pose": {"position": at.tolist(), "rotation_vector": vector.tolist()}, "frames": {},
        }  # fmt: skip
    joints = {}
    for name, joint in here.joints.items():
        ends = (
            (joint.a, f"{name}_a", joint.R),
            (joint.b, f"{name}_b", joint.R @ rotation_vector_to_matrix(joint.turn * Z)),
        )
        for body, frame, A in ends:
            at, vector = poses[body]
            inward = rotation_vector_to_matrix(vector).T
            turned = {"z": (inward @ A[:, 2]).tolist(), "x": (inward @ A[:, 0]).tolist()}
            bodies[body]["frames"][frame] = {"position": (inward @ (joint.p - at)).tolist(), "axes": turned}
        between = [f"{joint.a}.{name}_a", f"{joint.b}.{name}_b"]
        joints[name] = {"type": joint.kind, "between": between, **_clearance(joint.kind, setting)}
    if setting.shuffled:
        bodies, joints = _shuffled(random, bodies), _shuffled(random, joints)
        for joint in joints.values():
            if random.random() < 0.5 and joint["type"] != "universal" and "clearance" not in joint["type"]:
                joint["between"] = joint["between"][::-1]
    return {"title": made.name, "body": bodies, "joint": joints, "time": {"end": 1.0}, **more}


def _shuffled(random: Random, parts: Table) -> Table:
    return {name: parts[name] for name in random.permutation(list(parts)).tolist()}


def _clearance(kind: str, setting: Setting) -> Table:
    """A clearance of 1e-4 of the size; the weight of a body presses the surfaces a tenth of it into each other."""
    sizes = {
        "clearance-revolute": {"pin_radius": 1e-2 * setting.size, "length": 2e-2 * setting.size},
        "clearance-spherical": {"ball_radius": 1e-2 * setting.size},
    }
    if kind not in sizes:
        return {}
    stiffness = 9.81 * setting.density * setting.size**3 / (1e-5 * setting.size) ** 1.5
    law = {"law": "flores", "restitution": 0.8, "stiffness": stiffness}
    return {"clearance": 1e-4 * setting.size, "normal": law, **sizes[kind]}
