"""Stops, gears, controllers and bushings that cannot be: refused before anything is compiled, with place and reason."""

from typing import Any

import pytest

from flexclear.pipeline.core.scene.load import load_scene
from flexclear.pipeline.core.system.errors import InputError
from flexclear.pipeline.dynamics.model.mechanism import build
from flexclear.pipeline.dynamics.model.model import tabulate
from tests.analytic.mechanism_runs import TREE

HERTZ = {"law": "hertz", "stiffness": 1.0}
STOP = {"joint": "A", "upper": 0.1, "normal": HERTZ}
PID = {"type": "pid", "joint": "A", "reference": 1.0}
NONE = [0.0] * 6


def mount(stiffness: list[Any]) -> dict[str, Any]:
    return {"type": "bushing", "between": ["ground.O", "block.centre"], "stiffness": stiffness}


#: scene and part -> what is wrong of it, and what is said
WRONG: dict[tuple[str, str], list[tuple[dict[str, Any], tuple[str, ...]]]] = {
    ("stops", "stop.s"): [
        ({"joint": "A", "normal": HERTZ}, ("neither",)),
        (STOP | {"normal": {"law": "hertz"}}, ("normal.stiffness",)),
        (STOP | {"upper": "3 deg"}, ("stop.s.upper", "an angle", "length")),
        (STOP | {"lower": 0.2}, ("lower = 0.2", "below")),
        (STOP | {"joint": "K"}, ("stop.s.joint", "no joint 'K'")),
        (STOP | {"normal": HERTZ | {"law": "kelvin-voigt", "restitution": 0.5}}, ("effective_mass",)),
        (STOP | {"normal": HERTZ | {"law": "flores"}}, ("stop.s.normal", "restitution")),
        (STOP | {"floor": -1.0}, ("stop.s.floor", "positive")),
    ],
    ("gears", "gear.g"): [
        ({"first": "sun", "second": "sun", "ratio": 2.0}, ("couples two coordinates",)),
        ({"first": "sun", "second": "moon", "ratio": 2.0}, ("gear.g.second", "no joint 'moon'", "known: P1")),
        ({"first": "sun", "second": "P1", "ratio": "2 mm/rad"}, ("gear.g.ratio", "length per angle")),
        ({"first": "wheel", "second": "rack", "ratio": "2 N"}, ("gear.g.ratio", "length per angle", "m/rad")),
        ({"first": "sun", "second": "P1", "ratio": 0.0}, ("ratio is 0", "drive")),
        ({"first": "ring_fixed", "second": "P1", "ratio": 1.0}, ("gear.g.first", "no coordinate")),
    ],
    ("controllers", "load.c"): [
        (PID, ("needs a gain",)),
        (PID | {"reference": "3 deg", "proportional": 1.0}, ("load.c.reference", "an angle", "length")),
        (PID | {"proportional": "2 N"}, ("load.c", "a stiffness belongs here")),
        (PID | {"measured": "K", "proportional": 1.0}, ("load.c.measured", "no joint 'K'")),
        (PID | {"integral": 1.0, "limits": [0.0, 1.0]}, ("tracking_time",)),
        (PID | {"integral": 1.0, "limits": [1.0, 1.0]}, ("1 is not below 1",)),
        (PID | {"type": "sampled-pid", "integral": 1.0, "period": 1e-9}, ("load.c.period", "1e+09 samples")),
    ],
    ("bushing", "load.mount"): [
        (mount([1.0, 2.0]), ("[x, y, z, rx, ry, rz]",)),
        (mount(["1 N/m", 0, 0, "1 N/m", 0, 0]), ("torsional stiffness",)),
        (mount([-1.0, 0, 0, 0, 0, 0]), ("must not be negative", "along x is -1")),
        (
            mount([[1.0, 2.0, *NONE[2:]], [1.0, 1.0, *NONE[2:]], *[NONE] * 4]),
            ("must be symmetric", "between y and x are 1 and 2"),
        ),
        (
            mount([[1.0, 2.0, *NONE[2:]], [2.0, 1.0, *NONE[2:]], *[NONE] * 4]),
            ("positive semidefinite", "source of energy"),
        ),
        (mount([[1, 0, 2, 0, 0, 0], [0, 1, 0, 0, 0, 0], [2.0, *NONE[1:]], *[NONE] * 3]), ("z has none of its own",)),
        (mount(NONE), ("it has neither",)),
    ],
}


@pytest.mark.parametrize("scene, part, table, words", [(*at, *case) for at, cases in WRONG.items() for case in cases])
def test_what_is_no_stop_gear_controller_or_bushing_is_refused_in_words(
    scene: str, part: str, table: dict[str, Any], words: tuple[str, ...]
) -> None:
    with pytest.raises(InputError) as error:
        tabulate(build(load_scene(TREE / "scenes" / "checks" / f"{scene}.toml", {part: table}), {}))
    assert part in str(error.value)
    assert [word for word in words if word not in str(error.value)] == []
