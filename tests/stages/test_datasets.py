"""Datasets tell what they hold: units that UDUNITS reads, names for all entries; the recipes of docs run."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import pytest
import xarray as xr

import flexclear as fc
from benchmarks.site import keys
from benchmarks.site import reference as datasets
from benchmarks.site.__main__ import stale
from flexclear.artifacts.coordinates import COORDINATES
from flexclear.artifacts.store import write_dataset
from flexclear.commands.__main__ import main
from flexclear.commands.new import write
from flexclear.dynamics import simulate
from flexclear.post.single_run.series import derive
from flexclear.scene.load import load_scene
from flexclear.system.errors import InputError, ResourceError, SolverError, error_of
from flexclear.system.progress import silent
from flexclear.workflow import cores

#: symbols of UDUNITS-2 that datasets use; a product of them, each with an integer exponent, is a unit
SYMBOLS = ("kg", "m", "s", "N", "Pa", "J", "W", "Hz", "rad")
#: dimensions whose entries have coordinates of other names, or an index in a matrix alone
WITHOUT_INDEX = {"event", "impact", "singular_pass"}


def is_udunits(text: str) -> bool:
    """Whether UDUNITS-2 reads a text: "1", or symbols with exponents such as ``kg m2 s-1``; no fractions, no words."""
    tokens = [re.fullmatch(r"([A-Za-z]+)(-?[1-9])?", token) for token in text.split(" ")]
    return text == "1" or all(token is not None and token[1] in SYMBOLS for token in tokens)


SCHEMAS = {**datasets.DATASETS, **datasets.STRUCTURE, "coordinates": ("", COORDINATES)}


@pytest.mark.parametrize("name", SCHEMAS)
def test_every_unit_is_one_that_udunits_reads(name: str) -> None:
    _, schema = SCHEMAS[name]
    units = {unit for v in schema.values() for unit in (v.units, v.turning) if unit}
    assert {unit for unit in units if not is_udunits(unit)} == set()


def test_texts_that_udunits_does_not_read_are_recognised() -> None:
    assert not any(is_udunits(text) for text in ("kg0.5 m", "m or rad", "N or N m", "sqrt(kg)", "", "m^2"))


def test_pages_are_what_the_sources_say() -> None:
    assert list(stale()) == []


@pytest.mark.parametrize("kind", keys.HEADS)
def test_every_key_has_a_meaning(kind: str) -> None:
    """In words of its own, next to the name of its unit."""
    rows = re.findall(r"^- `(\w+)` \(.*?\): ?(.*)$", keys.page(kind), re.MULTILINE)
    assert len(rows) > 15
    assert [key for key, meaning in rows if not meaning.strip()] == []


@pytest.fixture(scope="module")
def crank(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A folder with results of the beginning of the slider-crank that `flexclear new` writes."""
    folder = tmp_path_factory.mktemp("crank")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        patch.setenv("FLEXCLEAR_RESULTS", str(folder / "results"))
        patch.setattr(cores, "count_cores", lambda: 1)  # other processes take seconds to start
        scene, _ = write("slider-crank", folder)
        scene.write_text(scene.read_text().replace('end = "0.13 s"', 'end = "25 ms"'))
        assert main(["run", "-q", str(scene)]) == 0
        yield folder


def test_ten_recipes_and_more_run_in_their_order(crank: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(crank)
    mpl.use("Agg")
    names: dict[str, Any] = {}
    recipes = sorted(datasets.RECIPES.glob("*.py"))
    assert len(recipes) >= 10
    for path in recipes:
        exec(compile(path.read_text(), path.name, "exec"), names)
    assert names["x"].dims == ("time",)
    assert len(names["x"]) > 50
    assert names["table"]["impact_peak_force"].is_monotonic_decreasing
    assert {"reactions.png", "slider.csv", "forces.mat", "first.nc"} <= {path.name for path in crank.iterdir()}


def test_entries_have_names_and_datasets_say_what_made_them(crank: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(crank)
    tree = fc.open("slider_crank")
    for part in ("run", "post", "bundle/rod", "modes/rod", "mesh/rod"):
        dataset = tree[part].to_dataset()
        nameless = {dim for dim in dataset.dims if dim not in dataset.coords} - WITHOUT_INDEX - {"unknown"}
        assert nameless == set(), part
        assert dataset.attrs["title"]
        assert dataset.attrs["source"] == f"flexclear {fc.__version__}"
        assert not re.search(r"20\d\d-\d\d-\d\d|\d\d:\d\d:\d\d", " ".join(map(str, dataset.attrs.values())))
    run = tree["run"].to_dataset()
    assert "Flores" in run.attrs["references"]  # the contact law that the scene names
    assert {"event_time", "event_contact", "event_kind"} <= set(run.coords)
    assert set(run["event_contact"].values) == {"pin"}
    assert run["modal_coordinate"].sel(mode="rod.3")["mode_number"] == 3
    assert run["joint_second_body"].sel(joint="wrist") == "slider"


def test_run_and_post_have_the_same_entries_under_the_same_names(crank: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(crank)
    tree = fc.open("slider_crank")
    run, post = tree["run"].to_dataset(), tree["post"].to_dataset()
    both = xr.merge([run, post], join="exact", compat="identical", combine_attrs="drop")
    assert set(both.data_vars) == set(run.data_vars) | set(post.data_vars)


def test_extremes_are_the_largest_values_at_their_times(crank: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(crank)
    tree = fc.open("slider_crank")
    run, post = tree["run"].to_dataset(), tree["post"].to_dataset()
    series = {
        "reaction": post["reaction"],
        "acceleration": abs(run["acceleration"]),
        "drive_force": abs(run["drive_force"]),
        "penetration": run["contact_penetration"],
    }
    for name, values in series.items():
        assert (values.max("time") == post[f"peak_{name}"]).all(), name
        assert (values.sel(time=post[f"peak_{name}_time"]) == post[f"peak_{name}"]).all(), name
    located = run["contact_normal_force"].sel(time=post["peak_force_time"])
    # a row lies at the deepest point, which damping lets come a little after the largest force: found 2e-3
    assert located.values == pytest.approx(post["peak_force"].values, rel=2e-2)


def test_units_are_those_of_each_entry_where_some_slide_and_others_turn(root: Path) -> None:
    run = simulate(load_scene(root / "scenes" / "checks" / "stops.toml", {"time.end": 0.01}), {}, silent)
    turns = run["contact_motion"].values == "rotation"
    assert 0 < turns.sum() < len(turns)
    assert "units" not in run["contact_gap"].attrs
    assert run["contact_gap_units"].values.tolist() == np.where(turns, "rad", "m").tolist()
    assert run["contact_force_units"].values.tolist() == np.where(turns, "N m", "N").tolist()
    assert derive(run)["clearance_units"].values.tolist() == np.where(turns, "rad", "m").tolist()
    alike = simulate(load_scene(root / "scenes" / "checks" / "pendulum.toml", {"time.end": 0.01}), {}, silent)
    assert alike["joint_position"].attrs["units"] == "rad"
    assert "joint_position_units" not in alike.coords


def test_a_dataset_is_opened_by_its_path(root: Path, tmp_path: Path) -> None:
    """Read by a child process, as files of others are, to the same values and names; anything else is refused."""
    run = simulate(load_scene(root / "scenes" / "checks" / "pendulum.toml", {"time.end": 0.01}), {}, silent)
    write_dataset(tmp_path / "mine.nc", run)
    for path in (tmp_path / "mine.nc", str(tmp_path / "mine.nc")):
        tree = fc.open(path)
        xr.testing.assert_identical(tree["mine"].to_dataset(), xr.load_dataset(path))
    (tmp_path / "text.nc").write_text("not a dataset")
    (tmp_path / "cut.nc").write_bytes((tmp_path / "mine.nc").read_bytes()[:-1000])
    xr.Dataset({"a": ("x", [1.0, 2.0])}).to_netcdf(tmp_path / "other.nc", engine="netcdf4")
    said = {
        "none": "there is no file",
        "text": "cannot be read",
        "cut": "cannot be read",
        "other": "not a dataset of a scene",
    }
    for name, words in said.items():
        with pytest.raises(InputError, match=words):
            fc.open(tmp_path / f"{name}.nc")


def test_the_import_name_offers_all_functions_of_the_pipeline() -> None:
    assert set(fc.__all__) == set(dir(fc)) - {"__version__"}
    assert all(getattr(fc, name) is getattr(fc.public, name) for name in fc.__all__)


def test_functions_take_a_table_and_refuse_what_is_no_scene(root: Path) -> None:
    file = root / "scenes/checks/oscillator.toml"
    table, known = tomllib.loads(file.read_text(encoding="utf-8")), fc.equilibrium(file)
    xr.testing.assert_identical(fc.equilibrium(table).position, known.position)
    for function in (fc.run, fc.show, fc.compare, fc.export, fc.open, fc.edited):
        with pytest.raises(InputError, match="is of type int"):
            function(3, *(["loads"] if function is fc.export else [{}] if function is fc.edited else []))


PENDULUM = "scenes/checks/pendulum.toml"


@pytest.mark.parametrize(
    "changes, kind, place",
    [
        ({"solver.evaluations": 20}, SolverError, "checks/pendulum simulate: "),
        ({"body.bob.pose.position": [0.0, 0.5, 0.0]}, InputError, r"pendulum.toml \[joint.hinge"),  # off its hinge
    ],
    ids=["solver", "input"],
)
def test_a_failed_run_raises_the_error_of_its_cause(
    root: Path, changes: dict[str, Any], kind: type[Exception], place: str
) -> None:
    with pytest.raises(kind, match=place):
        fc.run(fc.load_scene(root / PENDULUM, override={"time.end": 0.11, **changes}))
    assert type(error_of(ResourceError.exit_code, "here", "the disk is full")) is ResourceError


def test_time_keeps_its_unit_in_a_quantity(root: Path) -> None:
    run = fc.run(fc.load_scene(root / PENDULUM, override={"time.end": 0.01}))
    for name in ("bob.position", "hinge.position"):
        assert fc.quantity(run, name)["time"].attrs == {"units": "s", "long_name": "time"}


def test_a_scene_shows_its_parts_and_names_the_function_that_changes_it(root: Path) -> None:
    scene = fc.load_scene(root / "scenes/gallery/gear_shaft.toml", override={"title": "1 < 2"})
    shown = scene._repr_html_()
    assert "<b>1 &lt; 2</b>" in shown
    for words in ("shaft (flexible)", "bearing (cylindrical): ground.right – disc.centre", "pair: wheel – pinion"):
        assert words in shown
    with pytest.raises(AttributeError, match=r'fc.edited\(scene, \{"title": \'a\'\}\)'):
        setattr(scene, "title", "a")  # noqa: B010 - mypy refuses the statement
    with pytest.raises(AttributeError, match=r'fc.edited\(scene, \{"PART.mass": 2\}\)'):
        setattr(scene.body["disc"], "mass", 2)  # noqa: B010
    assert scene.title == "1 < 2"


def test_a_tree_leaves_out_what_is_derived_from_another_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, fresh: Path
) -> None:
    monkeypatch.chdir(tmp_path)
    scene, *_ = write("pendulum", tmp_path)
    scene.write_text(re.sub('(?m)^end = "2 s"', 'end = "4 ms"', scene.read_text()))
    assert main(["run", "-q", str(scene)]) == 0
    assert "post" in fc.open("pendulum")
    scene.write_text(scene.read_text().replace('end = "4 ms"', 'end = "6 ms"'))
    fc.run(fc.load_scene(scene))
    assert "post" not in fc.open("pendulum")
    assert float(fc.open("pendulum")["run"]["time"][-1]) == 6e-3
