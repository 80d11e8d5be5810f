"""Spatial mechanisms whose mobility is known: doors, Sarrus', Bennett's and Bricard's linkages, parallel platforms."""

from collections.abc import Sequence

import numpy as np

from flexclear.numerics.rotations import rotation_vector_to_matrix
from tests.properties.movable import WORLD, Array, Joint, Mechanism, Random, X, Z, across, any_turn, axes, link, unit

#: joints on one axis between the same two bodies (z; that of slides too), and what they leave free together
COAXIAL: tuple[tuple[str, str, int], ...] = (
    ("revolute", "revolute", 1), ("revolute", "cylindrical", 1), ("revolute", "spherical", 1),
    ("revolute", "clearance-revolute", 1), ("revolute", "clearance-spherical", 1), ("revolute", "planar", 1),
    ("cylindrical", "cylindrical", 2), ("cylindrical", "spherical", 1), ("cylindrical", "prismatic", 1),
    ("cylindrical", "clearance-revolute", 1), ("cylindrical", "clearance-spherical", 2),
    ("prismatic", "prismatic", 1), ("planar", "planar", 3), ("planar", "spherical", 1),
    ("planar", "clearance-revolute", 3), ("clearance-revolute", "clearance-revolute", 3),
    ("clearance-revolute", "spherical", 1), ("spherical", "spherical", 1), ("spherical", "clearance-spherical", 3),
)  # fmt: skip
#: joints that turn about z alone
TURNING = ("revolute", "cylindrical", "planar", "clearance-revolute")


def coaxial(random: Random, kinds: Sequence[str], mobility: int) -> Mechanism:
    """A door: joints between the wall and one body, at places along a common axis."""
    joints = {}
    for k, kind in enumerate(random.permutation(list(kinds)).tolist()):
        p, turn = random.uniform(-1.0, 1.0) + k, random.uniform(-1.0, 1.0) if kind in TURNING else 0.0
        joints[f"hinge{k}"] = Joint(kind, WORLD, "door", p * Z, axes(Z, across(random)), turn)
    return Mechanism(" and ".join(kinds), {"door": random.uniform(-1.0, 1.0, 3)}, joints, mobility)


def parallel(random: Random, kinds: Sequence[str], mobility: int) -> Mechanism:
    """Joints with parallel axes between the ground and one body, anywhere."""
    joints = {
        f"rail{k}": Joint(kind, WORLD, "table", random.uniform(-1.0, 1.0, 3), axes(Z, across(random)))
        for k, kind in enumerate(kinds)
    }
    return Mechanism("parallel " + " and ".join(kinds), {"table": random.uniform(-1.0, 1.0, 3)}, joints, mobility)


def slotted(random: Random) -> Mechanism:
    """On a plane, and along a rail that lies in it."""
    joints = {
        "plane": Joint("planar", WORLD, "sledge", random.uniform(-1.0, 1.0, 3), axes(Z, across(random))),
        "rail": Joint("prismatic", WORLD, "sledge", random.uniform(-1.0, 1.0, 3), axes(across(random))),
    }
    return Mechanism("rail on a plane", {"sledge": random.uniform(-1.0, 1.0, 3)}, joints, 1)


def spherical(random: Random, links: int, balls: int = 0) -> Mechanism:
    """Hinges whose axes meet in a point; a ball there gives two more freedoms."""
    joints = {}
    for k in range(links):
        z = any_turn(random) @ Z
        kind, p = ("spherical", np.zeros(3)) if k < balls else ("revolute", z * random.uniform(0.3, 1.0))
        joints[f"pin{k}"] = Joint(kind, link(k), link((k + 1) % links), p, axes(z))
    bodies = {link(k): random.uniform(-1.0, 1.0, 3) for k in range(1, links)}
    return Mechanism(f"spherical loop of {links}, {balls} balls", bodies, joints, links - 3 + 2 * balls)


def sarrus(random: Random, walls: int, loose: Sequence[int] = ()) -> Mechanism:
    """A platform on folding walls whose hinges point different ways; loose: walls with clearance in the middle."""
    height, reach = random.uniform(0.5, 1.0), random.uniform(0.2, 0.8)
    bodies, joints = {"platform": np.array([0.0, 0.0, height])}, {}
    for k in range(walls):
        angle = np.pi * (k + random.uniform(-0.2, 0.2)) / walls + (np.pi if random.random() < 0.5 else 0.0)
        out, along = np.array([*unit(angle), 0.0]), np.array([-np.sin(angle), np.cos(angle), 0.0])
        foot = random.uniform(0.3, 0.6) * out
        knee, top = foot + reach * out + 0.5 * height * Z, foot + height * Z
        bodies |= {f"low{k}": 0.5 * (foot + knee), f"high{k}": 0.5 * (top + knee)}
        kinds = "revolute", "clearance-revolute" if k in loose else "revolute", "revolute"
        chain = [WORLD, f"low{k}", f"high{k}", "platform"]
        for n, (kind, p) in enumerate(zip(kinds, (foot, knee, top), strict=True)):
            aside = p + random.uniform(-0.3, 0.3) * along
            joints[f"wall{k}_{n}"] = Joint(kind, chain[n], chain[n + 1], aside, axes(along))
    return Mechanism(f"Sarrus on {walls} walls, loose {list(loose)}", bodies, joints, 1 + 2 * len(loose))


def bennett(random: Random) -> Mechanism:
    """Four skew hinges; the sines of the twists are as the lengths (Bennett 1903)."""
    a, b, first = random.uniform(0.6, 1.2), random.uniform(0.2, 0.5), random.uniform(0.5, 2.5)
    second = 2.0 * np.arctan(np.sin(0.5 * (b + a)) / np.sin(0.5 * (b - a)) / np.tan(0.5 * first))
    H, lines = np.eye(4), []
    for angle, twist in zip((first, second, -first, -second), (a, b, a, b), strict=True):
        lines.append((H[:3, 3].copy(), H[:3, 2].copy()))
        (c, s), (ct, st), l = unit(angle), unit(twist), np.sin(twist)
        H = H @ np.array([[c, -s * ct, s * st, l * c], [s, c * ct, -c * st, l * s], [0, st, ct, 0], [0, 0, 0, 1.0]])
    assert np.allclose(H, np.eye(4), rtol=0.0, atol=1e-13)  # it closes
    return _hinged(random, "Bennett", lines)


def bricard(random: Random, symmetry: str) -> Mechanism:
    """Six hinges: three are the others' half turn about a line; or two lie in a plane in which two others are mirrored.

    Bricard (1897), J. de mathematiques pures et appliquees 5(3), 113-148.
    """
    lines = [(random.uniform(-1.0, 1.0, 3), any_turn(random) @ Z) for _ in range(4)]
    if symmetry == "line":
        half = np.diag([-1.0, -1.0, 1.0])
        lines = [*lines[:3], *((half @ p, half @ z) for p, z in lines[:3])]
    else:
        flat, mirror = np.diag([1.0, 1.0, 0.0]), np.diag([1.0, 1.0, -1.0])
        first, last = ((flat @ p, flat @ z) for p, z in lines[::3])
        lines = [first, *lines[1:3], last, *((mirror @ p, mirror @ z) for p, z in lines[2:0:-1])]
    return _hinged(random, f"Bricard with a {symmetry} of symmetry", lines)


def _hinged(random: Random, name: str, lines: Sequence[tuple[Array, Array]]) -> Mechanism:
    """A closed chain with one hinge on each line; one freedom."""
    n = len(lines)
    joints = {
        f"hinge{k}": Joint("revolute", link(k), link((k + 1) % n), p + random.uniform(-0.3, 0.3) * z, axes(z))
        for k, (p, z) in enumerate(lines)
    }
    return Mechanism(name, {link(k): random.uniform(-1.0, 1.0, 3) for k in range(1, n)}, joints, 1)


def hexapod(random: Random, legs: int) -> Mechanism:
    """A platform on legs with universal, sliding and ball joints: each gives as many freedoms as it takes."""
    bodies, joints = {"platform": Z}, {}
    for k in range(legs):
        foot = np.array([*(unit(2.0 * np.pi * k / legs) * random.uniform(0.8, 1.2)), 0.0])
        top = np.array([*(unit(2.0 * np.pi * (k + 0.5) / legs) * random.uniform(0.4, 0.6)), 1.0])
        cross = np.cross(top - foot, any_turn(random) @ Z)
        bodies |= {f"low{k}": foot + 0.2 * (top - foot), f"high{k}": foot + 0.8 * (top - foot)}
        joints |= {
            f"foot{k}": Joint("universal", WORLD, f"low{k}", foot, _across_leg(cross, top - foot)),
            f"slide{k}": Joint("prismatic", f"low{k}", f"high{k}", 0.5 * (foot + top), axes(top - foot)),
            f"top{k}": Joint("spherical", f"high{k}", "platform", top, any_turn(random)),
        }
    return Mechanism(f"hexapod on {legs} legs", bodies, joints, 6)


def translating(random: Random, legs: int) -> Mechanism:
    """Tsai's platform, which does not turn: universal, sliding, universal legs, outer axes parallel, and inner ones.

    Each leg forbids one turn; three do, more are redundant.
    """
    bodies, joints = {"platform": Z}, {}
    for k in range(legs):
        angle = 2.0 * np.pi * (k + random.uniform(-0.1, 0.1)) / legs
        foot, top = np.array([*unit(angle), 0.0]), np.array([*(0.5 * unit(angle + random.uniform(0.2, 0.5))), 1.0])
        R = _across_leg(np.array([-np.sin(angle), np.cos(angle), 0.0]), top - foot)
        bodies |= {f"low{k}": foot + 0.2 * (top - foot), f"high{k}": foot + 0.8 * (top - foot)}
        joints |= {
            f"foot{k}": Joint("universal", WORLD, f"low{k}", foot, R),
            f"slide{k}": Joint("prismatic", f"low{k}", f"high{k}", 0.5 * (foot + top), axes(top - foot)),
            f"top{k}": Joint("universal", "platform", f"high{k}", top, R),
        }
    return Mechanism(f"translating platform on {legs} legs", bodies, joints, 3)


def hung(random: Random, rods: int) -> Mechanism:
    """A platform on equal parallel legs of fixed length, with parallel universal joints at both ends: it does not turn.

    Three legs hold it so; more are redundant.
    """
    along = random.uniform(0.5, 1.0) * rotation_vector_to_matrix(random.uniform(-0.5, 0.5, 3)) @ Z
    R, bodies, joints = _across_leg(X, along), {"plate": along}, {}
    for k in range(rods):
        foot = np.array([*(unit(2.0 * np.pi * k / rods) * random.uniform(0.5, 1.0)), random.uniform(-0.2, 0.2)])
        bodies[f"rod{k}"] = foot + 0.5 * along
        joints |= {
            f"foot{k}": Joint("universal", WORLD, f"rod{k}", foot, R),
            f"top{k}": Joint("universal", "plate", f"rod{k}", foot + along, R),
        }
    return Mechanism(f"plate on {rods} rods", bodies, joints, 2)


def _across_leg(x: Array, leg: Array) -> Array:
    """Axes with a given x whose y is normal to a leg."""
    x, y = x / np.linalg.norm(x), np.cross(leg, x)
    y = y / np.linalg.norm(y)
    return np.column_stack([x, y, np.cross(x, y)])
