"""A model that is refilled with the numbers of an edited scene is the one that would be made from scratch."""

from collections.abc import Callable, Iterator
from itertools import islice
from pathlib import Path
from typing import Any, get_args

import numpy as np
import pytest

from flexclear.dynamics.model import refill
from flexclear.dynamics.model.mechanism import build
from flexclear.dynamics.model.mobility import analyse
from flexclear.dynamics.model.model import Model, tabulate
from flexclear.dynamics.model.refill import CHANGEABLE, refill_model
from flexclear.scene.fields import Part
from flexclear.scene.load import FAMILIES, edited, load_scene, with_numbers
from flexclear.scene.schema import Scene
from flexclear.system.errors import InputError

STROKE = {"type": "step", "start": [0.0], "end": [0.1], "change": ["20 mm"]}
#: scene, its changes, and whether refilling must do
CASES: list[tuple[str, dict[str, Any], bool]] = [
    ("sps4/csj", {"joint.A1.clearance": "0.3 mm"}, True),
    ("sps4/csj", {"joint.A1.normal.restitution": 0.5, "joint.A1.friction.dynamic": 0.05}, True),
    ("sps4/csj", {"time.end": "0.1 s", "solver.rtol": 1e-6, "output.interval": "1 ms"}, True),
    ("sps4/csj", {"drive.P1.law": STROKE}, True),
    ("sps4/csj", {"drive.P1.law.change.0": "50 mm", "drive.P1.law.change.1": "-50 mm"}, True),
    ("checks/oscillator", {"load.spring.stiffness": 150.0, "load.spring.damping": 1.0}, True),
    ("checks/pendulum", {"load.gravity.acceleration.1": -1.62}, True),
    ("checks/clearance_slider_crank", {"joint.pin.friction.static": 0.2}, True),
    ("checks/oscillator", {"body.mass.mass": 2.0}, True),
    ("checks/oscillator", {"body.mass.frames.centre.position.2": "1 mm"}, False),
    ("sps4/ideal", {"body.platform.mass": 0.4, "body.platform.com.2": "1 mm"}, True),
    ("sps4/csj", {"body.rod1.inertia.0.0": 0.000998, "body.socket_A2.mass": 0.2, "joint.A1.clearance": "0.3 mm"}, True),
    # what is another structure, start or kernel
    ("sps4/csj", {"joint.A1.clearance": "2 m"}, False),
    ("sps4/csj", {"drive.P3.law.value": "1 mm"}, False),
    ("sps4/csj", {"drive.P3.law": STROKE}, False),
    ("sps4/csj", {"joint.A1.friction": {"law": "ambrosio", "dynamic": 0.1, "v0": 1e-4, "v1": 1e-3}}, False),
    ("checks/pendulum", {"body.bob.mass": 2.0}, False),
    ("sps4/csj", {"joint.A1.wear": {"coefficient": 1e-4, "hardness": 2e9, "sectors": 36}}, False),
    ("checks/rubbing_slider_crank", {"joint.O.friction": None}, False),
    ("checks/oscillator", {"body.mass.inertia.0.0": 0.0}, False),
]


@pytest.mark.parametrize("name, change, serves", CASES)
def test_a_refilled_model_is_the_same_to_the_last_bit(root: Path, name: str, change: dict[str, Any], serves: bool):
    scene = load_scene(root / "scenes" / f"{name}.toml")
    other = with_numbers(scene, change)
    assert other == edited(scene, change)
    model, whole = tabulate(build(scene, {})), tabulate(build(other, {}))
    found = refill_model(model, other)
    assert (found is not None) == serves
    if found is None:
        return
    assert np.array_equal(found.arrays.h, whole.arrays.h)
    assert np.array_equal(found.arrays.f, whole.arrays.f)
    assert (found.parts, found.scene, found.length) == (whole.parts, whole.scene, whole.length)
    assert analyse(whole) == analyse(model)


@pytest.mark.parametrize("change", [{"joint.A1.clearance": "-1 mm"}, {"joint.A9.clearance": 1.0}, {"time.end": -1.0}])
def test_a_quick_edit_refuses_what_a_whole_one_does(root: Path, change: dict[str, Any]):
    scene, said = load_scene(root / "scenes/sps4/csj.toml"), []
    for edit in (edited, with_numbers):
        with pytest.raises(InputError) as refused:
            edit(scene, change)
        said.append(str(refused.value))
    assert said[0] == said[1]


@pytest.mark.parametrize("edit", [edited, with_numbers, lambda scene, change: load_scene(scene.path, change)])
def test_a_recipe_in_an_edit_is_looked_for_where_the_scene_is(root: Path, edit: Callable[..., Scene]):
    scene = edit(load_scene(root / "scenes/sps4/far_cb.toml"), {"body.rod1.mesh": "meshes/rods/steel.toml"})
    assert Path(scene.recipes()["rod1"]).resolve() == (root / "meshes/rods/steel.toml").resolve()


# The whole schema ----------------------------------------------------------------------------------------------------


def part_models(annotation: Any) -> set[type[Part]]:
    """Models of parts that an annotation allows."""
    if isinstance(annotation, type) and issubclass(annotation, Part):
        return {annotation}
    return set().union(*(part_models(one) for one in get_args(annotation)))


#: (table, model of its parts, key) of everything that a scene may say
KEYS = [
    (table, model, key)
    for table, field in Scene.model_fields.items()
    for model in part_models(field.annotation)
    for key in model.model_fields
    if key != "source"
]


def test_the_schema_is_known_by_its_keys() -> None:
    tables = {table for table, _, _ in KEYS}
    assert set(Scene.model_fields) - tables == {"source", "title", "description"}
    assert {f"{table}.{key}" for table, _, key in KEYS} >= {
        ".".join(name.split(".")[:2]) for name in CHANGEABLE if "." in name
    }
    assert {name for name in CHANGEABLE if "." not in name} <= set(Scene.model_fields)


@pytest.mark.parametrize("table", Scene.model_fields)
def test_what_is_not_listed_must_be_the_same(table: str) -> None:
    """Of every key of every model of parts, and of every table as a whole."""
    assert refill._differ_only_in_changeable("other", "one", table) == (table in CHANGEABLE)
    for owner, model, key in KEYS:
        if owner == table:
            was = model.model_construct(**dict.fromkeys(model.model_fields, 0.0))
            new = was.model_copy(update={key: 1.0})
            listed = table in CHANGEABLE or f"{table}.{key}" in CHANGEABLE
            assert refill._differ_only_in_changeable({"part": new}, {"part": was}, table) == listed, (table, model, key)
            assert not refill._differ_only_in_changeable({"other": was}, {"part": was}, table) or table in CHANGEABLE


#: rigid scenes that have between them every kind of part
SCENES = [
    *("sps4/csj", "checks/stops", "checks/gears", "checks/bushing", "checks/controllers", "checks/oscillator"),
    *("checks/clearance_slider_crank", "checks/rubbing_slider_crank", "checks/ball_on_plane"),
    *("checks/driven_pendulum", "checks/expressions"),
]


def changes(value: Any, path: str) -> Iterator[dict[str, Any]]:
    """The first two numbers in a value of a scene, each changed by a hundredth; the other truth value."""
    if isinstance(value, bool):
        yield {path: not value}
    elif isinstance(value, (int, float)):
        yield {path: value * 1.01 if value and isinstance(value, float) else value + 1}
    elif isinstance(value, (dict, list)):
        inner = value.items() if isinstance(value, dict) else enumerate(value)
        each = (change for key, one in inner if key != "source" for change in changes(one, f"{path}.{key}"))
        yield from islice(each, 2)


def edits(scene: Scene) -> Iterator[dict[str, Any]]:
    """A change of each key of each kind of part, and of each setting, that a scene gives."""
    known = set[tuple[str, ...]]()
    for table, value in scene.model_dump(mode="json", exclude_none=True).items():
        parts = value.items() if table in FAMILIES else [("", value)]
        for name, part in parts if isinstance(value, dict) else []:
            for key, one in part.items():
                kind = (table, type(getattr(scene, table).get(name)).__name__ if name else "", key)
                if kind not in known:
                    known.add(kind)
                    yield from changes(one, ".".join(filter(None, (table, name, key))))


def said(model: Model) -> tuple[Any, ...]:
    """What a model says next to its arrays."""
    ratios = [getattr(closure, "ratio", None) for closure in model.closures]
    starts = [(*link.start.p, *link.start.R.ravel()) for link in model.links]
    contacts = [(contact.name, contact.joint) for contact in model.contacts]
    return model.parts, model.scene, model.length, model.laws, contacts, ratios, starts


def differing(root: Path, name: str, override: dict[str, Any] | None = None) -> tuple[list[dict[str, Any]], int]:
    """Changes of a scene for which a refilled model is not the one from scratch, and how often it is."""
    scene = load_scene(root / "scenes" / f"{name}.toml", override)
    model, wrong, equal = tabulate(build(scene, {})), [], 0
    for change in edits(scene):
        try:
            other = edited(scene, change)
            made = refill_model(model, other)
        except InputError:
            continue
        if made is not None:
            same = is_the_one_from_scratch(made, other)
            equal += same
            wrong += [] if same else [change]
    return wrong, equal


def is_the_one_from_scratch(made: Model, scene: Scene) -> bool:
    try:
        whole = tabulate(build(scene, {}))
    except InputError:
        return False
    arrays = all(np.array_equal(getattr(made.arrays, a), getattr(whole.arrays, a)) for a in "hf")
    return arrays and said(made) == said(whole)


@pytest.mark.parametrize("name", SCENES)
def test_a_change_gives_no_model_or_the_one_from_scratch(root: Path, name: str) -> None:
    wrong, equal = differing(root, name)
    assert wrong == []
    assert equal >= (0 if name == "checks/ball_on_plane" else 5)  # a ball above a plane is as far as all is large


@pytest.mark.parametrize(
    "table, name", [("stop", "checks/stops"), ("gear", "checks/gears"), ("start", "checks/pendulum")]
)
def test_a_table_that_is_left_out_would_be_noticed(
    root: Path, monkeypatch: pytest.MonkeyPatch, table: str, name: str
) -> None:
    monkeypatch.setattr(refill, "CHANGEABLE", CHANGEABLE | {table})
    joint = next(iter(load_scene(root / "scenes" / f"{name}.toml").joint))
    override = {"start.joint": {joint: {"position": 0.05}}} if table == "start" else {}
    wrong, _ = differing(root, name, override)
    assert {place.partition(".")[0] for change in wrong for place in change} == {table}
    with pytest.raises(AssertionError):
        test_what_is_not_listed_must_be_the_same(table)
