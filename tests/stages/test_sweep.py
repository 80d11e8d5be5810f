"""Sweeps: their points have known answers, and none is run twice."""

import runpy
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from scipy.special import ellipk

import flexclear as fc
from flexclear.artifacts.points import variable_name
from flexclear.commands.__main__ import main
from flexclear.dynamics import analyses
from flexclear.dynamics.run.evaluation import engine
from flexclear.post.overview.sweep_figures import figures
from flexclear.scene.load import load_scene
from flexclear.scene.quantity import parse_recorded
from flexclear.scene.sweep import design, read_sweep
from flexclear.scene.units import udunits
from flexclear.stages.sweeps import sweep_plan
from flexclear.study import sweep
from flexclear.system.errors import InputError, ResourceError
from flexclear.system.progress import silent
from tests.properties.mechanisms import simulated

GRAVITY = 9.81


def test_a_pendulum_is_back_after_its_period_whatever_its_length(root: Path):
    """Released from the horizontal, the period is 4 K(1/2) sqrt(l/g)."""
    lengths = np.array([0.3, 1.0, 2.5])
    periods = 4.0 * ellipk(0.5) * np.sqrt(lengths / GRAVITY)
    vary = {"body.bob.com.0": -lengths, "time.end": periods}
    found = fc.sweep(root / "scenes/checks/pendulum.toml", vary, ["bob.position.final"], combine="list", workers=1)
    assert found["bob.position.final"].dims == ("point", "axis")
    away = found["bob.position.final"].values + np.outer(lengths, [1.0, 0.0, 0.0])
    # a miss of the position is quadratic in that of the time, where the pendulum rests; measured 1e-7 of the length
    assert np.abs(away).max(axis=1) == pytest.approx(np.zeros(3), abs=3e-6 * lengths.min())


def test_a_grid_has_its_parameters_as_dimensions_and_coordinates_in_si(root: Path):
    """The pendulum passes the bottom at sqrt(2 g l)."""
    vary = {
        "body.bob.com.0": {"from": "-50 cm", "to": "-2 m", "count": 3},
        "load.gravity.acceleration.1": ["-9.81 m/s^2", "-1.62 m/s^2"],
    }
    found = fc.sweep(
        root / "scenes/checks/pendulum.toml", vary, ["bob.velocity.largest"], set={"output.interval": "5 ms"}, workers=1
    )
    speed = found["bob.velocity.largest"]
    assert speed.dims == ("body.bob.com.0", "load.gravity.acceleration.1")
    assert found["body.bob.com.0"].values == pytest.approx([-0.5, -1.25, -2.0])
    assert found["body.bob.com.0"].attrs["units"] == "m"
    gravity = -found["load.gravity.acceleration.1"].values
    expected = np.sqrt(2.0 * np.outer(-found["body.bob.com.0"].values, gravity))
    # the speed is largest between outputs 5 ms apart: within (2.5 ms omega)^2/2 of it, omega < 9 rad/s; 2.5e-4
    assert speed.values == pytest.approx(expected, rel=3e-4)
    assert (found["status"] == 0).all()
    assert speed.attrs["units"] == "m s-1"
    assert found.attrs["complete"] == 1


@pytest.fixture
def evaluated_as_points(monkeypatch: pytest.MonkeyPatch) -> None:
    """Runs and sections evaluate as points do, each operation rounded as it is; else they differ by rounding."""
    monkeypatch.setattr(engine, "SpecialisedCode", partial(engine.SpecialisedCode, exact=True))


@pytest.mark.usefixtures("evaluated_as_points")
def test_a_point_is_what_the_reductions_of_a_run_are(root: Path):
    """Without the record, the twin and the dataset of a run, the numbers are the same to the last bit."""
    path = root / "scenes/checks/bounce.toml"
    keep = ["ball.velocity.largest", "ball.velocity.rms", "ball.position.final", "ball.position.series"]
    keep += ["contact.peak_force", "contact.impulse", "contact.impact_times.count", "contact.impact_times.first"]
    keep += ["contact.force.largest", "ball.orientation.final"]
    values = [0.6, 0.8]
    found = fc.sweep(path, {"joint.contact.normal.restitution": values}, keep, workers=1)
    for k, value in enumerate(values):
        one = simulated(load_scene(path, override={"joint.contact.normal.restitution": value}))
        here, velocity = found.isel({"joint.contact.normal.restitution": k}), one["velocity"].sel(body="ball").values
        closing = (one["event_kind"] == "closing") & (one["event_approach_speed"] > 1e-4)
        speed, t = np.linalg.norm(velocity, axis=1), one["time"].values
        expected = {
            "ball.velocity.largest": speed.max(),
            "ball.velocity.rms": np.sqrt(np.trapezoid(speed**2, t) / (t[-1] - t[0])),
            "ball.position.final": one["position"].sel(body="ball").values[-1],
            "ball.position.series": one["position"].sel(body="ball", time=found["time"], method="nearest").values,
            "contact.peak_force.largest": one["event_peak_force"].max().values,
            "contact.impulse.final": one["contact_impulse"].values[-1, 0],
            "contact.impact_times.count": closing.sum().values,
            "contact.impact_times.first": one["event_time"].values[closing][0],
            "contact.force.largest": np.linalg.norm(one["joint_force"].sel(joint="contact").values, axis=1).max(),
            "ball.orientation.final": one["quaternion"].sel(body="ball").values[-1],
        }
        for name, number in expected.items():
            assert np.array_equal(here[name].values, number), name
        assert here["evaluations"] == one.attrs["evaluations"]


@pytest.mark.usefixtures("evaluated_as_points")
def test_sections_of_a_point_are_those_of_the_repeated_motion(root: Path):
    """What `flexclear sections` finds without a neighbour is what a point keeps, to the last bit."""
    path, count = root / "scenes/checks/driven_pendulum.toml", {"sections.transient": 2, "sections.periods": 20}
    keep = ["bob.position.sections", "bob.angular_velocity.sections", "norm(bob.velocity).sections", "kinetic.sections"]
    vary = {"load.torque.force.amplitude": [0.9, 1.5]}
    found = fc.sweep(path, vary, keep, set=count, workers=1)
    asked = {"load.torque.force.amplitude": 1.5, "sections.exponent_periods": 20, **count}
    whole = analyses.sections(load_scene(path, override=asked), {}, silent)
    here = found.isel({"load.torque.force.amplitude": 1})
    assert here["bob.position.sections"].dims == ("section", "axis")
    assert np.array_equal(here["bob.position.sections"].values, whole["position"].sel(body="bob").values)
    assert np.array_equal(here["bob.angular_velocity.sections"], whole["angular_velocity"].sel(body="bob"))
    speed = np.linalg.norm(whole["velocity"].sel(body="bob").values, axis=1)
    assert here["norm(bob.velocity).sections"].values == pytest.approx(speed, rel=1e-14)
    assert here["kinetic.sections"].dims == ("section",)
    assert (found["evaluations"] > 0).all()


def test_the_reported_error_is_the_error(root: Path):
    """The oscillator's closed form says how far off a value is; the difference from the tighter run says the same."""
    keep = ["mass.position.final"]
    found = fc.sweep(
        root / "scenes/checks/oscillator.toml",
        {"load.spring.stiffness": [150.0, 250.0]},
        keep,
        set={"time.end": 1.0, "solver.rtol": 1e-5},
        error=True,
        workers=1,
    )
    k = found["load.spring.stiffness"].values
    decay, omega = 4.0 / 4.0, np.sqrt(k / 2.0 - 1.0)
    exact = 0.25 + 0.1 * np.exp(-decay) * (np.cos(omega) + decay / omega * np.sin(omega))
    off = np.abs(found["mass.position.final"].values[:, 2] - exact)
    reported = found["mass.position.final.error"].values[:, 2]
    # the tighter run is not exact: it leaves a hundredth, and where errors cancel more
    assert reported == pytest.approx(off, rel=0.5)
    assert (off > 1e-12).all()


def test_more_values_take_the_finished_points_over(root: Path, fresh: Path, asked: list[str]):
    scene, keep = root / "scenes/checks/pendulum.toml", ["bob.velocity.final"]
    first = fc.sweep(scene, {"body.bob.com.0": [-1.0, -2.0]}, keep, workers=1)
    asked.clear()
    second = fc.sweep(scene, {"body.bob.com.0": [-3.0, -2.0, -1.0]}, keep, workers=1)
    assert len(asked) == 1
    assert second.sel({"body.bob.com.0": [-1.0, -2.0]}).equals(first)


def test_refused_points_keep_their_reason_and_are_not_tried_again(root: Path, fresh: Path, asked: list[str]):
    arguments = (root / "scenes/checks/pendulum.toml", {"solver.evaluations": [100, 100_000]}, ["bob.velocity.final"])
    for requested in (2, 0):
        asked.clear()
        found = fc.sweep(*arguments, workers=1)
        assert len(asked) == requested
        assert found["status"].values.tolist() == [1, 0]
        assert "evaluations" in str(found["reason"].values[0])
        assert found["reason"].values[1] == ""
        assert np.isnan(found["bob.velocity.final"].values[0]).all()
        assert np.isfinite(found["bob.velocity.final"].values[1]).all()


def test_limits_of_a_scene_hold_for_the_points_of_its_sweep(root: Path, fresh: Path):
    """Only the combination of both values asks for more; what a scene allows is not kept with any point."""
    vary = {"time.end": [0.1, 2.0], "output.interval": [1e-2, 1e-3]}
    table = {"vary": vary, "keep": ["bob.velocity.final"]}
    pendulum = root / "scenes/checks/pendulum.toml"
    with pytest.raises(ResourceError, match=r"2e\+03 rows, more than the 1000 that limits\.rows allows"):
        sweep.of_scene(load_scene(pendulum, override={"limits.rows": 1000}), table, workers=1)
    found = sweep.of_scene(load_scene(pendulum, override={"limits.rows": 2000}), table, workers=1)
    assert found["status"].values.tolist() == [[0, 0], [0, 0]]


def test_a_sweep_of_refusals_only_is_no_success(tmp_path: Path, fresh: Path, capsys: pytest.CaptureFixture[str]):
    path = tmp_path / "none.toml"
    path.write_text('scene = "checks/pendulum"\nkeep = ["bob.velocity.final"]\nvary."solver.evaluations" = [50, 60]\n')
    shown = fresh / "sweeps" / "none"
    shown.mkdir(parents=True)
    (shown / "sweep.png").write_bytes(b"of an earlier state")
    assert main(["sweep", str(path), "--jobs=1"]) == 3
    assert "2 refused" in capsys.readouterr().out
    with xr.open_dataset(shown / "sweep.nc") as found:
        assert found["bob.velocity.final"].dims == ("solver.evaluations", "axis")
        assert np.isnan(found["bob.velocity.final"].values).all()
    assert [path.name for path in shown.glob("sweep.*")] == ["sweep.nc"]


def test_members_give_mean_and_deviation(root: Path):
    """Neighbouring starts of a bouncing ball part with every impact; the first one is the same to their distance."""
    path, keep = root / "scenes/checks/bounce.toml", ["contact.impact_times.first", "ball.velocity.final"]
    vary = {"joint.contact.normal.restitution": [0.7]}
    found = fc.sweep(path, vary, keep, members=4, workers=1).isel({"joint.contact.normal.restitution": 0})
    drop = np.sqrt(2.0 * 0.1 / GRAVITY)
    # starts are 1e-8 m apart, which the speed of the impact turns into less than 1e-8 s
    assert float(found["contact.impact_times.first"]) == pytest.approx(drop, abs=1e-7)
    assert 0.0 < float(found["contact.impact_times.first.deviation"]) < 1e-8
    assert (found["ball.velocity.final.deviation"].values[2:] > 0.0).all()


@pytest.mark.parametrize(
    "change, place, words",
    [
        ({"vary": {"body.bop.com.0": [1.0]}}, "vary.body.bop.com.0", "there is no 'body.bop'"),
        ({"vary": {"body.bob.com.7": [1.0]}}, "vary.body.bob.com.7", "there is no 'body.bob.com.7'"),
        ({"vary": {"body.bob.mass": ["1 kg", "1 m"]}}, "vary.body.bob.mass", "length"),
        ({"vary": {"body.bob.mass": [1.0, -1.0]}}, "vary.body.bob.mass", "-1"),
        ({"vary": {"body.bob.mass": {"from": 1, "to": 2}}}, "sweep", "needs a count"),
        ({"vary": {"body.bob.mass": {"from": "1 kg", "to": 2, "count": 3}}}, "vary.body.bob.mass", "differ in unit"),
        ({"vary": {"body.bob.mass": {"from": -1, "to": 2, "count": 3, "spacing": "log"}}}, "mass", "ends of one sign"),
        ({"vary": {"a": [1.0, 2.0], "b": [1.0]}, "combine": "list"}, "sweep", "a 2, b 1"),
        (
            {"vary": {"a": {"values": [1.0], "places": ["time.end"]}, "time.end": [2.0]}},
            "sweep",
            "varied by 'a' already",
        ),
        ({"vary": {"time": [1.0]}}, "sweep", "another name"),
        *(
            ({"vary": {name: {"values": [1.0], "places": ["body.bob.mass"]}}}, "sweep", "cannot name a dimension")
            for name in ("% of mass", "-m", " m", "m ", "a/b", "(m)", "m" * 257, "µ" * 129)
        ),
        ({"vary": {"time.end": [1.0, 2.0]}, "keep": ["bob.position.series"]}, "keep", "time.end is varied"),
        ({"keep": ["bob.speed.largest"]}, "keep", "velocity"),
        ({"keep": ["bob.velocity"]}, "keep", "bob.velocity.largest"),
        ({"keep": ["bop.velocity.largest"]}, "keep", "bob"),
        ({"keep": ["bob.orientation.mean"]}, "keep", "final"),
        ({"keep": ["bob.velocity.sections", "bob.velocity.final"]}, "keep", "two sweeps"),
        ({"keep": ["bob.velocity.sections"], "error": True}, "keep", "estimated error"),
        ({"set": {"time.end": "1 kg"}}, "set", "mass"),
        ({"members": 3}, "members", "neither clearance joint"),
        ({"sample": {"method": "sobol", "points": 4}}, "sweep", "without count"),
        ({"set": {"solver.integrator": "rk4", "solver.step": 1e-3}, "error": True}, "error", "fixed steps"),
    ],
)
def test_what_cannot_be_is_refused_before_anything_runs(
    root: Path, asked: list[str], change: dict[str, Any], place: str, words: str
):
    table = {"vary": {"body.bob.mass": [1.0, 2.0]}, "keep": ["bob.velocity.largest"]} | change
    scene = load_scene(root / "scenes/checks/pendulum.toml")
    with pytest.raises(InputError) as refused:
        sweep.of_scene(scene, table, workers=1)
    assert place in str(refused.value).partition(":")[0]
    assert words in str(refused.value)
    assert refused.value.exit_code == 2
    assert asked == []


def test_rotations_are_reported_in_units_of_rotation(root: Path):
    def units(scene: str, *keep: str) -> list[str]:
        table = {"scene": scene, "vary": {"time.end": [0.1, 0.2]}, "keep": keep}
        plan = sweep_plan.plan(read_sweep(table, "sweep"), load_scene(root / f"scenes/checks/{scene}.toml"), "sweep")
        return [udunits(one.unit) for one in plan.recorded]

    ends = [f"{stop}.upper.{what}" for stop in "AC" for what in ("peak_force", "impulse", "impact_times.count")]
    assert units("stops", *ends) == ["N", "N s", "1", "N m", "N m s", "1"]
    kept = ("turning.drive_force.rms", "axis.force.largest", "axis.moment.final", "rotor.orientation.final")
    assert units("spindle", *kept) == ["N m", "N", "N m", "1"]


def test_a_force_at_some_points_that_is_a_torque_at_others_is_refused(root: Path):
    vary = {"drive.turning.coordinate": ["rotation", "translation"]}
    with pytest.raises(InputError, match="a force at some points and a torque at others"):
        fc.sweep(root / "scenes/checks/spindle.toml", vary, ["turning.drive_force.rms"], workers=1)


def test_quantities_and_parameters_of_any_name_can_be_written(tmp_path: Path):
    """What a file cannot name begins with "_"; of parameters, names that NetCDF refuses are refused."""
    owners = load_scene("scenes/checks/pendulum.toml").owners()
    names = ["(bob.position.x - bob.position.y).final", "norm(bob.velocity).largest", "(bob.position.x / 2).final"]
    kept = [variable_name(parse_recorded(name, owners), "values") for name in names]
    given = ["µ", "2nd mass", "mass in %", "body.bob.mass", "m" * 256]
    for name in given:
        read_sweep(
            {"scene": "a", "keep": ["q.position.final"], "vary": {name: {"values": [1.0], "places": ["c"]}}}, "x"
        )
    xr.Dataset({name: (given, np.zeros((1,) * len(given))) for name in kept}).to_netcdf(tmp_path / "a.nc")
    assert kept[0].endswith("(bob.position.x - bob.position.y).final")


def test_units_of_parameters_are_read_by_other_programs():
    written = ["m", "rad/s", "kg m^2", "N/m s", "N m s/rad", "N/m^1.5"]
    assert [udunits(text) for text in written] == ["m", "rad s-1", "kg m2", "N m-1 s-1", "N m s rad-1", ""]


def test_a_latin_hypercube_has_one_point_in_every_row_and_column():
    table = {"vary": {"a": {"from": 0.0, "to": 8.0}, "b": {"from": 1.0, "to": 256.0, "spacing": "log"}}}
    table |= {"scene": "x", "keep": ["y"], "sample": {"method": "latin-hypercube", "points": 8, "seed": 3}}
    one, other = design(read_sweep(table, "sweep")), design(read_sweep(table, "sweep"))
    assert one == other
    assert one.dims == ("point",)
    assert sorted(np.floor(one.axes[0].coordinate).tolist()) == list(range(8))
    assert sorted(np.floor(np.log2(one.axes[1].coordinate)).tolist()) == list(range(8))


def test_a_sobol_sample_of_a_normal_distribution_has_its_mean_and_deviation():
    table = {"vary": {"a": {"mean": "5 mm", "deviation": "1 mm"}}, "scene": "x", "keep": ["y"]}
    table |= {"sample": {"method": "sobol", "points": 1024}}
    (axis,) = design(read_sweep(table, "sweep")).axes
    # independent numbers would miss the mean by 3e-5 m; the sequence is far better
    assert np.mean(axis.coordinate) == pytest.approx(5e-3, abs=3e-6)
    assert np.std(axis.coordinate) == pytest.approx(1e-3, rel=1e-2)
    assert axis.unit == "m"


def test_the_sweeps_that_come_along_fit_their_scenes(root: Path):
    paths = sorted((root / "scenes/sweeps").glob("*.toml"))
    assert len(paths) >= 4
    for path in paths:
        plan = sweep_plan.plan(*sweep.read(path), str(path))
        assert np.prod(plan.design.shape) > 1


def test_every_kind_of_sweep_has_a_figure_of_equal_bytes(root: Path):
    scene, keep = root / "scenes/checks/pendulum.toml", ["bob.velocity.largest"]
    lengths, masses = {"from": -2.0, "to": -1.0}, {"from": 1.0, "to": 20.0}
    kinds: list[dict[str, Any]] = [
        {"vary": {"body.bob.com.0": {**lengths, "count": 3}}},
        {"vary": {"body.bob.com.0": {**lengths, "count": 2}, "body.bob.mass": {**masses, "count": 3}}},
        {"vary": {"body.bob.com.0": lengths, "body.bob.mass": masses}, "sample": {"method": "random", "points": 4}},
    ]
    pictures = set()
    for kind in kinds:
        found = fc.sweep(scene, kind.pop("vary"), keep, workers=1, **kind)
        drawn = figures(found)
        assert drawn == figures(found)
        assert set(drawn) == {"sweep.png", "sweep.svg"}
        pictures.add(drawn["sweep.png"])
    assert len(pictures) == 3


def test_a_sweep_keeps_the_unit_in_which_its_values_were_written(root: Path):
    scene, short = root / "scenes/checks/pendulum.toml", {"time.end": 0.1}
    mass = ["500 g", "2 kg"], {"from": "500 g", "to": "2 kg", "count": 2}
    for given in mass:
        found = fc.sweep(scene, {"body.bob.mass": given}, ["bob.velocity.largest"], set=short, workers=1)
        assert found["body.bob.mass"].values == pytest.approx([0.5, 2.0])
        assert found["body.bob.mass"].attrs["units"] == "kg"
        assert found["body.bob.mass"].attrs["written_units"] == "g"


def test_the_example_with_an_optimiser_finds_the_closed_form(root: Path):
    """The mass turns round where sqrt(k/m - (c/2m)^2) T = pi."""
    example = runpy.run_path(str(root / "docs/examples/optimise.py"))
    # the velocity is right to 1e-8 or so, and changes by 0.01 m/s per N/m; measured 1e-6
    assert example["best"]() == pytest.approx(2.0 * ((np.pi / 0.5) ** 2 + 1.0), abs=1e-4)


def test_the_example_of_an_optimal_start_finds_the_steady_motion(root: Path):
    example = runpy.run_path(str(root / "docs/examples/optimal_start.py"))
    # the integrator's tolerance is 1e-10 of 0.25 m and 0.27 m/s; measured 6e-13
    assert example["best"]() == pytest.approx(example["steady"](), abs=1e-10)


def test_the_example_of_a_sensitivity_has_shares_of_a_whole(root: Path, tmp_path: Path):
    pytest.importorskip("SALib")
    example = runpy.run_path(str(root / "docs/examples/sensitivity.py"))
    error, found = example["study"](4, workers=1)
    assert error.shape == (40,)
    assert (np.abs(error) < 5e-3).all()
    # nothing goes along with less than nothing; what is estimated from four points is anything but a share
    assert (found["ST"] >= 0.0).all()
    example["figure"](found, tmp_path / "shares.png")
    assert (tmp_path / "shares.png").stat().st_size > 10_000
