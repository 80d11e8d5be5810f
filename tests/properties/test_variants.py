"""Effects of a scene by name, scenes without some of them, and these as files that say only what differs."""

import tomllib
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest

from flexclear.artifacts.effect_size import chance, compared_values, influence
from flexclear.artifacts.points import Point
from flexclear.commands.new import write
from flexclear.post.answers.effect_sizes import variants as needed
from flexclear.post.answers.effect_sizes import with_dependents
from flexclear.scene import variants
from flexclear.scene.load import edited, load_scene
from flexclear.scene.quantity import KINDS, WORDS, Quantity
from flexclear.scene.schema import Scene
from flexclear.study.cost_design import Setting, neighbours
from flexclear.system.errors import InputError


@pytest.fixture
def crank(tmp_path: Path) -> Path:
    return write("slider-crank", tmp_path)[0]


def test_effects_are_the_parts_that_can_be_taken_away(crank: Path):
    found = {effect.name: effect.within for effect in variants.effects(load_scene(crank))}
    assert found == {
        "body.rod.modes": "",
        "body.rod.damping": "body.rod.modes",
        "joint.pin.clearance": "",
        "joint.pin.friction": "joint.pin.clearance",
        "load.gravity": "",
    }


def test_friction_of_ideal_joints_is_an_effect_of_its_own(crank: Path):
    law = {"law": "modified-coulomb", "static": 0.15, "dynamic": 0.1, "v_static": 0.02, "v_dynamic": 0.1}
    scene = edited(load_scene(crank), {"joint.main.friction": {**law, "radius": 0.01}})
    found = {effect.name: effect for effect in variants.effects(scene)}
    assert found["joint.main.friction"].within == ""
    assert variants.without_effects(scene, [found["joint.main.friction"]]).joint["main"].friction is None


def with_parts(crank: Path) -> Scene:
    """The crank with a bushing, a spring, a brake, a gear, and a ball on a plane with friction."""
    scene = load_scene(crank)
    friction = {"law": "ambrosio", "dynamic": 0.1, "v0": 0.0, "v1": 0.01}
    bushing = {"type": "bushing", "between": ["ground.main", "crank.main"], "stiffness": [1e6, 1e6, 1e6, 1e3, 1e3, 1.0]}
    floor = {"type": "ball-on-plane", "between": ["ground.main", "slider.pin"], "ball_radius": 0.01}
    parts = {
        "load.bush": bushing,
        "load.spring": {"type": "joint-spring", "joint": "guide", "stiffness": 10.0},
        "load.brake": {"type": "joint-friction", "joint": "guide", "viscous": 1.0},
        "joint.floor": {**floor, "normal": {"law": "hertz", "stiffness": 1e6}, "friction": friction},
    }
    return edited(scene, parts)


def test_other_parts_are_effects_on_request(crank: Path):
    scene = with_parts(crank)
    assert {"load.spring", "load.bush", "joint.floor"}.isdisjoint(e.name for e in variants.effects(scene))
    found = variants.effects_of(scene, ["load.spring", "load.bush", "joint.floor", "joint.pin", "load.brake"], "of")
    assert {e.name: e.within for e in found} == {
        "load.spring": "",
        "load.bush": "",
        "load.brake": "",
        "joint.floor": "",
        "joint.floor.friction": "joint.floor",
        "joint.pin.clearance": "",
        "joint.pin.friction": "joint.pin.clearance",
    }
    by_name = {e.name: e for e in found}
    assert by_name["load.bush"].words == "bushing of bush instead of a revolute joint"
    assert by_name["load.brake"].kind == "friction"
    (alone,) = variants.effects_of(scene, ["joint.pin.friction"], "of")
    assert alone.within == ""
    assert variants.effects_of(scene, (), "of") == variants.effects(scene)
    with pytest.raises(InputError, match=r"(?s)of load\.sprin: .*did you mean 'load\.spring'"):
        variants.effects_of(scene, ["load.sprin"], "of")


def test_a_part_that_goes_takes_its_quantities_with_it(crank: Path):
    scene = edited(
        with_parts(crank), {"view": {"watch": ["spring.force", "bush.bushing_displacement", "slider.position"]}}
    )
    gone = variants.without_effects(
        scene, variants.effects_of(scene, ["load.spring", "load.bush", "joint.floor"], "of")
    )
    assert set(gone.load) == {"gravity", "brake"}
    assert "floor" not in gone.joint
    assert (gone.joint["bush"].type, gone.joint["bush"].between) == ("revolute", ("ground.main", "crank.main"))
    assert gone.view.watch == ("slider.position",)


@pytest.mark.parametrize(
    "stiffness, held",
    [
        ([1, 1, 1, 0, 0, 0], "spherical"),
        ([1, 1, 0, 1, 1, 0], "cylindrical"),
        ([1, 1, 1, 1, 1, 1], "revolute"),
        ([1, 0, 1, 1, 1, 1], ""),
    ],
)
def test_a_bushing_is_compared_with_the_joint_that_holds_what_it_holds(crank: Path, stiffness: list[int], held: str):
    scene = edited(with_parts(crank), {"load.bush.stiffness": [1e6 * one for one in stiffness]})
    (effect,) = variants.effects_of(scene, ["load.bush"], "of")
    assert effect.joint == held


def test_any_watched_quantity_leaves_every_variant(crank: Path):
    """Those of the whole mechanism, too, that only some parts have: what a variant lacks it no longer requests."""
    scene = with_parts(crank)
    flexible = [name for name, body in scene.flexible().items()]
    scene = edited(scene, {"output.stress": flexible})
    owners = scene.owners()
    names = [
        f"{part}.{word}" for word, kinds in WORDS.items() for key in kinds for part in owners[KINDS[key].owner] if part
    ]
    names = [*dict.fromkeys(names), *owners[""]]
    watched = {name: edited(scene, {"view": {"watch": [name]}}) for name in names if variants._has_part(name, owners)}
    assert len({key for name in watched for key in [name.rpartition(".")[2]]}) > 40
    for one in watched.values():
        variants.ideal_scene(one)
        for setting in (Setting("dop853", 1e-7), Setting("rk4", 1e-7, 1e-4)):
            neighbours(one, setting)


def test_modes_of_a_body_that_becomes_rigid_are_asked_for_no_more(crank: Path):
    watched = ["rod.1.modal_coordinate", "pin.peak_force", "slider.position"]
    scene = edited(load_scene(crank), {"view": {"watch": watched}})
    gone = [effect for effect in variants.effects(scene) if effect.name == "body.rod.modes"]
    assert variants.without_effects(scene, gone).view.watch == tuple(watched[1:])
    assert variants.ideal_scene(scene).view.watch == ("slider.position",)


def test_any_variant_is_a_file_that_extends_its_scene_by_parts_replaced_and_removed(crank: Path):
    scene = load_scene(crank)
    every = variants.effects(scene)
    for gone in (few for n in range(len(every) + 1) for few in combinations(every, n)):
        variant = variants.without_effects(scene, gone)
        target = crank.parent / "below" / "variant.toml"
        target.parent.mkdir(exist_ok=True)
        text = variants.variant_text(scene, variant, variants.relative_path(target, crank))
        target.write_text(text)
        assert load_scene(target).model_dump(mode="json") == variant.model_dump(mode="json")
        families = set(tomllib.loads(text)) & {"body", "joint", "load", "drive"}
        assert not families, "parts are replaced or removed, never added"


def test_what_lies_within_an_effect_goes_with_it(crank: Path):
    scene = load_scene(crank)
    by_name = {effect.name: effect for effect in variants.effects(scene)}
    rigid = variants.without_effects(scene, [by_name["body.rod.modes"]])
    assert "body.rod.damping" not in {effect.name for effect in variants.effects(rigid)}
    assert rigid.output.stress is None
    tight = variants.without_effects(scene, [by_name["joint.pin.clearance"], by_name["joint.pin.friction"]])
    assert tight.joint["pin"].type == "revolute"
    assert tight.view is not None
    assert "pin.peak_force" not in (tight.view.watch or ())


def test_a_name_that_is_no_effect_is_refused_with_the_nearest(crank: Path):
    with pytest.raises(InputError, match=r"joint\.pin\.clearance"):
        variants.effects_by_name(load_scene(crank), ["joint.pin.clearence"], "plan")


def test_the_variants_of_two_effects_are_the_square(crank: Path):
    every = [e for e in variants.effects(load_scene(crank)) if e.name in ("body.rod.modes", "load.gravity")]
    assert len(needed(every)) == 4
    three = list(variants.effects(load_scene(crank)))
    assert all(with_dependents(three, gone) == gone for gone in needed(three))


def _point(values: np.ndarray, spread: float = 0.0) -> Point:
    name = "b.position.series"
    return Point({name: values}, {}, {name: np.full(values.shape, spread)} if spread else {}, 1)


def test_without_spread_an_influence_is_the_largest_distance():
    path = np.zeros((5, 3))
    other = path + np.array([0.0, 3e-6, 4e-6])
    found = influence(_point(path), _point(other), Quantity("b", "position"), 4)
    # a distance of 5e-6 from sums of squares of such numbers: some roundings of 1e-16
    assert found.difference == pytest.approx(5e-6, rel=1e-12)
    assert found.uncertainty == 0.0


def test_a_difference_of_means_within_their_standard_errors_is_chance():
    """Means of 4 members of deviation s along each of three axes: the standard error of a difference is s sqrt(6)/2."""
    path, spread, k = np.zeros((5, 3)), 1e-6, chance(4)
    # Student's t of 6 degrees of freedom at 1e-3, both sides, from tables, to their digits
    assert k == pytest.approx(5.959, abs=5e-4)
    error = spread * np.sqrt(6.0) / 2.0
    q = Quantity("b", "position")
    near = path + np.array([0.9 * k * error, 0.0, 0.0])
    assert influence(_point(path, spread), _point(near, spread), q, 4).difference == 0.0
    far = path + np.array([1.25 * k * error, 0.0, 0.0])
    found = influence(_point(path, spread), _point(far, spread), q, 4)
    # sqrt(5^2 - 4^2) = 3 quarters of chance are separated; roundings only
    assert found.difference == pytest.approx(0.75 * k * error, rel=1e-10)
    assert found.uncertainty == pytest.approx(k * error, rel=1e-10)


def test_a_quantity_that_one_side_lacks_is_infinitely_far():
    empty = Point({}, {}, {}, 1)
    assert influence(_point(np.zeros((2, 3))), empty, Quantity("b", "position"), 4).difference == np.inf


def test_changes_of_a_component_that_are_rounding_of_its_vector_are_none():
    """Across its plane a mechanism at 2 m/s moves by rounding, of which nothing is an effect; 1e-9 m/s is one."""
    across = Quantity("a", "velocity", "z", text="a.velocity.z")

    def moving(size: float) -> Point:
        values = {"series": np.full(4, size), "largest": np.array(size)}
        return Point(
            {"a.velocity.largest": np.array(2.0)} | {f"a.velocity.z.{k}": v for k, v in values.items()}, {}, {}, 1
        )

    assert influence(moving(2e-14), moving(1e-15), across, 0).most == 0.0
    assert influence(moving(1e-9), moving(0.0), across, 0).difference == pytest.approx(1e-9)
    assert {one.name for one in compared_values({"body": ["a"]}, [across])} == set(moving(0.0).values)


def test_members_that_have_parted_and_agree_at_one_output_by_accident_tell_no_difference():
    """Three members each of the same noise: of 600 outputs some have a spread far below the noise."""
    random = np.random.default_rng(3)
    points = []
    for _ in range(2):
        members = random.standard_normal((3, 600, 3))
        values, spread = members.mean(axis=0), members.std(axis=0, ddof=1)
        spread[100], values[100] = 1e-6, [1.0, 0.0, 0.0] if points else [0.0, 1.0, 0.0]
        points.append(Point({"a.velocity.series": values}, {}, {"a.velocity.series": spread}, 0))
    a, b = (Point({**p.values, "a.velocity.largest": np.array(1.0)}, {}, p.deviation, 0) for p in points)
    assert influence(a, b, Quantity("a", "velocity"), 3).difference == 0.0
    # before members part a difference is reported as it is
    early = {"a.velocity.series": np.where(np.arange(600)[:, None] < 200, 1e-9, a.deviation["a.velocity.series"])}
    calm = [Point(p.values, {}, early, 0) for p in (a, b)]
    apart = np.linalg.norm(a.values["a.velocity.series"] - b.values["a.velocity.series"], axis=1)[:180].max()
    assert influence(*calm, Quantity("a", "velocity"), 3).difference == pytest.approx(apart, rel=1e-6)
