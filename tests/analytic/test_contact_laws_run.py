"""Normal laws and their events in the engine: a ball thrown at the wall of a wide socket."""

import math

import numpy as np
import pytest
from pydantic import TypeAdapter

from flexclear.pipeline.core.scene.solver import Solver
from flexclear.pipeline.core.system.errors import InputError
from flexclear.pipeline.dynamics.run.ledger import usual
from tests.analytic.mechanism_runs import Overrides, impacts, of_kind, run
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


@pytest.mark.parametrize("asked", [0.3, 0.8])
def test_linear_law_rebounds_as_asked_and_never_pulls(asked: float) -> None:
    dataset = run(BOUNCE, normal(law="kelvin-voigt", restitution=asked))
    found = impacts(dataset)
    # the force is clipped before the surfaces part; the ball then flies on at its speed
    assert found["separation"] == pytest.approx([asked * SPEED], rel=1e-7)
    assert dataset.contact_normal_force.min() >= 0.0
    # d_max = v sqrt(m/K) sqrt(e): half of the angle to the end of the force
    known = SPEED * math.sqrt(MASS / STIFFNESS) * math.sqrt(asked)
    assert np.nanmax(dataset.event_peak_penetration) == pytest.approx(known, rel=1e-7)
    assert abs(float(dataset.energy_error[-1])) <= 1e-9


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
    assert usual(TypeAdapter(Solver).validate_python(solver)) == pytest.approx(fraction, rel=1e-12)


@pytest.mark.parametrize(
    "law, said",
    [
        ({"law": "flores", "restitution": 0.0}, "no finite damping"),
        ({"law": "lee-wang", "delivered_restitution": 0.3}, "no restitution below"),
        ({"law": "kelvin-voigt", "restitution": 0.5, "exponent": 1.5}, "exponent is 1"),
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
