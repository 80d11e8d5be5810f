"""Ends of joint coordinates against closed forms: half sines, restitution, angles beyond a full turn."""

from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import brentq

from flexclear.pipeline.core.system.errors import InputError
from tests.analytic.mechanism_runs import impacts, refusal, run

SCENE = "checks/stops"


def test_a_slide_between_lossless_ends_repeats_itself_by_half_sines() -> None:
    dataset = run(SCENE)
    mass, stiffness, lower, upper = 2.0, 2e5, -0.05, 0.1
    omega = np.sqrt(stiffness / mass)
    contact, way = np.pi / omega, upper - lower
    period = 2.0 * (way + contact)

    def coordinate(t: float) -> float:
        t = (t - lower) % period  # from the lower end on, upwards at 1 m/s
        if t < way:
            return lower + t
        if t < way + contact:
            return upper + np.sin(omega * (t - way)) / omega
        if t < 2.0 * way + contact:
            return upper - (t - way - contact)
        return lower - np.sin(omega * (t - 2.0 * way - contact)) / omega

    known = [coordinate(t) for t in dataset.time.values]
    # six contacts at rtol 1e-10, each located to 1e-12 of the way
    assert dataset.joint_position.sel(coordinate="A").values == pytest.approx(known, abs=1e-8)
    first = impacts(dataset, contact="A.upper")
    assert first["start"][0] == pytest.approx(0.1, abs=1e-11)
    assert first["duration"] == pytest.approx(contact, rel=1e-7)
    assert first["peak_force"] == pytest.approx(np.sqrt(stiffness * mass), rel=1e-7)
    assert dataset.contact_impulse.sel(contact="A.lower").values[-1] == pytest.approx(
        2.0 * mass * len(impacts(dataset, contact="A.lower")["start"]), rel=1e-7
    )


def test_a_linear_damper_gives_the_restitution_that_was_asked_for() -> None:
    dataset = run(SCENE)
    found = impacts(dataset, contact="B.upper")
    assert found["start"] == pytest.approx([0.05], abs=1e-11)
    speed = dataset.joint_velocity.sel(coordinate="B").values[-1]
    assert speed == pytest.approx(-0.6, rel=1e-7)
    # with K, m = 1: d = sin(w t) exp(-z t)/w; the end is where d + 2 z d' = 0
    unit = np.sqrt(1e5 / 1.0)

    def end(z: float) -> tuple[float, float]:
        w = np.sqrt(1.0 - z * z)

        def depth(t: float) -> tuple[float, float]:
            return np.exp(-z * t) * np.sin(w * t) / w, np.exp(-z * t) * (np.cos(w * t) - z / w * np.sin(w * t))

        t = brentq(lambda t: depth(t)[0] + 2.0 * z * depth(t)[1], 0.5, np.pi / w, xtol=1e-14)
        return t, -depth(t)[1]

    ratio = brentq(lambda z: end(z)[1] - 0.6, 1e-3, 0.9)
    lost = 0.5 * (1.0 - 0.6**2)
    assert dataset.contact_damping_loss.sel(contact="B.upper").values[-1] + 0.0 == pytest.approx(lost, rel=1e-6)
    # the largest force is that of the first instant, C v, where the damping is strong, or later
    assert found["peak_force"][0] >= 2.0 * ratio * unit * (1.0 - 1e-9)


@pytest.mark.parametrize(
    "coordinate, ends, speed",
    [("C", {"C.upper": 7.0, "C.lower": -8.0}, 40.0), ("D", {"E.upper": 9.0, "D.lower": -1.0}, 30.0)],
    ids=["in the tree", "in a loop"],
)
def test_angles_reach_their_ends_beyond_a_full_turn(coordinate: str, ends: dict[str, float], speed: float) -> None:
    dataset, now, angle, velocity = run(SCENE), 0.0, 0.0, speed
    for name, limit in ends.items():
        found = impacts(dataset, contact=name)
        now += (limit - angle) / velocity
        # located at rtol 1e-10 of some radians
        assert found["start"][0] == pytest.approx(now, abs=1e-8)
        assert found["approach"][0] == pytest.approx(abs(velocity), rel=1e-9)
        now, angle, velocity = now + found["duration"][0], limit, -0.5 * velocity
        assert found["separation"][0] == pytest.approx(abs(velocity), rel=1e-7)
    series = dataset.joint_velocity.sel(coordinate=coordinate).values
    assert series[-1] == pytest.approx(velocity, rel=1e-7)
    assert np.abs(dataset.energy_error.values).max() < 1e-6


WRONG: dict[str, tuple[str, ...]] = {
    'joint = "A"\nnormal = { law = "hertz", stiffness = 1.0 }': ("neither",),
    'joint = "A"\nupper = 0.2\nnormal = { law = "hertz" }': ("normal.stiffness",),
    'joint = "A"\nupper = "3 deg"\nnormal = { law = "hertz", stiffness = 1.0 }': ("stop.s.upper", "an angle", "length"),
    'joint = "A"\nupper = 0.1\nlower = 0.2\nnormal = { law = "hertz", stiffness = 1.0 }': ("lower = 0.2", "below"),
    'joint = "K"\nupper = 0.1\nnormal = { law = "hertz", stiffness = 1.0 }': ("stop.s.joint", "no joint 'K'"),
    'joint = "A"\nupper = 0.1\nnormal = { law = "kelvin-voigt", stiffness = 1.0, restitution = 0.5 }': (
        "effective_mass",
    ),
    'joint = "A"\nupper = 0.1\nnormal = { law = "flores", stiffness = 1.0 }': ("stop.s.normal", "restitution"),
    'joint = "A"\nupper = 0.1\nfloor = -1.0\nnormal = { law = "hertz", stiffness = 1.0 }': ("stop.s.floor", "positive"),
}


@pytest.mark.parametrize("text", WRONG)
def test_what_is_no_stop_is_refused_in_words(text: str, tmp_path: Path) -> None:
    said = refusal(SCENE, f"[stop.s]\n{text}", tmp_path)
    assert [word for word in WRONG[text] if word not in said] == []


def test_a_start_beyond_an_end_is_refused_unless_its_speed_is_given() -> None:
    place = ("stop.A.upper", "-20 mm")
    with pytest.raises(InputError, match=r"(?s)stop\.A.*0\.02 m beyond -0\.02 m.*initial_approach_speed"):
        run(SCENE, (place,))
    reported = run(SCENE, (place, ("stop.A.initial_approach_speed", "1 m/s"), ("time.end", "10 ms")))
    # from 20 mm deep, at 1 m/s
    omega = np.sqrt(2e5 / 2.0)
    t = reported.time.values
    known = -0.02 + 0.02 * np.cos(omega * t) + np.sin(omega * t) / omega
    inside = known > -0.02
    assert reported.joint_position.sel(coordinate="A").values[inside] == pytest.approx(known[inside], abs=1e-10)


def test_the_force_of_an_end_pushes_the_second_body_back_along_or_about_the_axis() -> None:
    dataset = run(SCENE)
    for end, sense in (("A.upper", -1.0), ("A.lower", 1.0), ("C.upper", -1.0), ("D.lower", 1.0)):
        mine = dataset.sel(contact=end)
        expected = np.outer(sense * mine.contact_normal_force.values, [0.0, 0.0, 1.0])
        assert np.abs(expected).max() > 0.0
        # all axes are the world's z, rotors turned about it
        assert mine.contact_force.values == pytest.approx(expected, rel=1e-12, abs=1e-12)
