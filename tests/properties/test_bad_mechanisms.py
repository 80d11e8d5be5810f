"""Mechanisms that cannot be are refused in words, before anything is compiled."""

from copy import deepcopy
from typing import Any

import numpy as np
import pytest

from flexclear.pipeline.core.numerics.rotations import rotation_vector_to_matrix
from flexclear.pipeline.core.scene.load import load_scene
from flexclear.pipeline.core.scene.schema import Scene
from flexclear.pipeline.core.system.errors import InputError, SolverError
from flexclear.pipeline.dynamics.compile import functions
from flexclear.pipeline.dynamics.run.run import engine_of
from tests.analytic.mechanism_runs import TREE
from tests.properties.mechanisms import Table, frame, joint, scene, turned
from tests.properties.mechanisms import body as rigid


@pytest.fixture(autouse=True)
def _nothing_compiles(monkeypatch: pytest.MonkeyPatch) -> None:
    def entry(*args: Any) -> None:
        raise AssertionError("came as far as the kernels")

    monkeypatch.setattr(functions, "entry", entry)


def four_bar() -> Table:
    """A parallelogram on two pins, standing upright."""
    path = TREE / "scenes" / "checks" / "four_bars_1.toml"
    return deepcopy(load_scene(path).model_dump(exclude_none=True))


def refusal(table: Table) -> InputError:
    with pytest.raises(InputError) as caught:
        engine_of(Scene.model_validate(table), {}, lambda fraction, text: None)
    assert caught.value.exit_code == 2
    return caught.value


def test_a_sound_mechanism_gets_as_far_as_the_kernels() -> None:
    with pytest.raises(AssertionError, match="as far as the kernels"):
        engine_of(Scene.model_validate(four_bar()), {}, lambda fraction, text: None)


def test_a_body_joined_to_nothing() -> None:
    table = four_bar()
    table["body"]["lost"] = deepcopy(table["body"]["beam1"])
    error = refusal(table)
    assert error.place == "[body.lost]"
    assert "joined to nothing" in error.problem
    assert "free" in str(error.remedy)


def test_a_body_that_says_it_is_free_is_accepted() -> None:
    table = four_bar()
    table["body"]["bird"] = deepcopy(table["body"]["beam1"]) | {"inertia": (0.01, 0.08, 0.08)}
    table["joint"]["flight"] = {"type": "free", "between": ("ground.pin0", "bird.left")}
    with pytest.raises(AssertionError, match="as far as the kernels"):
        engine_of(Scene.model_validate(table), {}, lambda fraction, text: None)


def step(change: float) -> Table:
    return {"type": "step", "start": (0.0,), "end": (1.0,), "change": (change,)}


def test_drives_that_contradict_each_other() -> None:
    table = four_bar()
    table["drive"] = {n: {"joint": n, "law": step(c)} for n, c in (("foot0", 0.3), ("foot1", 0.2))}
    error = refusal(table)
    assert error.place in {"[drive.foot0]", "[drive.foot1]"}
    assert "over-driven" in error.problem
    assert "foot0, foot1" in error.problem
    assert "remove" in str(error.remedy)


def test_a_locked_mechanism() -> None:
    table = four_bar()
    table["body"]["brace"] = deepcopy(table["body"]["beam1"])
    table["body"]["brace"]["pose"] = {"position": (0.0, 0.0, 0.0)}
    table["body"]["brace"]["frames"] = {"a": {}, "b": {"position": (1.0, 1.0, 0.0)}}
    for body in table["body"].values():
        body.pop("velocity", None)
        body.pop("angular_velocity", None)
    table["joint"]["low"] = {"type": "revolute", "between": ("ground.pin0", "brace.a")}
    table["joint"]["high"] = {"type": "revolute", "between": ("brace.b", "rod1.top")}
    error = refusal(table)
    assert error.place == "[joint]"
    assert "locked" in error.problem
    assert error.remedy


def test_a_joint_whose_frames_are_at_a_distance_of_metres() -> None:
    table = four_bar()
    table["body"]["beam1"]["pose"] = {"position": (3.0, 1.0, 0.0)}
    error = refusal(table)
    assert error.place in {"[joint.left1.between]", "[joint.right1.between]"}
    assert "3 m apart" in error.problem
    assert "%" in error.problem  # the rule
    assert "poses" in str(error.remedy)


def test_a_joint_whose_axes_are_far_from_parallel() -> None:
    table = four_bar()
    table["body"]["rod1"]["pose"]["rotation_vector"] = (0.0, 0.3, 0.0)
    error = refusal(table)
    assert "axes" in error.problem
    assert "deg" in error.problem


def test_a_joint_whose_axes_point_opposite_ways() -> None:
    table = four_bar()
    table["body"]["beam1"]["frames"]["left"] = {"rotation_vector": (3.141592653589793, 0.0, 0.0)}
    error = refusal(table)
    assert error.place == "[joint.left1.between]"
    assert "same way" in error.problem


def test_a_mechanism_that_cannot_be_assembled_lists_the_residual_of_every_joint() -> None:
    """A stretched pair of rods that would have to be 2 % longer."""
    table = four_bar()
    bodies, joints = table["body"], table["joint"]
    del bodies["rod1"], joints["foot1"]
    bodies["ground"]["frames"] = {"pin0": {}, "far": {"position": (2.02, 0.0, 0.0)}}
    bodies["rod0"]["pose"] = {"rotation_vector": (0.0, 0.0, -1.5707963267948966)}
    bodies["beam1"]["pose"] = {"position": (1.0, 0.0, 0.0)}
    joints["right1"] = {"type": "revolute", "between": ("beam1.right", "ground.far")}
    error = refusal(table)
    assert "cannot be assembled" in error.problem
    assert "right1 " in error.problem
    assert error.remedy


def test_a_start_in_a_singular_pose_is_refused_with_time_joint_and_condition() -> None:
    """All rods lie in one line, at rest: the loop may become a parallelogram or its twin."""
    table = four_bar()
    for body in table["body"].values():
        body.pop("velocity", None)
        body.pop("angular_velocity", None)
    lying = {"rotation_vector": (0.0, 0.0, -1.5707963267948966)}
    for rod, x in (("rod0", 0.0), ("rod1", 1.0)):
        table["body"][rod] |= {"pose": {"position": (x, 0.0, 0.0), **lying}}
    table["body"]["beam1"]["pose"] = {"position": (1.0, 0.0, 0.0)}
    with pytest.raises(SolverError) as caught:
        engine_of(Scene.model_validate(table), {}, lambda fraction, text: None)
    assert caught.value.exit_code == 3
    for part in ("t = 0 s", "singular", "condition number", "joints"):
        assert part in str(caught.value), part


@pytest.mark.parametrize("frame", ["ground.pin0", "stand.bolt"])
@pytest.mark.parametrize("kind, value", [("point-force", "force"), ("point-torque", "torque")])
def test_a_load_on_what_does_not_move(frame: str, kind: str, value: str) -> None:
    """The ground, and a body that is fixed to it."""
    table = four_bar()
    table["body"]["stand"] = {**deepcopy(table["body"]["beam1"]), "frames": {"bolt": {"position": (0.0, 0.1, 0.0)}}}
    table["joint"]["weld"] = {"type": "fixed", "between": ("ground.pin0", "stand.bolt")}
    table["load"] = {"push": {"type": kind, "frame": frame, value: (1.0, 0.0, 0.0)}}
    error = refusal(table)
    assert error.place == "[load.push]"
    assert frame in error.problem
    assert "does nothing" in error.problem
    assert error.remedy
    table["load"]["push"]["frame"] = "rod0.top"
    with pytest.raises(AssertionError, match="as far as the kernels"):
        engine_of(Scene.model_validate(table), {}, lambda fraction, text: None)


def test_a_spring_may_end_on_the_ground() -> None:
    table = four_bar()
    ends = {"between": ("ground.pin0", "beam1.left"), "stiffness": 10.0, "free_length": 0.1}
    table["load"] = {"tie": {"type": "spring-damper", **ends}}
    with pytest.raises(AssertionError, match="as far as the kernels"):
        engine_of(Scene.model_validate(table), {}, lambda fraction, text: None)


def thin_rod(kind: str, turn: tuple[float, float, float]) -> Table:
    """A rod along its frame's x, without inertia about it, turned with all that it has."""
    R = rotation_vector_to_matrix(np.array(turn))
    moments = R @ np.diag([0.0, 0.01, 0.01]) @ R.T
    rod = rigid((0.0, 0.0, 0.0), frames={"A": frame((0.0, 0.0, 0.0), turn)}, inertia=moments.tolist())
    base = {"type": "ground", "frames": {"A": frame((0.0, 0.0, 0.0), turn)}}
    return scene(
        {"base": base, "rod": rod | {"com": turned(R, (0.1, 0.0, 0.0))}}, {"J": joint(kind, "base.A", "rod.A")}
    )


@pytest.mark.parametrize("turn", [(0.0, 0.0, 0.0), (0.3, -0.4, 0.5), (0.0, 0.0, 0.5 * np.pi)])
def test_a_motion_that_no_mass_resists(turn: tuple[float, float, float]) -> None:
    """Turned moments have eigenvalues of rounding, of either sign, where the rod has no inertia."""
    for kind in ("spherical", "universal", "free"):
        error = refusal(thin_rod(kind, turn))
        assert error.place == "[body.rod.inertia]"
        assert "nothing resists a motion of rod" in error.problem
    with pytest.raises(AssertionError, match="as far as the kernels"):  # about z it has some
        engine_of(Scene.model_validate(thin_rod("revolute", turn)), {}, lambda fraction, text: None)
