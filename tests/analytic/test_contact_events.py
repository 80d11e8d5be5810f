"""Normal laws and events of contacts in the engine, also those that are easily missed; extremes lie inside impacts."""

import math

import numpy as np
import pytest
import xarray as xr
from pydantic import TypeAdapter

from flexclear.dynamics.run.ledger import default_energy_error
from flexclear.post.single_run.series import derive
from flexclear.scene.solver import Solver
from flexclear.system.errors import InputError
from tests.analytic.mechanism_runs import Overrides, impacts, of_kind, run
from tests.properties.mechanisms import simulate
from tests.reference import contact_solutions as exact

BOUNCE = "checks/bounce"
STIFFNESS, MASS, SPEED = 1e8, 1.0, 0.7
FREE: Overrides = (
    ("load.gravity.acceleration", (0.0, 0.0, 0.0)),
    ("body.ball.velocity", (0.0, 0.42, -0.56)),
    ("time.end", "0.2 s"),
)
#: CONTACT-BOUNCE of the project's reference collection: time [s], speed in, speed out [m/s], duration [s], depth [m]
KNOWN = [
    (0.14278431229270644, 1.4007141035914503, 1.1119865353836418, 0.0019556644434429267, 0.0008292750442209568),
    (0.37144467304270223, 1.1119865353836418, 0.8820232739289691, 0.0020495525691983417, 0.0006901447392670599),
    (0.5533154843130156, 0.8820232739289691, 0.6988254983312425, 0.0021488177635429926, 0.000574144153067837),
    (0.6979363710533664, 0.6988254983312425, 0.5528410006444239, 0.002254107153809214, 0.0004774263497608626),
    (0.8129001623344791, 0.5528410006444239, 0.4364644831573416, 0.0023662663520560116, 0.0003967480935455797),
    (0.9042500134280931, 0.4364644831573416, 0.3436395516849937, 0.0024864292766641925, 0.00032942567136600966),
]


def normal(**law: object) -> Overrides:
    return (*FREE, ("joint.contact.normal", (("stiffness", STIFFNESS), *law.items())))


def test_falling_ball_bounces_as_the_reference_says() -> None:
    dataset, known = run(BOUNCE), np.array(KNOWN)
    # along the vertical
    assert np.abs(dataset.position.sel(body="ball").values[:, :2]).max() <= 1e-15
    found = {name: values[: len(known)] for name, values in impacts(dataset).items()}
    # asked for are 1e-4 s and 0.5 %; errors of 1e-10 per contact add up
    assert found["start"] == pytest.approx(known[:, 0], abs=1e-8)
    assert found["approach"] == pytest.approx(known[:, 1], rel=1e-8)
    assert found["separation"] == pytest.approx(known[:, 2], rel=3e-8)
    assert found["duration"] == pytest.approx(known[:, 3], rel=1e-7)
    depth = dataset.event_peak_penetration.values[of_kind(dataset, "closing")]
    # the reference sampled its depths, which are too small by 1.2e-5; the second one locates them
    assert depth[:6] == pytest.approx(known[:, 4], rel=2e-5)
    located = exact.bounces(MASS, STIFFNESS, 0.7, 9.81, 0.1, 0.99)
    assert depth == pytest.approx([b.depth for b in located], rel=1e-7)


def known_peak(a: float) -> float:
    """Largest force over K d_max^n of a free impact, on the way from speed w = 1 to 0.

    depth^(n+1) grows as the integral of w / (1 + a w) from w to 1; F = K depth^n (1 + a w).
    """
    w = np.linspace(0.0, 1.0, 400001)
    grown = (1.0 - w) / a - np.log((1.0 + a) / (1.0 + a * w)) / a**2
    return float(np.max((grown / grown[0]) ** 0.6 * (1.0 + a * w)))


@pytest.mark.parametrize("restitution", [0.05, 0.2, 0.5, 0.9])
def test_the_peak_force_is_located_however_early_it_comes(restitution: float) -> None:
    dataset = run(BOUNCE, normal(law="gonthier", delivered_restitution=restitution))
    a = math.nan
    low, high = 0.0, (1.0 - 1e-12) / restitution
    for _ in range(200):  # bisection of the closed form, apart from the program's solution
        a = 0.5 * (low + high)
        low, high = (a, high) if math.log((1.0 + a) / (1.0 - a * restitution)) < a * (1.0 + restitution) else (low, a)
    depth = exact.largest_depth(MASS, SPEED, STIFFNESS, a)
    begun = of_kind(dataset, "closing")
    # the run is at 1e-10; a maximum is flat, and is read from the dense output, whose order is one less
    peak = known_peak(a) * STIFFNESS * depth**1.5
    assert dataset.event_peak_force.values[begun] == pytest.approx([peak], rel=1e-7)
    assert dataset.event_peak_penetration.values[begun] == pytest.approx([depth], rel=1e-7)
    assert impacts(dataset)["separation"] == pytest.approx([restitution * SPEED], rel=1e-7)
    assert dataset.contact_delivered_restitution.values == pytest.approx([restitution], rel=1e-12)


@pytest.mark.parametrize("stiffness", [1e6, 1e8, 1e10])
def test_a_ball_that_bounces_without_loss_keeps_its_energy(stiffness: float) -> None:
    """Under its weight, at the default tolerance, over all of the bounces of a second."""
    lossless = (("joint.contact.normal.restitution", 1.0), ("joint.contact.normal.stiffness", stiffness))
    dataset = run(BOUNCE, lossless)
    energy = MASS * 9.81 * 0.1
    assert len(of_kind(dataset, "closing")) >= 3
    # three bounces of 1e-10 each, of which rounding is a hundredth: steps in contact are ten times tighter than asked
    assert float(np.abs(dataset.energy_error).max()) <= 1e-9 * energy
    # nothing but rounding of the two equal forces whose difference dissipates
    assert float(np.abs(dataset.dissipated).max()) <= 1e-13 * energy


@pytest.mark.parametrize("stiffness", [1e6, 1e8, 1e10])
def test_a_contact_begins_with_a_step_as_long_as_that_of_the_last_one(stiffness: float) -> None:
    """The steps that look for where the ball touches are rejected; those that look for a length only once."""
    lossless = (("joint.contact.normal.restitution", 1.0), ("joint.contact.normal.stiffness", stiffness))
    dataset = run(BOUNCE, (*lossless, ("time.end", "5 s"), ("output.interval", "10 ms")))
    # ten a contact, fifteen without that memory; means of seventeen contacts, within half a step of each other
    assert dataset.attrs["rejected_steps"] < 12.5 * len(of_kind(dataset, "closing"))


def test_maximum_compression_is_an_event() -> None:
    dataset = run(BOUNCE, normal(law="hertz"))
    (deepest,), (begun,) = of_kind(dataset, "compression"), of_kind(dataset, "closing")
    depth = exact.largest_depth(MASS, SPEED, STIFFNESS, 0.0)
    half = 0.5 * exact.hertz_time(MASS, SPEED, STIFFNESS)
    # located on the dense output of steps at 1e-10 of 0.1 m and 0.7 m/s
    assert float(dataset.event_time[deepest] - dataset.event_time[begun]) == pytest.approx(half, rel=1e-7)
    assert float(dataset.event_peak_penetration[deepest]) == pytest.approx(depth, rel=1e-8)
    assert float(dataset.event_peak_force[deepest]) == pytest.approx(STIFFNESS * depth**1.5, rel=1e-8)


def test_a_contact_that_the_runs_end_cuts_short_has_its_peak() -> None:
    start, half = 0.1 / SPEED, 0.5 * exact.hertz_time(MASS, SPEED, STIFFNESS)
    depth = exact.largest_depth(MASS, SPEED, STIFFNESS, 0.0)
    cut = run(BOUNCE, (*normal(law="hertz"), ("time.end", start + 1.5 * half)))
    begun = of_kind(cut, "closing")
    assert np.isnan(cut.event_duration.values[begun]).all()
    assert cut.event_peak_force.values[begun] == pytest.approx([STIFFNESS * depth**1.5], rel=1e-8)
    early = run(BOUNCE, (*normal(law="hertz"), ("time.end", start + 0.5 * half)))
    # still compressing: the largest force is the last
    last = float(early.contact_normal_force[-1, 0])
    assert early.event_peak_force.values[of_kind(early, "closing")] == pytest.approx([last], rel=1e-12)


@pytest.mark.parametrize(
    "solver, fraction",
    [
        ({}, 1e-4),
        ({"rtol": 5e-9}, 5e-4),
        ({"rtol": 1e-4}, 1e-3),
        ({"integrator": "generalized-alpha"}, 1e-3),
        ({"step": 1e-5}, 0.1),
    ],
)
def test_the_ledger_must_close_as_well_as_the_steps_are_asked_to_be(solver: dict[str, object], fraction: float) -> None:
    assert default_energy_error(TypeAdapter(Solver).validate_python(solver)) == pytest.approx(fraction, rel=1e-12)


@pytest.mark.parametrize(
    "law, said",
    [
        ({"law": "flores", "restitution": 0.5, "delivered_restitution": 0.5}, "give one"),
        ({"law": "florez", "restitution": 0.5}, "did you mean 'flores'"),
    ],
)
def test_a_law_that_cannot_be_had_is_a_clear_error(law: dict[str, object], said: str) -> None:
    with pytest.raises(InputError, match=said):
        run(BOUNCE, normal(**law))


def test_impulse_only_grows_in_contact() -> None:
    csj = run("sps4/csj")
    impulse, closed = csj.contact_impulse.values[:, 0], csj.contact_normal_force.values[:, 0] > 0.0
    apart = ~closed[:-1] & ~closed[1:]
    steps = np.diff(impulse)
    assert steps.min() >= 0.0
    # a contact may fall between two outputs; events are outputs too, so none falls between two open ones
    assert np.abs(steps[apart]).max() == 0.0


def test_every_recorded_penetration_carries_its_force() -> None:
    """Also in the step that ends with the opening, after which the contact has no force any more."""
    bounce = run(BOUNCE, (("output.interval", 1e-5), ("time.end", 0.2)))
    depth, force = bounce.contact_penetration.values[:, 0], bounce.contact_normal_force.values[:, 0]
    inside = depth > 1e-9  # far above rounding of the 0.1 m gap
    assert inside.sum() > 10
    assert (force[inside] > 0.0).all()
    assert (force[depth == 0.0] == 0.0).all()


# Grazing, simultaneous and resting contacts, short stops of the sliding ----------------------------------------------

CLEARANCE, GRAVITY = 0.1, 9.81


def thrown_up(beyond: float) -> xr.Dataset:
    """The ball thrown up from the centre so that, without the wall, it would turn this far [m] beyond it."""
    speed = math.sqrt(2.0 * GRAVITY * (CLEARANCE + beyond))
    return run(BOUNCE, (("body.ball.velocity", (0.0, 0.0, speed)), ("time.end", "0.2 s")))


@pytest.mark.parametrize("beyond", [1e-12, 1e-9, 1e-6])
def test_a_grazing_contact_is_located_however_short_it_is(beyond: float) -> None:
    dataset = thrown_up(beyond)
    (begun,), (ended,) = of_kind(dataset, "closing"), of_kind(dataset, "opening")
    # the gap is located to 1e-13 of the clearance, the speed is the root of twice that share of `beyond`
    known, fraction = math.sqrt(2.0 * GRAVITY * beyond), 1e-13 * CLEARANCE / beyond
    assert dataset.event_approach_speed.values[begun] == pytest.approx(known, rel=fraction + 1e-6)
    turns = math.sqrt(2.0 * CLEARANCE / GRAVITY)
    assert float(dataset.event_time[begun]) < turns < float(dataset.event_time[ended])
    assert float(dataset.event_time[ended] - dataset.event_time[begun]) <= 2.0 * known / GRAVITY * (1.0 + fraction)
    assert float(dataset.event_peak_penetration[begun]) <= beyond * (1.0 + fraction)


@pytest.mark.parametrize("short", [1e-12, 1e-9])
def test_a_near_miss_is_no_contact(short: float) -> None:
    dataset = thrown_up(-short)
    assert dataset.sizes["event"] == 0
    # an output falls within 0.5 ms of the turn
    assert float(dataset.contact_gap.min()) == pytest.approx(short, abs=0.5 * GRAVITY * 0.5e-3**2)


def test_simultaneous_contacts_are_all_located_and_independent() -> None:
    ball = {"type": "rigid", "mass": MASS, "inertia": [4e-3] * 3, "pose": {}, "frames": {"centre": {}}}
    law = {"law": "lankarani-nikravesh", "restitution": 0.7, "stiffness": STIFFNESS}
    joint = {"type": "clearance-spherical", "clearance": CLEARANCE, "ball_radius": 0.1, "normal": law}
    names = ("left", "middle", "right")
    table = {
        "title": "three balls fall at once",
        "body": {"ground": {"type": "ground", "frames": {"socket": {}}}, **dict.fromkeys(names, ball)},
        "joint": {name: {**joint, "between": ["ground.socket", f"{name}.centre"]} for name in names},
        "load": {"gravity": {"type": "gravity", "acceleration": [0.0, 0.0, -GRAVITY]}},
        "time": {"end": 0.5},
        "output": {"interval": 0.01},
    }
    dataset, alone = simulate(table), run(BOUNCE)
    begun, known = of_kind(dataset, "closing"), of_kind(alone, "closing")[:2]
    assert sorted(dataset.event_contact.values[begun[:3]]) == sorted(dataset.contact.values)
    assert dataset.event_time.values[begun] == pytest.approx(np.repeat(alone.event_time.values[known], 3), abs=1e-8)
    assert np.ptp(dataset.event_time.values[begun[:3]]) <= 1e-12
    speeds = np.repeat(alone.event_approach_speed.values[known], 3)
    # the ball alone and the three take other steps, at 1e-10
    assert dataset.event_approach_speed.values[begun] == pytest.approx(speeds, rel=1e-8)


def test_a_bouncing_ball_comes_to_rest_in_contact() -> None:
    overrides: Overrides = (("joint.contact.normal.restitution", 0.3), ("time.end", "1.5 s"))
    dataset = run(BOUNCE, overrides)
    begun, ended = of_kind(dataset, "closing"), of_kind(dataset, "opening")
    assert len(begun) == len(ended) + 1
    assert len(begun) < 60
    # the latched rate of the last impact damps the little that is left of it
    assert dataset.contact_normal_force.values[-1, 0] == pytest.approx(MASS * GRAVITY, rel=1e-3)
    assert np.diff((dataset.kinetic + dataset.potential + dataset.elastic).values).max() <= 1e-9 * MASS * GRAVITY


def test_a_stop_of_the_sliding_within_one_step_is_noted() -> None:
    """A ball that cannot turn slides to and fro, so smoothly that steps do not see its stop of a microsecond."""
    angle, slow, resting = 0.5, 1e-6, 8.03e-8  # (m g cos(angle) / K)^(2/3)
    place = ((5e-4 + resting) * math.sin(angle), 0.0, -(5e-4 + resting) * math.cos(angle))
    law = (
        ("law", "modified-coulomb"), ("static", 1e-6), ("dynamic", 1e-6), ("v_static", slow), ("v_dynamic", 2.0 * slow),
    )  # fmt: skip
    overrides: Overrides = (
        ("joint.contact.friction", law), ("body.ball.pose.position", place), ("time.end", "60 ms"),
        ("body.ball.inertia", (10.0, 10.0, 10.0)), ("output.interval", "20 us"),
    )  # fmt: skip
    dataset = run("checks/socket_rolling", overrides)
    stops, goes = of_kind(dataset, "sticking"), of_kind(dataset, "slipping")
    x = dataset.velocity.sel(body="ball", axis="x").values
    turns = np.flatnonzero(x[1:-1] * x[2:] < 0.0) + 1  # the first output is at rest
    assert len(turns) == 2
    # next to the start's
    assert len(stops) == len(turns)
    assert len(goes) == len(turns) + 1
    for k, stop, go in zip(turns, stops, goes[1:], strict=True):
        between = dataset.event_time.values[[stop, go]]
        assert dataset.time.values[k] <= between[0] < between[1] <= dataset.time.values[k + 1]
        pulled = np.linalg.norm(dataset.acceleration.sel(body="ball").values[k, :2])
        # the level is passed twice; the acceleration is that of the nearest output, within 20 us of 45 ms
        assert between[1] - between[0] == pytest.approx(2.0 * slow / pulled, rel=0.2)


# Every located event is recorded: impacts are shorter than the output interval ---------------------------------------

DENSER = 50
#: both models are wholly predictable so far, and have had their first impacts
UNTIL = {"sps4/csj": 0.0105, "sps4/far_csj_cb": 0.0085}
#: regular outputs 2 us apart miss the peak of a contact of 60 us or more by up to (pi / 60)^2 / 2, a thousandth (3e-4
#: is found), while outputs 0.1 ms apart miss it by a tenth and more
CLOSE = 4e-3


def pair(name: str) -> tuple[xr.Dataset, xr.Dataset]:
    """A run as its scene has it, and the regular rows alone of one with 50 times denser output."""
    end, interval = ("time.end", UNTIL[name]), 1e-4 / DENSER
    dense = run(name, (end, ("output.interval", interval)))
    regular = np.abs(dense.time.values / interval - np.round(dense.time.values / interval)) < 1e-6
    return run(name, (end,)), dense.isel(time=regular)


@pytest.mark.parametrize("name", UNTIL)
def test_reported_extremes_are_those_of_fifty_times_denser_output(name: str) -> None:
    plain, dense = (derive(one) for one in pair(name))
    for quantity in (
        plain.peak_acceleration.sel(body="platform", axis="z"),
        plain.peak_reaction.sel(joint="A1"),
        plain.peak_force.sel(contact="A1"),
    ):
        where = {key: quantity[key].values for key in ("body", "axis", "joint", "contact") if key in quantity.coords}
        other = float(dense[quantity.name].sel(where))
        assert float(quantity) == pytest.approx(other, rel=CLOSE), quantity.name
        assert other > 0.0


def test_every_event_has_a_row_of_the_motion() -> None:
    plain, _ = pair("sps4/csj")
    assert set(plain.event_kind.values) >= {"closing", "opening", "compression"}
    assert np.isin(plain.event_time.values, plain.time.values).all()
    assert (np.diff(plain.time.values) > 0.0).all()


def test_rows_inside_steps_leave_the_trajectory_as_it_is() -> None:
    """The same states at common times, whatever is recorded besides: looking does not disturb."""
    plain, dense = pair("sps4/csj")
    common = np.intersect1d(plain.time.values, dense.time.values)
    assert len(common) > 30
    a, b = (one.sel(time=common) for one in (plain, dense))
    # the loops of recorded states are closed to rounding, from starts that the dense output gives alike
    assert np.array_equal(plain.event_time.values, dense.event_time.values)
    assert np.abs(a.position.values - b.position.values).max() < 1e-13
