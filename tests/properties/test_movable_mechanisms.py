"""No mechanism that moves is refused: mobility and rank of a family in which they are known by construction."""

from dataclasses import replace

import numpy as np
import pytest

from flexclear.dynamics.model.mechanism import build
from flexclear.dynamics.model.mobility import Mobility, analyse
from flexclear.dynamics.model.model import tabulate
from flexclear.dynamics.model.rates import ZERO_SINGULAR_VALUE, rates
from flexclear.scene.schema import Scene
from flexclear.system.errors import InputError
from tests.properties import movable
from tests.properties.mechanisms import Table
from tests.properties.movable import Joint, Mechanism, Random, Setting
from tests.properties.movable_planar import loop, parallel_cranks, planar
from tests.properties.movable_spatial import X, Z, across, axes, bennett, coaxial
from tests.properties.movable_units import UNITS, seed

EXACT_NUMBERS, ANYHOW = Setting(), "anyhow"


def analysed(table: Table) -> Mobility:
    """Without a kernel: the analysis comes before anything is compiled."""
    return analyse(tabulate(build(Scene.model_validate(table), {})))


def known_mobility(made: Mechanism, random: Random, setting: Setting) -> None:
    found = analysed(movable.scene(made, random, setting))
    assert found.mobility == made.mobility, (made.name, setting)
    assert found.singular_start == "", (made.name, setting)


def several(number: int) -> None:
    """Some units in one mechanism, of sizes that differ by up to a thousand."""
    random = np.random.default_rng([number, 2026])
    names = random.choice(list(UNITS), size=random.integers(2, 6)).tolist()
    made = movable.together(random, [UNITS[name](random) for name in names], decades=random.choice([0.5, 3.0]))
    known_mobility(made, random, movable.any_setting(random))


@pytest.mark.parametrize("name", UNITS)
def test_a_mechanism_moves_as_its_construction_says(name: str) -> None:
    """With the numbers as they are, and turned, moved, scaled and reordered."""
    random = np.random.default_rng(seed(name))
    made = UNITS[name](random)
    known_mobility(made, random, Setting())
    known_mobility(made, random, movable.any_setting(random))


@pytest.mark.parametrize("number", range(30))
def test_mechanisms_that_share_no_loop_add_their_mobilities(number: int) -> None:
    several(number)


@pytest.mark.slow
@pytest.mark.parametrize("name", UNITS)
def test_a_mechanism_moves_whatever_its_dimensions(name: str) -> None:
    for number in range(10):
        random = np.random.default_rng([*seed(name), number])
        known_mobility(UNITS[name](random), random, movable.any_setting(random))


@pytest.mark.slow
@pytest.mark.parametrize("hundred", range(4))
def test_many_more_mechanisms_add_their_mobilities(hundred: int) -> None:
    for number in range(100):
        several(100 * (hundred + 1) + number)


@pytest.mark.parametrize("name", ["revolute and revolute", "four-bar", "Bennett", "plate on nine rods", "Peaucellier"])
def test_zeros_are_far_below_and_the_rest_far_above_the_floor(name: str) -> None:
    """What rounding leaves is measured where it is largest: a thousand sizes away from the origin."""
    random = np.random.default_rng(seed(name))
    setting = replace(movable.any_setting(random), p=(600.0, -500.0, 700.0))
    model = tabulate(build(Scene.model_validate(movable.scene(UNITS[name](random), random, setting)), {}))
    here = rates(model, [link.start for link in model.mechanism.links])
    zeros, others = here.values[here.rank :], here.values[: here.rank]
    # coordinates of a thousand sizes are rounded to 1e-13 of it, in places ten times combined
    assert np.max(zeros, initial=0.0) < 1e-4 * ZERO_SINGULAR_VALUE
    # no dimension of these units is below a tenth of another, and losses multiply
    assert np.min(others, initial=1.0) > 1e3 * ZERO_SINGULAR_VALUE


@pytest.mark.parametrize("number", range(6))
def test_a_singular_pose_is_distinguished_from_redundancy_in_any_orientation(number: int) -> None:
    """Cranks in one line can go on in parallel or against each other; next to that pose the rank is one higher."""
    random = np.random.default_rng(number)
    made = parallel_cranks(random, 2 + number % 2, angle=0.0)
    found = analysed(movable.scene(made, random, movable.any_setting(random)))
    assert found.mobility == 1
    assert "singular pose" in found.singular_start
    assert "nan" not in found.singular_start


def test_a_folded_four_bar_is_singular_in_any_orientation() -> None:
    """Crank and coupler together are as long as ground and rocker: all lie in one line."""
    for number in range(6):
        random = np.random.default_rng(number)
        points = np.array([[0.0, 0.0], [0.2, 0.0], [0.6, 0.0], [0.5 + random.uniform(-0.2, 0.0), 0.0]])
        made = planar(random, "folded", 4, [(0, 1), (1, 2), (2, 3), (3, 0)], points)
        found = analysed(movable.scene(made, random, movable.any_setting(random)))
        assert found.mobility == 1
        assert found.singular_start


def skew_doors() -> list[Mechanism]:
    """Doors that cannot turn: hinges side by side, or at an angle."""
    random = np.random.default_rng(0)
    door = coaxial(random, ["revolute", "revolute"], 0)
    beside = replace(door.joints["hinge1"], p=door.joints["hinge1"].p + np.array([0.2, 0.0, 0.0]))
    askew = replace(door.joints["hinge1"], R=axes(Z + 0.3 * X))
    return [replace(door, joints={**door.joints, "hinge1": other}) for other in (beside, askew)]


@pytest.mark.parametrize("made", skew_doors(), ids=["side by side", "at an angle"])
def test_what_cannot_move_is_still_locked(made: Mechanism) -> None:
    for number in range(5):
        random = np.random.default_rng(number)
        with pytest.raises(InputError, match="locked") as caught:
            analysed(movable.scene(made, random, movable.any_setting(random)))
        assert "natural size" not in caught.value.problem
        assert "remove a joint" in str(caught.value.remedy)


def test_hinges_that_hardly_miss_each_other_are_reported() -> None:
    """Six digits of an axis: the door is locked by 1e-5 of its size, which is hardly meant."""
    random = np.random.default_rng(3)
    door = coaxial(random, ["revolute", "revolute"], 0)
    off = replace(door.joints["hinge1"], R=axes(Z + 1e-5 * X))
    with pytest.raises(InputError, match="locked") as caught:
        analysed(movable.scene(replace(door, joints={**door.joints, "hinge1": off}), random, Setting()))
    assert "1e-05 of its natural size" in caught.value.problem
    assert "digits" in str(caught.value.remedy)


@pytest.mark.parametrize("digits", [9, 10, 12])
def test_axes_written_with_nine_digits_turn_together(digits: int) -> None:
    """A door on an oblique axis, its frames rounded as a user writes them, on both sides alike."""
    random = np.random.default_rng(digits)
    setting = Setting(R=movable.any_turn(random))
    table = movable.scene(coaxial(random, ["revolute", "revolute"], 1), random, setting)
    for body in table["body"].values():
        for frame in body["frames"].values():
            frame["position"] = np.round(frame["position"], digits).tolist()
            frame["axes"] = {k: np.round(v, digits).tolist() for k, v in frame["axes"].items()}
    assert analysed(table).mobility == 1


def test_loops_that_almost_close_are_reported_with_what_is_missing() -> None:
    """Bennett's linkage to seven digits cannot be assembled: the message says that digits are missing."""
    random = np.random.default_rng(1)
    table = movable.scene(bennett(random), random, Setting())
    for body in table["body"].values():
        for frame in body["frames"].values():
            frame["position"] = np.round(frame["position"], 7).tolist()
            frame["axes"] = {k: np.round(v, 7).tolist() for k, v in frame["axes"].items()}
    table["body"]["link2"]["frames"]["hinge2_a"]["position"][0] += 1e-6
    with pytest.raises(InputError, match="cannot be assembled") as caught:
        analysed(table)
    assert "nearly" in caught.value.problem
    assert "digits" in str(caught.value.remedy)


def test_drives_that_redundant_loops_tie_are_still_refused() -> None:
    """Two of three parallel cranks, each with a drive of its own."""
    for number in range(4):
        random = np.random.default_rng(number)
        table = movable.scene(parallel_cranks(random, 3), random, replace(movable.any_setting(random), shuffled=False))
        law = {"type": "polynomial", "coefficients": [0.0, 1.0]}
        table["drive"] = {"one": {"joint": "pin0", "law": law}, "other": {"joint": "pin1", "law": law}}
        with pytest.raises(InputError, match="over-driven"):
            analysed(table)


def test_a_small_part_of_a_large_machine_keeps_its_own_scale() -> None:
    """A four-bar of 0.1 mm next to one of 10 m, and one on a body of the other."""
    random = np.random.default_rng(0)
    large = loop(random, "four-bar")
    for base in (movable.WORLD, "link1"):
        small = movable.placed(
            loop(random, "four-bar"), "s_", base, 1e-5, movable.any_turn(random), np.array([1.0, 2, 3])
        )
        both = Mechanism("two", large.bodies | small.bodies, large.joints | small.joints, 2)
        known_mobility(both, random, Setting(10.0, own_frames=True))


def test_a_body_held_at_its_centre_of_mass_has_its_gyration_for_a_size() -> None:
    """All its frames are in one place, of which rounding leaves 1e-17 m: no length to compare with."""
    random = np.random.default_rng(0)
    turn = movable.any_turn(random)
    joints = {k: Joint("spherical", movable.WORLD, "top", np.zeros(3), axes(across(random))) for k in ("one",)}
    made = Mechanism("top", {"top": np.zeros(3)}, joints, 3)
    for size in (1e-9, 1.0, 1e3):
        setting = Setting(size, turn, (0.3, 0.2, 0.1), own_frames=True)
        table = movable.scene(made, random, setting)
        assert analysed(table).mobility == 3
        length = build(Scene.model_validate(table), {}).length
        # radius of gyration of 0.04, 0.06, 0.07 per unit of mass and size
        assert length == pytest.approx(size * np.sqrt(0.085), rel=1e-9)
