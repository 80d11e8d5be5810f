"""Wear over many cycles: Archard's closed forms, steps by their error, resumption, and wrong input in words."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from scipy.optimize import brentq

import flexclear as fc
from flexclear import dynamics
from flexclear.scene.load import edited, load_scene
from flexclear.scene.schema import Scene
from flexclear.stages.workplace import Workplace, open_workplace
from flexclear.study.wear import Study, Wearing, initial_depths, spread_over_arcs, wear_surfaces
from flexclear.system.errors import InputError
from flexclear.system.progress import silent
from tests.analytic.mechanism_runs import TREE
from tests.analytic.test_contact_surfaces import CLEARANCE, LENGTH, RADIUS, WAY, WEAR, WEIGHT, frame, hanging, simulate

#: depth that a cycle of the hanging carrier takes from the pin, which wears alone, all around [m]
PER_CYCLE = WEAR["coefficient"] * WEIGHT * WAY / WEAR["hardness"] / (2.0 * np.pi * RADIUS * LENGTH)


def scene(**more: Any) -> Scene:
    table = hanging()
    table["joint"]["hole"]["wear"] = WEAR | more
    return Scene.model_validate(table)


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Workplace:
    monkeypatch.setenv("FLEXCLEAR_RESULTS", str(tmp_path / "results"))
    return open_workplace()


class OneSided(Study):
    """A study whose runs do the same work each, in one direction of the journal at a small penetration."""

    runs, penetration = 0, 1e-7

    def _run_worn(self, cycles: float, depths: dict[str, np.ndarray]) -> Wearing:
        type(self).runs += 1
        work = np.zeros((1, 4 * depths["hole"].shape[2]))
        work[0, 3 * work.shape[1] // 4 :][:2] = 0.5  # on either side of a line between two sectors
        rates = np.zeros_like(depths["hole"])
        rates[0] = 1e-9 * spread_over_arcs(work, depths["hole"][0], CLEARANCE, self.penetration)
        return Wearing(cycles, depths, 0.0, None, {"hole": rates})  # type: ignore[arg-type]


def lens(area: float) -> float:
    """Depth of a groove that a circle presses into one of the radius 1 larger by c, by the area of the overlap."""

    def missing(depth: float) -> float:
        half = np.arccos(CLEARANCE / (CLEARANCE + depth))
        return 2.0 * (CLEARANCE + depth) * np.sin(half) - 2.0 * CLEARANCE * half - area

    return float(brentq(missing, 1e-12, 1e-2))


@pytest.mark.parametrize("sectors", [36, 72])
def test_a_pin_that_stays_at_one_side_wears_a_groove_of_its_own_shape(sectors: int) -> None:
    """The volume grows with the cycles (Archard 1953); the groove is what the pin's circle takes from the journal's.

    So its depth grows as cycles to the power 2/3 at first, and its wear per cycle falls.
    """
    study = OneSided(scene(sectors=sectors, outer_share=1.0), None, tolerance=0.02)  # type: ignore[arg-type]
    sector = 2.0 * np.pi / sectors
    cycles = 0.35 * CLEARANCE / sector / 1e-9
    study.wear_until(cycles)
    groove = study.steps[-1].depths["hole"][0, 0]
    assert groove.sum() == pytest.approx(1e-9 * cycles, rel=1e-12)
    depth = lens(1e-9 * cycles * sector)
    # of the same volume; the arc of overlap is known to a sector
    half = np.arccos(CLEARANCE / (CLEARANCE + depth))
    assert groove.max() == pytest.approx(depth, rel=sector / half)
    angle = (np.arange(sectors) + 0.5) * sector - 1.5 * np.pi
    shape = np.maximum(0.0, (CLEARANCE + depth) * np.cos(angle) - CLEARANCE)
    edge = (CLEARANCE + depth) * np.sin(half) * sector  # by which the shape changes in a sector, at most
    assert np.abs(groove - shape).max() < 1.5 * edge
    deepening = [one.rates["hole"][0].max() for one in study.steps]
    assert deepening[-1] < 0.5 * deepening[0]


class Easing(Study):
    """Everywhere the depth h grows by r (1 - h/H) per cycle, so that h = H (1 - exp(-r N/H))."""

    rate, deepest = 1e-9, 2.0 * CLEARANCE

    def _run_worn(self, cycles: float, depths: dict[str, np.ndarray]) -> Wearing:
        rates = {name: self.rate * (1.0 - depth / self.deepest) for name, depth in depths.items()}
        return Wearing(cycles, depths, 0.0, None, rates)  # type: ignore[arg-type]


def test_steps_are_those_of_adams_and_bashforth_with_the_trapezoidal_rule_as_their_error() -> None:
    study = Easing(scene(outer_share=0.5), None, tolerance=1e-4)  # type: ignore[arg-type]
    study.wear_until(1e5)
    at = np.array([one.cycles for one in study.steps])
    h, r = (np.array([kind(one)[0, 0, 0] for one in study.steps]) for kind in
            (lambda one: one.depths["hole"], lambda one: one.rates["hole"]))  # fmt: skip
    step, before = at[2:] - at[1:-1], at[1:-1] - at[:-2]
    assert h[2:] == pytest.approx(h[1:-1] + step * (r[1:-1] - 0.5 * step / before * (r[:-2] - r[1:-1])), rel=1e-9)
    errors = np.abs(0.5 * np.diff(at) * (r[1:] + r[:-1]) - np.diff(h)) / CLEARANCE
    assert [one.error for one in study.steps[1:]] == pytest.approx(errors, rel=1e-6, abs=1e-12)
    exact = Easing.deepest * (1.0 - np.exp(-Easing.rate * at / Easing.deepest))
    # no step errs by more than its tolerance
    assert np.abs(h - exact).max() < 1e-4 * CLEARANCE * len(at)


def test_errors_of_the_steps_fall_with_the_tolerance_and_volumes_stay() -> None:
    found = []
    for tolerance in (0.04, 0.01):
        study = OneSided(scene(outer_share=1.0), None, tolerance=tolerance)  # type: ignore[arg-type]
        study.wear_until(1e5)
        assert all(one.error <= tolerance for one in study.steps)
        assert [one.cycles for one in study.steps] == sorted(one.cycles for one in study.steps)
        found.append(len(study.steps))
    assert found[1] > found[0]


def test_a_pin_that_turns_wears_all_around_in_proportion_to_the_cycles(place: Workplace) -> None:
    """Depth = k F s/(H A) per cycle: Dickrell & Sawyer (2004), Evolution of wear in a two-dimensional bushing.

    The force is the weight whatever the clearance; the speed at the surface falls with the radius.
    """
    cycles = 0.3 * CLEARANCE / PER_CYCLE
    made = wear_surfaces(scene(outer_share=0.0), place, cycles, tolerance=0.05).dataset()
    depth = made["depth_inner"].values[-1, 0, 0]
    fell = 0.3 * CLEARANCE / RADIUS
    # rows 1/36 of a turn apart spread the work unevenly over sectors by one in 16 pieces of a row's step
    assert depth.mean() == pytest.approx(0.3 * CLEARANCE, rel=10.0 * fell)
    assert depth == pytest.approx(depth.mean(), rel=0.2)
    assert not made["depth_outer"].any()
    assert made["worn_clearance"].values[-1, 0] == pytest.approx(CLEARANCE + depth.mean(), rel=1e-9)
    assert made["cycles"].values[-1] == cycles
    assert made.sizes["step"] >= 4  # steps of at most a tenth of the clearance
    assert (place.store.root / "wear").is_dir()

    # again, and from its own file: nothing runs, and the surfaces are those of the last step
    ran = len(list(place.store.root.rglob("*.nc")))
    again = wear_surfaces(scene(outer_share=0.0), place, cycles, tolerance=0.05)
    assert again.dataset().identical(made)
    assert len(list(place.store.root.rglob("*.nc"))) == ran
    went_on = scene(outer_share=0.0, profile=str(again.folder / "wear.nc"))
    assert initial_depths(went_on.joint["hole"], "hole") == pytest.approx(
        np.stack([made["depth_outer"].values[-1, 0], made["depth_inner"].values[-1, 0]]), rel=0.0
    )


@pytest.mark.slow
def test_a_crank_pin_wears_its_journal_where_the_rod_pushes_and_pulls(place: Workplace) -> None:
    """As Flores (2009), Mechanism and Machine Theory 44, 1211-1222, finds: wear is not uniform around the journal.

    Depths per cycle fall as the grooves widen (a constant volume over more area), and forces grow with the gap.
    """
    scene = load_scene(TREE / "scenes" / "gallery" / "worn_crank.toml")
    made = wear_surfaces(scene, place, 2e5, tolerance=0.04).dataset().sel(worn="pin")
    last, rates = made["depth_outer"].values[-1, 0], made["rate_outer"].values[:, 0].max(axis=1)
    deep = np.flatnonzero(last > 0.5 * last.max())
    angles = 10.0 * deep + 5.0
    # along the rod, x of its frame: two grooves, apart from each other
    assert np.all(np.abs((angles + 90.0) % 180.0 - 90.0) < 60.0)
    assert last.min() < 0.2 * last.max()
    assert rates[-1] < 0.8 * rates[0]
    assert made["peak_force"].values[-1] > made["peak_force"].values[0]
    volume = made["run_volume"].values
    area = 2.0 * np.pi * (0.01 + 1e-4) * 0.02
    # the volumes of the runs differ by 2 %, between which the steps interpolate
    assert last.mean() * area == pytest.approx(2e5 * volume.mean(), rel=0.05)


@pytest.mark.parametrize(
    "changes, words",
    [
        ({"cycles": 0.0}, "--cycles 0: must be above zero"),
        ({"cycles": 1.0, "tolerance": -1.0}, "--tolerance -1: must be above zero"),
        ({"cycles": 1.0, "per_run": float("nan")}, "--per-run nan: must be above zero"),
    ],
)
def test_numbers_that_are_not_above_zero_are_refused(changes: dict, words: str) -> None:
    with pytest.raises(InputError, match=words):
        wear_surfaces(scene(), None, **changes)  # type: ignore[arg-type]


def test_a_scene_without_wear_is_refused() -> None:
    table = hanging()
    del table["joint"]["hole"]["wear"]
    with pytest.raises(InputError, match="no joint has wear"):
        wear_surfaces(Scene.model_validate(table), None, 1.0)  # type: ignore[arg-type]


def worn(shape: tuple[int, int], radius: float, clearance: float, height: float) -> dict[str, Any]:
    """Waves around both surfaces; with no height the depths are constant."""
    angle = 2.0 * np.pi * (np.arange(shape[1]) + 0.5) / shape[1]
    outer, inner = (
        np.tile(depth * (1.0 + height * wave), (shape[0], 1)).tolist()
        for depth, wave in ((1e-5, np.cos(3.0 * angle)), (2e-5, np.sin(2.0 * angle)))
    )
    return {"radii": [radius + clearance, radius], "outer": outer, "inner": inner}


def pin_on_waves() -> Scene:
    """The carrier drops onto the turning shaft, rebounds and rubs."""
    table = hanging()
    table["body"]["carrier"]["pose"] = frame((0.0, 0.0, -0.8 * CLEARANCE))
    del table["joint"]["hole"]["initial_approach_speed"]
    table["joint"]["hole"] |= {
        "normal": {"law": "flores", "restitution": 0.7, "stiffness": 1e9},
        "friction": {"law": "ambrosio", "dynamic": 0.1, "v0": 1e-4, "v1": 1e-3},
        "wear": WEAR | {"shapes": {"hole": worn((1, 36), RADIUS, CLEARANCE, 0.5)}},
    }
    return Scene.model_validate(table)


def ball_on_waves() -> Scene:
    given = load_scene(TREE / "scenes" / "checks" / "socket_swing.toml", {"time.end": "20 ms", "output.horizon": False})
    wear = {"coefficient": 1e-4, "hardness": 2e9, "shapes": {"contact": worn((18, 36), 0.02, 5e-4, 0.5)}}
    changes = {"joint.contact.wear": wear, "body.ball.angular_velocity": [3.0, 5.0, 20.0]}
    friction = {"law": "ambrosio", "dynamic": 0.1, "v0": 1e-4, "v1": 1e-3}
    return edited(given, {**changes, "joint.contact.friction": friction})


@pytest.mark.parametrize("made", [pin_on_waves, ball_on_waves])
def test_the_ledger_closes_on_worn_surfaces(made: Callable[[], Scene]) -> None:
    """Forces and moments do the work that gap and energies say; the gap's slopes are up to a tenth here."""
    run = dynamics.simulate(made(), {}, silent)
    assert run["contact_normal_force"].values.max() > 0.0
    assert float(np.abs(run["energy_error"]).max()) < 1e-8 * float(run.attrs["exchanged_energy"])


def test_constant_depths_give_the_round_joint_with_more_clearance() -> None:
    more = CLEARANCE + 3e-5
    tables = [hanging(), hanging()]
    for table in tables:
        table["body"]["carrier"]["pose"] = frame((0.0, 0.0, -more - WEIGHT / 1e6))
    tables[0]["joint"]["hole"]["clearance"] = more
    tables[1]["joint"]["hole"]["wear"] = WEAR | {"shapes": {"hole": worn((1, 36), RADIUS, CLEARANCE, 0.0)}}
    round_, shaped = (simulate(table) for table in tables)
    every = np.linspace(0.0, 0.25, 73)
    for name, size in (("contact_gap", 1e-4), ("contact_normal_force", WEIGHT), ("position", 1e-4)):
        one, other = (run[name].interp(time=every).values for run in (round_, shaped))
        # the motion is at rest to the rounding of the start, which the tolerance of 1e-10 may keep
        assert other == pytest.approx(one, abs=1e-9 * size)
    # the worn pin is thinner by 20 um, which shortens the way
    way = [float(run["wear_sliding_distance"].values[-1, 0]) for run in (round_, shaped)]
    assert way[1] == pytest.approx(way[0] * (1.0 - 2e-5 / RADIUS), rel=1e-8)


def profile_of(radius: float, name: str = "hole", law: dict[str, Any] | None = None) -> dict[str, Any]:
    table = hanging()
    shapes = {"radii": [radius + CLEARANCE, radius], "outer": [[1e-5] * 36], "inner": [[0.0] * 36]}
    table["joint"]["hole"]["wear"] = WEAR | {"profile": "worn.nc", "shapes": {name: shapes}}
    return table | ({"joint": table["joint"] | {"hole": table["joint"]["hole"] | {"friction": law}}} if law else {})


LUGRE = {"law": "lugre", "static": 0.1, "dynamic": 0.08, "v_stribeck": 0.01, "bristle_stiffness": 1e5}


@pytest.mark.parametrize(
    "table, words",
    [
        (profile_of(0.02), "for a journal with a radius of 0.0201 m; this one has 0.0101 m"),
        (profile_of(RADIUS, "pin"), "worn.nc has no joint 'hole'"),
        (profile_of(RADIUS, law=LUGRE), "the bristles of 'lugre' are of round surfaces"),
    ],
)
def test_a_profile_of_another_joint_is_refused(table: dict[str, Any], words: str) -> None:
    with pytest.raises(InputError, match=words):
        fc.run(Scene.model_validate(table))


def test_a_file_that_is_no_profile_is_refused(tmp_path: Path) -> None:
    xr.Dataset({"depth": ("x", [1.0])}).to_netcdf(tmp_path / "other.nc")
    (tmp_path / "text.nc").write_text("no numbers")
    for name, words in (("other.nc", "no profile of worn"), ("text.nc", "cannot be read"), ("none.nc", "there is no")):
        with pytest.raises(ValueError, match=words):
            scene(profile=str(tmp_path / name))
