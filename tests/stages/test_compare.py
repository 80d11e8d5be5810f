"""Ideal twins, rigid bodies from recipes, and runs next to each other."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from flexclear.commands.new import write
from flexclear.post import pages
from flexclear.post.overview import comparison, curves, figures
from flexclear.scene.load import edited, load_scene
from flexclear.scene.parts import MeshedRigidBody
from flexclear.scene.quantity import Quantity
from flexclear.scene.variants import ideal_scene
from flexclear.stages import simulation
from flexclear.stages.graph import Graph
from flexclear.stages.workplace import open_workplace
from flexclear.structure.fe.recipe import read_recipe
from flexclear.structure.kinds import kind
from flexclear.structure.modes import bundle
from flexclear.study import compare
from flexclear.system.errors import InputError
from tests.paper import synthetic


@pytest.fixture
def crank(tmp_path: Path) -> Path:
    return write("slider-crank", tmp_path)[0]


def test_a_rigid_body_from_a_recipe_has_mass_and_inertia_of_the_bar(tmp_path: Path):
    """A uniform bar: m = rho A l, m l^2/12 across; about its length and through its depth as closed form."""
    _, recipe = write("slider-crank", tmp_path)
    found = bundle.rigid(kind.build(read_recipe(recipe)))
    length, b, h, density = 0.2, 0.012, 0.008, 7850.0
    mass = density * b * h * length
    # integrals over a beam of constant section are exact but for rounding, some 1e-15
    assert float(found["mass"]) == pytest.approx(mass, rel=1e-12)
    np.testing.assert_allclose(found["com"], [length / 2, 0, 0], atol=1e-13)
    expected = mass / 12.0 * np.array([b**2 + h**2, length**2 + h**2, length**2 + b**2])
    np.testing.assert_allclose(np.diag(found["inertia"]), expected, rtol=1e-10)


def test_no_modes_make_a_rigid_body_and_so_does_the_recipe_alone(crank: Path):
    none = load_scene(crank, {"body.rod.modes.count": 0, "output.stress": None})
    alone = edited(none, {"body.rod": {"type": "rigid", "mesh": str(crank.parent / "rod.toml")}})
    for scene in (none, alone):
        assert isinstance(scene.body["rod"], MeshedRigidBody)
        assert not scene.flexible()
        graph = Graph(scene, shown=False)
        assert set(graph.bodies()) == {"rigid/rod"}
        assert not graph.modes
    pose = {"position": [0.05, 0, 0]}
    table = {"rod": {"type": "rigid", "mesh": "rod.toml", "pose": pose}}
    data = bundle.rigid(kind.build(read_recipe(crank.parent / "rod.toml")))
    filled = simulation.fill_in_recipes(table, {"rigid/rod": data})["rod"]
    assert filled["mass"] == float(data["mass"])
    assert set(filled["frames"]) == {"big_end", "middle", "small_end"}
    assert filled["pose"] == pose
    assert "mesh" not in filled


def test_a_twin_differs_in_the_effect_alone(crank: Path):
    scene = load_scene(crank)
    without = ideal_scene(scene, ("clearance",))
    assert without.joint["pin"].type == "revolute"
    assert without.joint["pin"].between == scene.joint["pin"].between
    assert without.body == scene.body
    stiff = ideal_scene(scene, ("flexibility",))
    assert stiff.joint == scene.joint
    assert stiff.body["rod"].pose == scene.body["rod"].pose
    both = ideal_scene(scene)
    assert not both.contacts()
    assert not both.flexible()
    assert {q.name for q in both.watched_quantities()} == {"slider.position", "slider.velocity", "motor.drive_force"}
    assert (both.time, both.drive, both.load) == (scene.time, scene.drive, scene.load)


def test_what_is_ideal_has_no_twin(tmp_path: Path):
    scene = load_scene(write("pendulum", tmp_path)[0])
    with pytest.raises(InputError, match="that can be removed"):
        ideal_scene(scene)
    with pytest.raises(InputError, match="a single scene has no other to compare with"):
        compare.compare_scenes([scene], open_workplace())


def test_each_twin_is_made_once(crank: Path, tmp_path: Path):
    names = [twin.name for twin in compare.ideal_scenes(load_scene(crank), "each")]
    assert names == ["slider_crank ideal", "slider_crank without clearance", "slider_crank rigid"]
    rigid_only = load_scene(write("four-bar", tmp_path / "other")[0])
    assert [twin.name for twin in compare.ideal_scenes(rigid_only, "each")] == ["four_bar ideal"]


def pair() -> dict[str, xr.Dataset]:
    """Two runs whose platforms are 1 mm apart in z from the second output on."""
    other = synthetic.run("sps4/csj", clearance=True)
    reference = other.drop_dims([dim for dim in ("contact", "event") if dim in other.dims])
    reference["position"] = other["position"].copy()
    reference["position"][1:, :, 2] -= 1e-3
    return {"ideal": reference, "loose": other}


QUANTITIES = (Quantity("platform", "position"), Quantity("platform", "velocity"), Quantity("A1", "peak_force"))


def test_differences_are_those_of_the_runs():
    runs = pair()
    found = comparison.assemble(runs, {"loose": runs["loose"]}, QUANTITIES)
    position = found.sel(quantity="platform.position")
    assert float(position["difference"].sel(run="loose")) == pytest.approx(1e-3, rel=1e-9)
    assert float(position["difference"].sel(run="ideal")) == 0.0
    assert float(position["error"].sel(run="loose")) == 0.0
    assert np.isnan(position["error"].sel(run="ideal"))
    assert np.isnan(found["largest"].sel(run="ideal", quantity="A1.peak_force"))
    np.testing.assert_allclose(position["distance"].sel(run="loose")[1:], 1e-3, rtol=1e-9)
    rows = {(row[0], row[1]): row for row in comparison.table(found).rows}
    assert rows["platform.position", "ideal"][4] == "reference"
    assert rows["platform.position", "loose"][4] == "1 mm"
    assert rows["A1.peak_force", "ideal"][2] == "–"


@pytest.mark.parametrize(
    "value, error, written",
    [
        (98.4812e-3, 70e-3, "98 ± 70 mm"),
        (1.1044e-4, 2.01e-5, "110 ± 20 µm"),
        (12.34567, 0.0123, "12.346 ± 0.012 m"),
        (244.5e-6, 250e-6, "240 ± 250 µm"),  # two digits of the error, no exponent next to a prefix
        (1.35906e-6, 4.9e-10, "1.35906 ± 0.00049 µm"),
        (110e-9, 20e-6, "0 ± 20 µm"),  # the unit of what is larger
        (48.82e-6, 2e-11, "48.82 µm"),  # an error below the fourth digit, and none
        (1e-3, 0.0, "1 mm"),
        (1e-3, np.nan, "1 mm"),  # an unknown error is not printed
    ],
)
def test_a_value_is_written_to_the_second_digit_of_its_error(value: float, error: float, written: str):
    assert curves.format_with_error(value, error, "m") == written
    assert curves.format_with_error(-value, error, "m") == f"-{written}"


def test_numbers_have_an_exponent_only_where_they_need_one():
    assert [curves.format_to_digits(v, 2) for v in (280.0, 99.96, 0.28, 2.1e-9, 3.14e8)] == [
        "280",
        "100",
        "0.28",
        "2.1e-09",
        "3.1e+08",
    ]


def test_a_peak_between_output_times_counts_as_a_difference():
    """One run has a row of its own, at an impact: velocities differ there although no common time shows it."""
    runs = pair()
    loose = runs["loose"]
    between = loose.isel(time=[1]).assign_coords(time=loose["time"].values[[1]] + 1e-5)
    between["velocity"] = between["velocity"] + 7.0
    runs["loose"] = xr.concat([loose, between], "time", data_vars="minimal").sortby("time")
    found = comparison.assemble(runs, {}, QUANTITIES).sel(run="loose", quantity="platform.velocity")
    reference = float(
        comparison.assemble(runs, {}, QUANTITIES)["largest"].sel(run="ideal", quantity="platform.velocity")
    )
    assert float(found["largest"]) > reference + 5.0
    assert float(found["difference"]) == pytest.approx(float(found["largest"]) - reference, rel=1e-12)


def test_runs_without_a_common_time_are_refused():
    runs = pair()
    late = runs["loose"].assign_coords(time=runs["loose"]["time"] + 3e-5)
    with pytest.raises(InputError, match="no output times in common"):
        comparison.assemble({**runs, "loose": late}, {}, QUANTITIES)


def test_figures_of_any_run_and_a_page_with_all_inside():
    runs = pair()
    files = figures.make(runs["loose"], QUANTITIES)
    assert {"motion.png", "reactions.png", "contacts.png", "energy.png"} <= set(files)
    beside = comparison.make("compare", runs, QUANTITIES)
    assert "compare.png" in beside
    part = pages.Part("a", "A", pages.media("compare.png", beside["compare.png"], "side by side"))
    text = pages.page("Title", "lead", [part, pages.Part("b", "Empty", "")]).decode()
    assert "data:image/png;base64," in text
    assert "src='http" not in text
    assert "Empty" not in text


@pytest.mark.parametrize(
    "value, unit, expected",
    [(0.02, "m", (1e3, "mm")), (3e-6, "m", (1e6, "µm")), (0.0, "m", (1.0, "m")), (2500.0, "N", (1e-3, "kN"))],
)
def test_units_read_well(value: float, unit: str, expected: tuple[float, str]):
    assert curves.readable_unit(value, unit) == expected
