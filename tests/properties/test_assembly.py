"""Assembly from joints alone, on either branch, and what ``[start]`` may not say; nothing is compiled for that."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from flexclear.dynamics.model.assembly import assemble
from flexclear.dynamics.model.mechanism import Mechanism, build
from flexclear.dynamics.model.model import tabulate
from flexclear.dynamics.starts import equilibrium
from flexclear.scene.load import edited, load_scene
from flexclear.scene.schema import Scene
from flexclear.system.errors import FlexclearError, InputError
from tests.analytic.mechanism_runs import TREE, bundles
from tests.properties.mechanisms import Table, body, frame, joint, matrix, rigid, scene
from tests.properties.test_dynamics_start import angles, driven, start_of


def loose(crank: float, **start: Any) -> Table:
    """The four-bar of `driven` without the pose of any body; start: its table."""
    table = driven(crank, crank)
    for one in table["body"].values():
        one.pop("pose", None)
    return table | ({"start": start} if start else {})


def turned(mechanism: Mechanism) -> dict[str, float]:
    """Angle of every body about the world's z [rad]."""
    found = {}
    for link in mechanism.links[1:]:
        for name, place in link.placements.items():
            R = link.start.R @ place.R
            found[name] = float(np.arctan2(R[1, 0], R[0, 0]))
    return found


def other_branch(crank: float) -> tuple[float, float, float]:
    return angles(crank, -1.0)


@pytest.mark.parametrize("crank", [0.9, 2.5, -1.2])
@pytest.mark.parametrize("branch", [angles, other_branch])
@pytest.mark.parametrize("name", ["j1", "j3"])
def test_a_four_bar_follows_from_its_lengths_on_the_branch_that_is_hinted(
    crank: float, branch: Callable[[float], tuple[float, float, float]], name: str
) -> None:
    _, coupler, rocker = branch(crank)
    exact = {"j1": coupler - crank, "j3": rocker}[name]
    # a hint a tenth of a radian off is nearer to its branch than to the other one, which is at least 0.4 away
    mechanism = start_of(loose(crank, joint={name: {"near": exact + 0.1}}))
    found = turned(mechanism)
    for body_name, angle in zip(("crank", "coupler", "rocker"), (crank, coupler, rocker), strict=True):
        # loops are closed to 1e-11 of the mechanism's size
        assert np.exp(1j * found[body_name]) == pytest.approx(np.exp(1j * angle), abs=1e-10)
    assert mechanism.choice == ""


def hanging(**start: Any) -> Mechanism:
    """A driven four-bar without poses, on the branch near a hint, with a body that swings at the coupler's end."""
    table = loose(0.9, joint={"j3": {"near": angles(0.9)[2] + 0.1}, **start})
    table["body"]["bucket"] = rigid(1.0, 1e-3, {"pin": {}})
    table["joint"]["swing"] = joint("revolute", "coupler.far", "bucket.pin")
    return start_of(table)


def test_where_a_free_coordinate_starts_is_reported_unless_the_scene_says_it() -> None:
    """Closing the loop turns coupler and bucket by unequal angles, so that the coordinate leaves zero."""
    mechanism = hanging()
    found = turned(mechanism)
    value = (found["bucket"] - found["coupler"] + np.pi) % (2.0 * np.pi) - np.pi
    assert f"free coordinates start: swing is at {value:.4g} rad; " in mechanism.choice
    assert "[start.joint.swing] position = ..." in mechanism.choice
    assert hanging(swing={"position": 0.3}).choice == ""
    assert hanging(swing={"position": 0.0}).choice == ""
    whole = mechanism.scene
    sought = equilibrium.with_placing_joints(
        whole.model_copy(update={"start": whole.start.model_copy(update={"at": "equilibrium"})})
    )
    assert assemble(build(sought, {})).choice == ""


def test_a_chain_without_poses_starts_at_zero_without_a_word() -> None:
    table = loose(0.9)
    del table["body"]["rocker"], table["joint"]["j2"], table["joint"]["j3"], table["drive"]
    mechanism = start_of(table)
    assert turned(mechanism) == {"crank": 0.0, "coupler": 0.0}
    assert mechanism.choice == ""


def test_of_two_assemblies_one_is_taken_and_both_are_reported() -> None:
    mechanism = start_of(loose(0.9))
    values = [angles(0.9)[2], other_branch(0.9)[2]]
    taken = turned(mechanism)["rocker"]
    assert min(abs(taken - value) for value in values) < 1e-10
    assert "assembled in 2 ways" in mechanism.choice
    for value in values:
        assert f"{value:.4g}" in mechanism.choice  # four digits are printed
    assert "[start.joint.j3] near" in mechanism.choice


def test_hints_that_say_nothing_of_a_loop_leave_its_way_to_the_first_guess_and_not_to_rounding() -> None:
    """A four-bar that is hinted, and a dyad on its coupler, which is not, in a turned world: the same way each time."""
    found = set()
    for seed in range(6):
        table = loose(0.9, joint={"j3": {"near": angles(0.9)[2] + 0.1}})
        table["body"] |= {
            name: rigid(1.0, 1e-3, {"near": {}, "far": frame((length, 0.0, 0.0))})
            for name, length in (("left", 0.35), ("right", 0.4))
        }
        table["joint"] |= {
            "j4": joint("revolute", "coupler.far", "left.near"),
            "j5": joint("revolute", "left.far", "right.far"),
            "j6": joint("revolute", "world.c", "right.near"),
        }
        turn = np.random.default_rng(seed).normal(size=3) if seed else np.zeros(3)
        R, frames = matrix(turn), table["body"]["world"]["frames"] | {"c": frame((0.3, -0.1, 0.0))}
        table["body"]["world"]["frames"] = {n: frame(R @ one["position"], turn) for n, one in frames.items()}
        links = start_of(table).links
        where = {name: R.T @ link.start.p for link in links[1:] for name in link.placements}
        found.add(tuple(np.round(where["right"] - where["left"], 6) + 0.0))
    assert len(found) == 1


def test_a_coordinate_of_an_undriven_loop_places_all_its_bodies() -> None:
    _, coupler, rocker = angles(1.1)
    table = loose(1.1, joint={"j3": {"position": rocker}, "j0": {"near": 1.0}})
    del table["drive"]
    found = turned(start_of(table))
    assert found["crank"] == pytest.approx(1.1, abs=1e-10)
    assert found["coupler"] == pytest.approx(coupler, abs=1e-10)
    assert found["rocker"] == pytest.approx(rocker, abs=1e-10)


def test_joints_that_fit_nowhere_are_refused_without_poses_that_nobody_gave() -> None:
    """Three links of a millimetre close no loop; the first attempt closes all joints but one."""
    table = loose(0.9)
    for name in ("crank", "coupler", "rocker"):
        table["body"][name]["frames"]["far"] = frame((1e-3, 0.0, 0.0))
    with pytest.raises(InputError, match="cannot be assembled by its joints") as caught:
        start_of(table)
    assert "given poses" not in str(caught.value)
    assert str(caught.value).partition("angles): ")[2].partition("\n")[0].count(",") == 0


def test_bodies_that_have_a_pose_stay_where_they_are() -> None:
    table, placed = loose(0.9, joint={"j3": {"near": 1.5}}), driven(0.9, 0.9)
    table["body"]["crank"]["pose"] = placed["body"]["crank"]["pose"]
    mechanism = start_of(table)
    link = mechanism.links[mechanism.link_of["crank"]]
    given = np.array([np.cos(0.9), np.sin(0.9), 0.0])
    assert (link.start.R @ link.placements["crank"].R)[:, 0] == pytest.approx(
        given, abs=1e-15
    )  # rounding of a rotation
    assert turned(mechanism)["rocker"] == pytest.approx(angles(0.9)[2], abs=1e-10)


def test_a_slider_crank_finds_both_ends_of_its_guide() -> None:
    """Place of the slider: r cos a +- sqrt(l^2 - r^2 sin^2 a)."""
    r, l, a = 0.2, 0.5, 0.7
    along = {"axes": {"z": [1, 0, 0], "x": [0, 1, 0]}}
    bodies = {
        "world": {"type": "ground", "frames": {"main": {}, "guide": along}},
        "crank": body((0, 0, 0), frames={"near": {}, "far": frame((r, 0, 0))}),
        "rod": body((0, 0, 0), frames={"near": {}, "far": frame((l, 0, 0))}),
        "slider": body((0, 0, 0), frames={"pin": {}, "guide": along}),
    }
    for name in ("crank", "rod", "slider"):
        del bodies[name]["pose"]
    pairs = {
        "main": ("world.main", "crank.near"), "pin": ("crank.far", "rod.near"), "end": ("rod.far", "slider.pin")
    }  # fmt: skip
    joints = {name: joint("revolute", *pair) for name, pair in pairs.items()}
    joints["guide"] = joint("prismatic", "world.guide", "slider.guide")
    for sign in (1.0, -1.0):
        start = {"joint": {"main": {"position": f"{a} rad"}, "guide": {"near": 0.4 * sign}}}
        mechanism = start_of(scene(bodies, joints, start=start))
        link = mechanism.links[mechanism.link_of["slider"]]
        place = link.start.of(link.placements["slider"]).p + mechanism.origin
        # loops are closed to 1e-11 of the mechanism's size
        assert place == pytest.approx([r * np.cos(a) + sign * np.sqrt(l**2 - (r * np.sin(a)) ** 2), 0, 0], abs=1e-10)


# What is refused ----------------------------------------------------------------------------------------------------


def without_drive(table: Table) -> Table:
    return {key: value for key, value in table.items() if key != "drive"}


REFUSED: dict[str, tuple[Table, tuple[str, ...]]] = {
    "no such joint": (loose(0.9, joint={"j9": {"near": 1.0}}), ("[start.joint.j9", "there is no joint 'j9'")),
    "no such coordinate": (
        loose(0.9, joint={"j1": {"translation": {"near": 1.0}}}),
        ("[start.joint.j1.translation", "has no 'translation'"),
    ),
    "another unit": (
        loose(0.9, joint={"j1": {"near": "3 mm"}}),
        ("[start.joint.j1.near]", "mm"),
    ),
    "nothing said": (loose(0.9, joint={"j1": {}}), ("start.joint.j1", "position, near, velocity")),
    "said twice": (
        loose(0.9, joint={"j1": {"near": 1.0, "position": 1.0}}),
        ("start.joint.j1", "give one of them"),
    ),
    "against a drive": (
        loose(0.9, joint={"j0": {"position": 1.0}}),
        ("[start.joint.j0.position]", "is 1 rad, and by the law of drive 'motor' 0.9 rad"),
    ),
    "against a drive's rate": (
        loose(0.9, joint={"j0": {"velocity": "4 rad/s"}}),
        ("[start.joint.j0.velocity]", "is 4 rad/s, and by the law of drive 'motor' 3 rad/s"),
    ),
    "against a pose": (
        without_drive(driven(0.9, 0.9)) | {"start": {"joint": {"j0": {"position": 1.5}}}},
        ("[start.joint.j0.position]", "0.9 rad in the given poses", "1.5 rad by its own start", "remove the poses"),
    ),
    "out of reach": (
        without_drive(loose(0.9, joint={"j3": {"position": 0.2}})),
        ("[start.joint.j3.position]", "at the given positions", "for example at j3"),
    ),
    "no flexible body": (
        loose(0.9, modal={"crank": {"coordinate": [1.0]}}),
        ("[start.modal.crank]", "no flexible body"),
    ),
    "elsewhere": (loose(0.9, at="rest"), ("start.at", "equilibrium")),
    "deformed twice": (
        loose(0.9, at="equilibrium", modal={"rod": {"coordinate": [1.0]}}),
        ("start", "modal.rod.coordinate both determine the deformation"),
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", REFUSED)
def test_a_start_that_cannot_be_meant_is_refused_before_anything_is_compiled(case: str, tmp_path: Any) -> None:
    table, words = REFUSED[case]
    with pytest.raises(FlexclearError) as error:
        tabulate(build(edited(Scene.model_validate({**table, "start": None}), {"start": table["start"]}), {}))
    assert isinstance(error.value, InputError) or error.value.exit_code == 2
    for word in words:
        assert word in str(error.value)


def test_more_numbers_than_modes_are_refused() -> None:
    path = TREE / "scenes" / "checks" / "clamped_rod.toml"
    made = load_scene(path, {"start": {"modal": {"rod": {"coordinate": [0.0] * 14}}}})
    with pytest.raises(InputError, match=r"\[start.modal.rod.coordinate\]: 14 numbers are given for the 13 modes"):
        tabulate(build(made, bundles(made)))


def test_lengths_that_cannot_meet_where_the_drive_is_are_refused() -> None:
    """With the crank turned away its pin is 0.7 m from the pivot, and coupler and rocker reach 0.55 m."""
    table = loose(np.pi)
    table["body"]["rocker"]["frames"]["far"] = frame((0.15, 0.0, 0.0))
    with pytest.raises(
        InputError, match=r"\[drive.motor.law\]: the joints can be assembled, but not at the positions of the drives"
    ):
        start_of(table)


def test_a_second_drive_out_of_reach_is_distinguished_from_joints_that_do_not_fit() -> None:
    """From the poses given: the rocker's drive begins where the crank's does not let it."""
    table = driven(0.9, 0.9)
    table["drive"]["far"] = {"joint": "j3", "law": angles(0.9)[2] + 0.01}
    with pytest.raises(
        InputError, match=r"\[drive\.\w+\.law\]: the joints can be assembled, but not at the positions of the drives"
    ):
        start_of(table)
