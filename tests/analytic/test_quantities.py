"""One grammar of quantities: what a run holds is had by name everywhere, and equal to what is known."""

import re
from collections.abc import Mapping
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from flexclear.artifacts import quantities
from flexclear.artifacts.quantities import evaluate
from flexclear.dynamics import simulate
from flexclear.dynamics.model.driving import joint_type
from flexclear.dynamics.record.point import Runner
from flexclear.post.overview import comparison
from flexclear.post.overview.curves import curves
from flexclear.scene.load import edited, load_scene
from flexclear.scene.owners import COORDINATES
from flexclear.scene.parts import _hertz
from flexclear.scene.quantity import KINDS, OF_CONTACTS, Quantity, Recorded, parse, parse_recorded
from flexclear.scene.schema import Scene
from flexclear.system.errors import InputError
from flexclear.system.progress import silent
from tests.analytic.mechanism_runs import TREE, bundles, run_with_sections
from tests.properties import mechanisms
from tests.properties.mechanisms import frame, joint, rigid, simulated

SCENES = Path(__file__).parents[2] / "scenes"
#: scenes whose parts own all kinds of quantities between them, and how much of each is run
RUNS: Mapping[str, Mapping[str, object]] = {
    "controllers": {"time.end": "40 ms"},
    "gears": {"time.end": "20 ms"},
    "rubbing_slider_crank": {"time.end": "5 ms"},
    "clearance_slider_crank": {"time.end": "2 ms", "joint.pin.wear": {"coefficient": 1e-4, "hardness": "2 GPa"}},
    "stops": {"time.end": "60 ms"},
    "bushing": {"time.end": "10 ms"},
    "scotch_yoke": {"time.end": "10 ms"},
}
FLEXIBLE = "sps4/far_cb"


def scene(name: str) -> Scene:
    if name == "driven":
        return driven()
    return edited(load_scene(SCENES / f"checks/{name}.toml"), RUNS[name])


@cache
def driven() -> Scene:
    """A slider-crank in the plane whose crank of 50 mm turns with 100 rad/s; its rod has 150 mm."""
    along = {"axis": [1.0, 0.0, 0.0]}
    bodies = {
        "ground": {"type": "ground", "frames": {"main": {}, "guide": along}},
        "crank": rigid(1.0, 0.01, {"main": {}, "pin": frame((0.05, 0.0, 0.0))}),
        "rod": rigid(0.5, 1e-3, {"big": {}, "small": frame((0.15, 0.0, 0.0))}, pose=frame((0.05, 0.0, 0.0))),
        "slider": rigid(0.3, 1e-3, {"pin": {}, "guide": along}, pose=frame((0.2, 0.0, 0.0))),
    }
    joints = {
        "main": joint("revolute", "ground.main", "crank.main"),
        "pin": joint("revolute", "crank.pin", "rod.big"),
        "wrist": joint("spherical", "slider.pin", "rod.small"),
        "guide": joint("prismatic", "ground.guide", "slider.guide"),
    }
    drive = {"motor": {"joint": "main", "law": {"type": "polynomial", "coefficients": [0.0, 100.0]}}}
    written = mechanisms.scene(bodies, joints, end=0.06, rtol=1e-11, drive=drive, output={"interval": 5e-4})
    return Scene.model_validate(written)


@cache
def run(name: str) -> xr.Dataset:
    if name == FLEXIBLE:
        return run_with_sections(FLEXIBLE, {"time.end": "2 ms"})
    return simulated(scene(name))


def names_in(data: xr.Dataset) -> list[str]:
    """The first and the last part of each kind that a run has, by their full words."""
    known = quantities.owners(data)
    chosen = []
    for key, kind in KINDS.items():
        parts = list(known.get(kind.owner, {}))
        if not kind.variable or kind.variable not in data:
            continue
        chosen += (
            [key] * (key in parts) if not kind.owner else [f"{p}.{key}" for p in dict.fromkeys(parts[:1] + parts[-1:])]
        )
    return chosen


@pytest.mark.parametrize("name", [*RUNS, "driven"])
def test_a_scene_knows_before_it_runs_what_its_run_holds_and_in_which_unit(name: str) -> None:
    asked, held = scene(name).owners(), quantities.owners(run(name))
    for dim, parts in held.items():
        if dim != "frame":
            assert set(asked[dim]) == set(parts), dim
        assert all(asked[dim][part] == turns for part, turns in parts.items()), dim
    for text in names_in(run(name)):
        quantity = parse(text, asked)
        assert quantity.unit == quantities.unit(run(name), quantity), text
        assert quantity == Quantity.from_json(quantity.to_json())


@pytest.mark.parametrize("name", [*RUNS, "driven", FLEXIBLE])
def test_every_quantity_of_a_run_can_be_evaluated_compared_and_drawn(name: str) -> None:
    data = run(name)
    chosen = [parse(text, quantities.owners(data)) for text in names_in(data)]
    assert len(chosen) > 20
    for quantity in chosen:
        values = evaluate(data, quantity.name)
        assert np.isfinite(values.values).all()
        if quantity.over_time:
            assert values.dims == (("time", quantity.dim) if quantity.dim else ("time",))
        assert quantities.largest_distance(data, data, quantity) == 0.0
        assert quantities.scale(data, quantity) >= 0.0
        assert curves([data], quantity)[0] is not None
    compared = comparison.assemble({"a": data, "b": data}, {}, chosen)
    assert compared.sizes["quantity"] == len(chosen)
    # what a study stores of a run is enough to compare it
    stored = quantities.select_variables(data, chosen)
    assert all(quantities.largest_distance(stored, data, quantity) == 0.0 for quantity in chosen)


@pytest.mark.parametrize("name", [*RUNS, "driven"])
def test_a_sweep_keeps_of_every_quantity_what_the_run_holds(name: str) -> None:
    """But for rounding, which the code of long runs has in another order: of all that is measured in the same unit.

    Steps whose lengths differ by rounding end with states that differ by what the tolerance of 1e-10 leaves.  Impacts
    make a difference up to a thousand times larger.
    """
    data, asked = run(name), scene(name)
    chosen = [parse(text, asked.owners()) for text in names_in(data)]
    kept = [Recorded(q, "series") for q in chosen if q.over_time]
    kept += [parse_recorded(f"{q.name}.largest", asked.owners()) for q in chosen if q.kind == "peak_force"]
    point = Runner({}, kept).run(asked)
    assert not point.refused
    sizes: dict[str, float] = {}
    for q in (one.quantity for one in kept if one.reduction == "series"):
        sizes[q.unit] = max(sizes.get(q.unit, 0.0), float(np.abs(quantities.series(data, q)).max(initial=0.0)))
    times = quantities.regular_times(asked.time, asked.output)
    at = [int(np.argmin(np.abs(data["time"].values - t))) for t in times]
    for one in kept:
        if one.reduction == "series":
            known = quantities.series(data, one.quantity)[at]
            np.testing.assert_allclose(
                point.values[one.name].reshape(known.shape), known, rtol=0.0, atol=1e-7 * sizes[one.quantity.unit]
            )
        else:
            # an impact multiplies rounding; not by more than some thousand in so few
            assert point.values[one.name] == pytest.approx(quantities.contact_values(data, one.quantity)[0], rel=1e-9)
    assert {one.name: np.shape(point.values[one.name])[1:] for one in kept if one.quantity.dim == ""} == {
        one.name: () for one in kept if one.quantity.dim == ""
    }


def closed_form(time: np.ndarray) -> dict[str, np.ndarray]:
    """Slider of a crank r that turns evenly, with a rod l: place, rate and second rate along the guide."""
    r, l, omega = 0.05, 0.15, 100.0
    s, c = np.sin(omega * time), np.cos(omega * time)
    h = np.sqrt(l**2 - r**2 * s**2)
    first = -(r**2) * s * c / h  # of h, by the angle
    second = -(r**2) * (c**2 - s**2) / h - first**2 / h
    return {
        "position": r * c + h,
        "velocity": omega * (-r * s + first),
        "acceleration": omega**2 * (-r * c + second),
    }


@pytest.mark.parametrize("kind", ["position", "velocity", "acceleration"])
def test_a_driven_slider_moves_as_its_closed_form(kind: str) -> None:
    data = run("driven")
    known = closed_form(data["time"].values)[kind]
    size = np.abs(known).max()
    # the drive decides the motion; its loop is closed to 1e-12 of the lengths, rates to as much of theirs
    assert evaluate(data, f"slider.{kind}.x").values == pytest.approx(known, abs=1e-8 * size)
    # the guide's frames coincide where the slider is at the crank's axis
    assert evaluate(data, f"guide.{kind}").values == pytest.approx(known, abs=1e-8 * size)


def test_expressions_balance() -> None:
    """Newton's law of the slider along its guide; power of the drive against the rates of energies."""
    data = run("driven")
    pull = evaluate(data, "force(guide).x - wrist.force.x - 0.3 kg * slider.acceleration.x")
    assert pull.attrs["units"] == "N"
    size = float(np.abs(evaluate(data, "wrist.force.x")).max())
    assert np.abs(pull).max() <= 1e-9 * size
    power = evaluate(data, "motor.drive_force * main.velocity")
    assert power.attrs["units"] in ("N m rad/s", "kg m^2 rad/s^3", "W")
    energy = evaluate(data, "kinetic + potential - drive_work")
    assert energy.attrs["units"] == "J"
    assert np.ptp(energy.values) <= 1e-9 * float(np.abs(evaluate(data, "kinetic")).max())
    speed = evaluate(data, "norm(slider.velocity)").values
    assert speed == pytest.approx(np.abs(evaluate(data, "slider.velocity.x").values), abs=1e-12)
    shifted = evaluate(data, "slider.position.x - 10 mm").values - evaluate(data, "slider.position.x").values
    assert shifted == pytest.approx(-0.01, abs=1e-15)


@pytest.mark.parametrize(
    "text, says",
    [
        ("slidr.position", "did you mean 'slider.position'"),
        ("slider.positon", "did you mean 'slider.position'"),
        ("kinetc", "did you mean 'kinetic'"),
        ("guide.height", "no quantity"),
        ("slider.position.w", "no component 'w'"),
        ("kinetic.x", "no component"),
        ("motor.drive_force.x", "no component 'x'"),
        ("slider.position + slider.velocity", "m and m/s cannot be added"),
        ("slider.position.x - 0.01", "give numbers their unit"),
        ("slider.position - 1 m", "a vector and a number"),
        ("slider.position * slider.velocity", "no products of two vectors"),
        ("2 / slider.position", "no products of two vectors"),
        ("slider.orientation - rod.orientation", "cannot be part of an expression"),
        ("(slider.position", "is not a quantity: write"),
        ("slider.position +", "is not a quantity: write"),
        ("slider.position $ 2", "is not a quantity: write"),
        ("", "is not a quantity: write"),
        ("2 * 3", "is a number"),
        ("slider.position.x + 1e400 m", "1e400 m is too large"),
        (" + ".join(["slider.position.x"] * 10_000), "is too long or too deeply nested"),
    ],
)
def test_what_is_unknown_is_said_in_the_same_words_everywhere(text: str, says: str) -> None:
    with pytest.raises(ValueError, match=says.replace("(", r"\(").replace("+", r"\+")) as first:
        parse(text, driven().owners())
    with pytest.raises(InputError) as watched:
        edited(driven(), {"view": {"watch": [text]}})
    assert str(first.value) in str(watched.value)
    with pytest.raises(InputError) as accurate:
        edited(driven(), {"accuracy": {text: "1 %"}})
    assert str(first.value) in str(accurate.value)
    with pytest.raises(InputError) as evaluated:
        evaluate(run("driven"), text)
    assert str(first.value).partition("(")[0] in str(evaluated.value)


def test_accuracies_have_the_unit_of_the_quantity() -> None:
    asked = {
        "slider.acceleration": "1 mm/s^2",
        "main.velocity": "1 deg/s",
        "motor.drive_force": "1 N mm",
        "kinetic": "1 mJ",
        "force(guide) - force(wrist)": "1 mN",
        "guide.position": 1e-6,
    }
    accuracy = edited(driven(), {"accuracy": asked}).accuracy
    assert accuracy is not None
    assert [round(want.absolute or 0.0, 12) for want in accuracy.quantities.values()] == [
        1e-3, round(np.pi / 180.0, 12), 1e-3, 1e-3, 1e-3, 1e-6,
    ]  # fmt: skip
    for name, value in {
        "guide.position": "1 deg",
        "main.position": "1 mm",
        "force(guide) - force(wrist)": "1 m",
    }.items():
        with pytest.raises(InputError, match="but the quantity is in"):
            edited(driven(), {"accuracy": {name: value}})


@pytest.mark.parametrize(
    "name", ["slider.acceleration", "main.velocity", "motor.drive_force", "kinetic", "rod.position.y"]
)
def test_any_quantity_can_be_asked_for_in_accuracy(name: str) -> None:
    """The run that is delivered errs by no more than was asked for, against the closed form where there is one."""
    from flexclear.dynamics.run.method_choice.accuracy import deliver
    from flexclear.dynamics.single_run import SingleRun

    asked = edited(driven(), {"accuracy": {name: {"relative": 1e-6}}, "time.end": "20 ms"})
    done = deliver(asked, lambda one, judges: SingleRun(one, {}, silent, judges), silent)
    assert done.attrs["accuracy_verdict"] == "met"
    if name == "slider.acceleration":
        run = done.to_xarray()
        known = closed_form(run["time"].values)["acceleration"]
        assert np.abs(evaluate(run, f"{name}.x").values - known).max() <= 1e-6 * np.abs(known).max()


def test_frequencies_are_in_hertz_also_where_they_are_written_as_angular_velocities() -> None:
    assert [_hertz(value) for value in (3, "3 Hz", "180 rpm", f"{6.0 * np.pi} rad/s")] == pytest.approx([3.0] * 4)


def test_frames_of_recipes_have_quantities_without_a_joint() -> None:
    """The rod of 300 mm lies along x at the start; a frame that its recipe lacks is refused, with the nearest one."""
    scene = load_scene(TREE / "scenes/checks/flexible_slider_crank.toml", {"time.end": "1 ms"})
    asked = edited(scene, {"accuracy": {"rod.middle.frame_position.x": {"relative": 1e-3}}})
    watched = edited(asked, {"view": {"watch": ["rod.middle.frame_position"]}})
    assert [one.name for one in watched.watched_quantities()] == ["rod.middle.frame_position"]
    start = evaluate(simulate(edited(watched, {"accuracy": None}), bundles(scene), silent), "rod.middle.frame_position")
    assert start.values[0] == pytest.approx([0.3, 0.0, 0.0], abs=1e-12)
    with pytest.raises(InputError, match=r"did you mean 'rod.middle.frame_position'"):
        edited(scene, {"view": {"watch": ["rod.midle.frame_position"]}})


def test_the_table_of_joint_coordinates_is_that_of_the_joints() -> None:
    for kind in ("revolute", "prismatic", "cylindrical", "planar", "universal", "spherical", "fixed", "free"):
        declared = {c.name: c.turning for c in joint_type(kind).COORDINATES}
        assert dict(COORDINATES.get(kind, {})) == declared


def test_what_contacts_have_per_event_is_the_events() -> None:
    data = run("scotch_yoke")
    for kind in OF_CONTACTS:
        assert evaluate(data, f"slot.{kind}").attrs["units"] in ("N", "N s", "s")


def test_functions_of_quantities_are_evaluated_and_their_units_checked() -> None:
    times = np.array([0.0, 0.5, 2.0])
    run = xr.Dataset({"kinetic": ("time", np.array([3.0, 1.0, 4.0])), "time": times})
    by_hand = {
        "max(0, kinetic - 2 J)^1.5": np.maximum(0.0, run.kinetic.values - 2.0) ** 1.5,
        "min(kinetic, 2 J, 3.5 J) * sin(2 rad/s * t)": np.minimum(run.kinetic.values, 2.0) * np.sin(2.0 * times),
        "-sqrt(kinetic)^2 + abs(-1 J)": 1.0 - run.kinetic.values,
        "step(t - 0.5 s) * exp(-t / 1 s)": np.array([0.0, np.exp(-0.5), np.exp(-2.0)]),
        "step(kinetic - 2 J) * abs(log(kinetic / 1 J))^(-1/2 + 1)": [np.log(3.0) ** 0.5, 0.0, np.log(4.0) ** 0.5],
        "sign(kinetic - 2 J) * cos(0 rad * t / 1 s) + tan(0 * t / 1 s)": [1.0, -1.0, 1.0],
    }
    for text, expected in by_hand.items():
        # the same operations on numbers of order one: rounding of some ten of them
        assert evaluate(run, text).values == pytest.approx(expected, rel=1e-14, abs=1e-14)
    assert evaluate(run, "sqrt(kinetic)^2").attrs["units"] == "J"
    refused = {
        "sin(kinetic)": "a number or an angle",
        "exp(t)": "takes a number",
        "max(kinetic, t)": "cannot be compared",
        "kinetic^t": "an exponent is a number",
        "max(kinetic)": "two values or more",
        "abs(kinetic, t)": "one value",
        "kinetic + 1": "give numbers their unit",
    }
    for text, why in refused.items():
        with pytest.raises(InputError, match=re.escape(why)):
            evaluate(run, text)
