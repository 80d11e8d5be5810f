"""All units of known mobility by name, each with its random geometry."""

from collections.abc import Callable
from functools import partial

from tests.properties import movable_planar as flat
from tests.properties import movable_spatial as deep
from tests.properties.movable import Mechanism, Random

Maker = Callable[[Random], Mechanism]


def _one_slides(random: Random, name: str) -> Mechanism:
    return flat.loop(random, name, sliding=[int(random.integers(len(flat.LOOPS[name][1])))])


def _some_loose(random: Random, name: str, count: int) -> Mechanism:
    return flat.loop(random, name, loose=random.permutation(len(flat.LOOPS[name][1]))[:count].tolist())


def _loops() -> dict[str, Maker]:
    """Every planar loop with hinges, with one joint sliding, with one joint in turn, two and three with clearance."""
    found: dict[str, Maker] = {}
    for name, (_, pairs) in flat.LOOPS.items():
        found[name] = partial(flat.loop, name=name)
        found[f"{name}, one slides"] = partial(_one_slides, name=name)
        for k in range(len(pairs)):
            found[f"{name}, joint {k} loose"] = partial(flat.loop, name=name, loose=[k])
        for count in (2, 3):
            found[f"{name}, {count} loose"] = partial(_some_loose, name=name, count=count)
    for loose in ([0], [1], [2], [0, 1], [1, 2], [0, 2], [0, 1, 2]):
        found[f"slider-crank, loose {loose}"] = partial(flat.loop, name="four-bar", sliding=[3], loose=loose)
    return found


UNITS: dict[str, Maker] = {
    **{f"{a} and {b}": partial(deep.coaxial, kinds=[a, b], mobility=m) for a, b, m in deep.COAXIAL},
    "three hinges": partial(deep.coaxial, kinds=["revolute"] * 3, mobility=1),
    "five hinges": partial(deep.coaxial, kinds=["revolute"] * 5, mobility=1),
    "hinge, slide and ball": partial(deep.coaxial, kinds=["cylindrical", "cylindrical", "spherical"], mobility=1),
    "parallel rails": partial(deep.parallel, kinds=["prismatic"] * 3, mobility=1),
    "parallel planes": partial(deep.parallel, kinds=["planar"] * 3, mobility=3),
    "parallel bearings": partial(deep.parallel, kinds=["planar", "clearance-revolute"], mobility=3),
    "rail on a plane": deep.slotted,
    **_loops(),
    "parallelogram": partial(flat.parallel_cranks, cranks=2),
    "three parallel cranks": partial(flat.parallel_cranks, cranks=3),
    "five parallel cranks": partial(flat.parallel_cranks, cranks=5),
    "scissors": partial(flat.scissors, stages=1),
    "four scissors": partial(flat.scissors, stages=4),
    "Peaucellier": flat.peaucellier,
    "spherical four-bar": partial(deep.spherical, links=4),
    "spherical five-bar": partial(deep.spherical, links=5),
    "spherical four-bar with a ball": partial(deep.spherical, links=4, balls=1),
    "Sarrus": partial(deep.sarrus, walls=2),
    "Sarrus on three walls": partial(deep.sarrus, walls=3),
    "Sarrus on five walls": partial(deep.sarrus, walls=5),
    "Sarrus, a wall loose": partial(deep.sarrus, walls=2, loose=[1]),
    "Sarrus, two walls loose": partial(deep.sarrus, walls=3, loose=[0, 2]),
    "Bennett": deep.bennett,
    "Bricard with a line": partial(deep.bricard, symmetry="line"),
    "Bricard with a plane": partial(deep.bricard, symmetry="plane"),
    "hexapod": partial(deep.hexapod, legs=6),
    "hexapod on eight legs": partial(deep.hexapod, legs=8),
    "translating platform": partial(deep.translating, legs=3),
    "translating platform on five legs": partial(deep.translating, legs=5),
    "plate on three rods": partial(deep.hung, rods=3),
    "plate on six rods": partial(deep.hung, rods=6),
    "plate on nine rods": partial(deep.hung, rods=9),
}


def seed(*parts: object) -> list[int]:
    """A seed of names and numbers, the same in every process."""
    return [sum(ord(c) * 31**k for k, c in enumerate(str(part))) % 2**31 for part in parts]
