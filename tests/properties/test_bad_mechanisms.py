"""Mechanisms that cannot be are refused in words, before anything is compiled."""

import re
from collections.abc import Callable
from copy import deepcopy
from typing import Any

import numpy as np
import pytest

from flexclear.dynamics.compile import functions
from flexclear.dynamics.run.run import engine_of
from flexclear.numerics.rotations import rotation_vector_to_matrix
from flexclear.scene.load import load_scene
from flexclear.scene.schema import Scene
from flexclear.system.errors import InputError, SolverError
from flexclear.system.progress import silent
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


def prepare(table: Table) -> None:
    """As far as a run gets before anything is compiled."""
    engine_of(Scene.model_validate(table), {}, silent)


def gets_as_far_as_the_kernels(table: Table) -> None:
    with pytest.raises(AssertionError, match="as far as the kernels"):
        prepare(table)


def refused(table: Table, place: str, *words: str) -> None:
    with pytest.raises(InputError) as caught:
        prepare(table)
    assert caught.value.exit_code == 2
    assert re.fullmatch(place, str(caught.value.place))
    assert caught.value.remedy
    for word in words:
        assert word in str(caught.value)


#: of a rod of 1 m that lies along x
LYING = {"rotation_vector": (0.0, 0.0, -0.5 * np.pi)}


def at_rest(table: Table) -> None:
    for body in table["body"].values():
        body.pop("velocity", None)
        body.pop("angular_velocity", None)


def unchanged(table: Table) -> None:
    """A sound mechanism."""


def with_a_free_body(table: Table) -> None:
    table["body"]["bird"] = deepcopy(table["body"]["beam1"]) | {"inertia": (0.01, 0.08, 0.08)}
    table["joint"]["flight"] = {"type": "free", "between": ("ground.pin0", "bird.left")}


def with_a_spring_to_the_ground(table: Table) -> None:
    ends = {"between": ("ground.pin0", "beam1.left"), "stiffness": 10.0, "free_length": 0.1}
    table["load"] = {"tie": {"type": "spring-damper", **ends}}


@pytest.mark.parametrize("change", [unchanged, with_a_free_body, with_a_spring_to_the_ground])
def test_what_is_sound_gets_as_far_as_the_kernels(change: Callable[[Table], None]) -> None:
    table = four_bar()
    change(table)
    gets_as_far_as_the_kernels(table)


def with_a_body_joined_to_nothing(table: Table) -> None:
    table["body"]["lost"] = deepcopy(table["body"]["beam1"])


def with_drives_that_contradict_each_other(table: Table) -> None:
    law = {"type": "step", "start": (0.0,), "end": (1.0,)}
    table["drive"] = {n: {"joint": n, "law": law | {"change": (c,)}} for n, c in (("foot0", 0.3), ("foot1", 0.2))}


def with_a_brace_that_locks_it(table: Table) -> None:
    at_rest(table)
    frames = {"a": {}, "b": {"position": (1.0, 1.0, 0.0)}}
    table["body"]["brace"] = deepcopy(table["body"]["beam1"]) | {"pose": {}, "frames": frames}
    table["joint"]["low"] = {"type": "revolute", "between": ("ground.pin0", "brace.a")}
    table["joint"]["high"] = {"type": "revolute", "between": ("brace.b", "rod1.top")}


def with_frames_at_a_distance_of_metres(table: Table) -> None:
    table["body"]["beam1"]["pose"] = {"position": (3.0, 1.0, 0.0)}


def with_axes_far_from_parallel(table: Table) -> None:
    table["body"]["rod1"]["pose"]["rotation_vector"] = (0.0, 0.3, 0.0)


def with_axes_that_point_opposite_ways(table: Table) -> None:
    table["body"]["beam1"]["frames"]["left"] = {"rotation_vector": (np.pi, 0.0, 0.0)}


def with_two_rods_that_are_too_short(table: Table) -> None:
    """They would have to be 2 % longer."""
    bodies, joints = table["body"], table["joint"]
    del bodies["rod1"], joints["foot1"]
    bodies["ground"]["frames"] = {"pin0": {}, "far": {"position": (2.02, 0.0, 0.0)}}
    bodies["rod0"]["pose"] = LYING
    bodies["beam1"]["pose"] = {"position": (1.0, 0.0, 0.0)}
    joints["right1"] = {"type": "revolute", "between": ("beam1.right", "ground.far")}


#: a percentage in a message is its rule
REFUSED: dict[Callable[[Table], None], tuple[str, ...]] = {
    with_a_body_joined_to_nothing: (r"\[body\.lost\]", "not connected", "free"),
    with_drives_that_contradict_each_other: (r"\[drive\.foot[01]\]", "over-driven", "foot0, foot1", "remove"),
    with_a_brace_that_locks_it: (r"\[joint\]", "locked"),
    with_frames_at_a_distance_of_metres: (r"\[joint\.(left|right)1\.between\]", "a distance of 3 m", "%", "poses"),
    with_axes_far_from_parallel: (r"\[joint.*", "axes", "deg"),
    with_axes_that_point_opposite_ways: (r"\[joint\.left1\.between\]", "opposite directions"),
    with_two_rods_that_are_too_short: (".*", "cannot be assembled", "right1 "),
}


@pytest.mark.parametrize("change", REFUSED, ids=lambda change: change.__name__)
def test_a_mechanism_that_cannot_be_is_refused_with_place_and_remedy(change: Callable[[Table], None]) -> None:
    table = four_bar()
    change(table)
    refused(table, *REFUSED[change])


def test_a_start_in_a_singular_pose_is_refused_with_time_joint_and_condition() -> None:
    """All rods lie in one line, at rest: the loop may become a parallelogram or its twin."""
    table = four_bar()
    at_rest(table)
    for rod, x in (("rod0", 0.0), ("rod1", 1.0)):
        table["body"][rod] |= {"pose": {"position": (x, 0.0, 0.0), **LYING}}
    table["body"]["beam1"]["pose"] = {"position": (1.0, 0.0, 0.0)}
    with pytest.raises(SolverError) as caught:
        prepare(table)
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
    refused(table, r"\[load\.push\]", frame, "has no effect")
    table["load"]["push"]["frame"] = "rod0.top"
    gets_as_far_as_the_kernels(table)


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
        refused(thin_rod(kind, turn), r"\[body\.rod\.inertia\]", "the acceleration of rod is undetermined")
    gets_as_far_as_the_kernels(thin_rod("revolute", turn))  # about z it has some
