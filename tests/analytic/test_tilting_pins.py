"""Pins that tilt and slide in their journals, with crowned and flat collars, against closed forms and SciPy."""

from typing import Any

import numpy as np
import pytest

from flexclear.scene.schema import Scene
from tests.analytic.mechanism_runs import impacts
from tests.analytic.test_contact_pairs import INERTIA, LINEAR, MASS, STIFFNESS, state
from tests.properties.mechanisms import Table, joint, rigid, scene, simulate, simulated
from tests.reference.sliders import corners, final_state, rims

BEARING, PIN, RADIAL, AXIAL = 0.03, 0.01, 1e-4, 2e-4
STEEL: Table = {"youngs_modulus": 2e11, "poisson": 0.3}
PINNED: Table = {"clearance": RADIAL, "pin_radius": PIN, "length": BEARING, "normal": LINEAR}


def pinned(velocity: Any, omega: Any = (0.0, 0.0, 0.0), kind: str = "clearance-revolute", **more: Any) -> Table:
    """A pin in the middle of a fixed journal; more: of the joint."""
    moving = rigid(MASS, INERTIA, {"F": {}}, pose={}, velocity=list(velocity), angular_velocity=list(omega))
    pin = joint(kind, "ground.F", "body.F") | PINNED | more
    return scene({"ground": {"type": "ground", "frames": {"F": {}}}, "body": moving}, {"pin": pin}, 0.005)


def test_a_pin_that_does_not_tilt_moves_as_one_that_is_held() -> None:
    """Both ends share stiffness and force of the joint in a plane. Friction would act deeper by the penetration."""
    start, law = ([0.1, 0.05, 0.0], [0.0, 0.0, 30.0]), {"law": "kelvin-voigt", "stiffness": 1e6, "restitution": 0.5}
    held, free = (simulate(pinned(*start, normal=law, **more)) for more in ({}, {"axial_clearance": AXIAL}))
    assert list(held.contact.values) == ["pin"]
    assert list(free.contact.values) == ["pin.end_1", "pin.end_2", "pin.thrust_1", "pin.thrust_2"]
    for found, exact in zip(state(free), state(held), strict=True):
        assert found == pytest.approx(exact, abs=1e-9)
    assert free.joint_force.values == pytest.approx(held.joint_force.values, abs=1e-6)


@pytest.mark.parametrize("kind", ["clearance-revolute", "clearance-cylindrical"])
def test_tilting_pins_touch_the_ends_of_their_journals_as_in_a_second_derivation(kind: str) -> None:
    """One end, then the other or a collar; the run and SciPy's are both good to about 1e-10."""
    velocity, omega, crown = [0.1, 0.05, 0.2], [4.0, 2.0, 3.0], 0.015
    thrust = {"axial_clearance": AXIAL, "thrust_radius": crown} if kind == "clearance-revolute" else {}
    dataset = simulate(pinned(velocity, omega, kind, **thrust))
    assert len(impacts(dataset)["start"]) >= 2
    ends, z = rims(BEARING, PIN, RADIAL, 0.5 * STIFFNESS), np.array([0.0, 0.0, 1.0])
    collars = [(s * (0.5 * BEARING + AXIAL + crown) * z, s * 0.5 * BEARING * z, s * z) for s in (1.0, -1.0)]
    faces = corners(collars, STIFFNESS, crown)

    def push(p: np.ndarray, R: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        both = [ends(p, R), *([faces(p, R)] if thrust else [])]
        return np.concatenate([forces for forces, _ in both]), np.concatenate([points for _, points in both])

    known = final_state(push, 0.05 * np.sqrt(MASS / STIFFNESS), MASS, INERTIA, velocity, omega, 0.005)
    for found, exact in zip(state(dataset), known, strict=True):
        assert found == pytest.approx(exact, abs=1e-7 * max(1.0, float(np.abs(exact).max())))
    assert np.abs(dataset.energy_error.values).max() < 1e-8 * float(dataset.kinetic[0])
    force = dataset.joint_force.sel(joint="pin").values
    assert force == pytest.approx(MASS * dataset.acceleration.sel(body="body").values, abs=1e-9 * np.abs(force).max())


def test_an_ideal_start_presses_both_ends_of_a_tilted_pin_and_a_collar() -> None:
    """By the lever: a force at 0.8 of the half length and one along the axis."""
    table, at = pinned([0.0] * 3, axial_clearance=AXIAL), 0.4 * BEARING
    table["body"]["body"]["frames"]["P"] = {"position": [0.0, 0.0, at]}
    table["load"] = {
        "across": {"type": "point-force", "frame": "body.P", "force": [-30.0, 0.0, 0.0]},
        "along": {"type": "point-force", "frame": "body.F", "force": [0.0, 0.0, -20.0]},
    }
    table["joint"]["pin"]["normal"] = LINEAR | {"stiffness": 1e8}
    table["start"] = {"at": "ideal"}
    dataset = simulated(Scene.model_validate(table))
    assert dataset.contact_normal_force.values[0] == pytest.approx([27.0, 3.0, 20.0, 0.0], rel=1e-4, abs=1e-4)


# Flat faces of collars: a ring on a plane, by points around ----------------------------------------------------------
RING, TOUCHES = 0.02, 12
FLAT: Table = {"axial_clearance": AXIAL, "collar_radius": RING, "collar_points": TOUCHES, "clearance": 5e-3}


def test_a_tilted_collar_touches_first_at_its_lowest_point() -> None:
    """Turned by a about y it reaches the journal's end where its ring is lowest, radius sin(a) ahead of its middle."""
    speed, tilt = 0.2, 4e-3
    table = pinned([0.0, 0.0, -speed], **FLAT)
    table["body"]["body"]["pose"] = {"position": [0.0, 0.0, 0.0], "rotation_vector": [0.0, tilt, 0.0]}
    dataset = simulate(table)
    way = (AXIAL + 0.5 * BEARING * (1.0 - np.cos(tilt)) - RING * np.sin(tilt)) / np.cos(tilt)
    found = impacts(dataset, contact="pin.thrust_1_1")
    assert found["start"][0] == pytest.approx(way / speed, abs=1e-11)
    assert found["approach"][0] == pytest.approx(speed * np.cos(tilt), rel=1e-9)
    assert dataset.event_contact.values[0] == "pin.thrust_1_1"
    assert np.abs(dataset.energy_error.values).max() < 1e-8 * float(dataset.kinetic[0])


def test_a_flat_collar_rests_all_around_and_resists_tilt_as_a_ring_does() -> None:
    """A force F and a moment M < F r/2: depth F/K, tilt 2 M/(K r^2), at any azimuth; the points' forces are F/n and
    that of the tilt."""
    load, moment, azimuth = 30.0, 0.1, 0.3
    table = pinned([0.0] * 3, **FLAT)
    axis = [-np.sin(azimuth), np.cos(azimuth), 0.0]
    table["load"] = {
        "along": {"type": "point-force", "frame": "body.F", "axes": "frame", "force": [0.0, 0.0, -load]},
        "tilt": {"type": "point-torque", "frame": "body.F", "torque": [moment * one for one in axis]},
        # nothing else holds the pin across its axis
        "hold": {"type": "spring-damper", "between": ["ground.F", "body.F"], "stiffness": 10.0, "free_length": 0.0},
    }
    table["body"]["body"]["pose"] = {"position": [0.0, 0.0, -AXIAL]}
    table["start"] = {"at": "equilibrium"}
    dataset = simulate(table)
    forces = dataset.contact_normal_force.values[0]
    around = np.array([f"pin.thrust_1_{k + 1}" for k in range(TOUCHES)])
    touching = np.isin(dataset.contact.values, around)
    angles = 2.0 * np.pi * np.arange(TOUCHES) / TOUCHES
    # the points are half a length above the body's middle, towards which the force turns with the tilt
    moment /= 1.0 - load * BEARING / (STIFFNESS * RING**2)
    known = load / TOUCHES + 2.0 * moment / (RING * TOUCHES) * np.cos(angles - azimuth)
    # the spring takes 10 N/m times 0.2 mm of the load; squares of the tilt
    assert forces[touching] == pytest.approx(known, abs=4e-4)
    assert forces[~touching] == pytest.approx(np.zeros(TOUCHES + 2), abs=1e-12)
    q = dataset.quaternion.sel(body="body").values[0]
    assert 2.0 * q[1:3] == pytest.approx(2.0 * moment / (STIFFNESS * RING**2) * np.array(axis[:2]), rel=1e-3)


def test_a_flat_collar_brakes_a_turning_pin_by_friction_at_its_radius() -> None:
    """All around: the torque is mu F r, whatever the number of points."""
    load, rate = 30.0, 200.0
    rough = {"law": "ambrosio", "dynamic": 0.1, "v0": 0.0, "v1": 1e-3}
    table = pinned([0.0] * 3, [0.0, 0.0, rate], **FLAT, friction=rough)
    table["load"] = {"along": {"type": "point-force", "frame": "body.F", "force": [0.0, 0.0, -load]}}
    depth = load / STIFFNESS
    table["body"]["body"]["pose"] = {"position": [0.0, 0.0, -AXIAL - depth]}
    table["joint"]["pin"]["initial_approach_speed"] = {f"thrust_1_{k + 1}": 0.0 for k in range(TOUCHES)}
    dataset = simulate(table)
    slower = 0.1 * load * RING / INERTIA[2] * dataset.time.values
    assert dataset.angular_velocity.sel(body="body").values[:, 2] == pytest.approx(rate - slower, rel=1e-6)


def test_an_ideal_start_presses_all_points_of_a_flat_collar() -> None:
    table = pinned([0.0] * 3, **FLAT)
    table["load"] = {"along": {"type": "point-force", "frame": "body.F", "force": [0.0, 0.0, -24.0]}}
    table["start"] = {"at": "ideal"}
    forces = simulated(Scene.model_validate(table)).contact_normal_force.values[0]
    assert forces == pytest.approx([0.0, 0.0, *[2.0] * TOUCHES, *[0.0] * TOUCHES], abs=1e-6)


#: change of the joint, and what the refusal says
REFUSED_PINS: dict[str, tuple[Table, str]] = {
    "flat and crowned": (FLAT | {"thrust_radius": 0.02}, "give one"),
    "flat without gap": ({"collar_radius": 0.02}, "axial_clearance"),
    "points without faces": ({"axial_clearance": AXIAL, "collar_points": 8}, "collar_points is of flat faces"),
    "collar in the hole": (FLAT | {"collar_radius": 0.005}, "more than the journal's radius, 0.015 m"),
    "collar of steel": (FLAT | {"normal": {"law": "hertz"}, "pin_material": STEEL, "journal_material": STEEL},
                        "the stiffness of flat faces is unknown"),
    "collar without gap": ({"thrust_radius": 0.02}, "axial_clearance"),
    "wear": ({"axial_clearance": AXIAL, "wear": {"coefficient": 1e-4, "hardness": 2e9}}, "is not computed"),
    "unknown end": ({"initial_approach_speed": {"end_1": 0.1}}, "none, as the joint is one contact"),
}  # fmt: skip


@pytest.mark.parametrize("case", REFUSED_PINS)
def test_a_pin_that_cannot_tilt_is_refused_in_words(case: str) -> None:
    changed, words = REFUSED_PINS[case]
    with pytest.raises(ValueError, match=words):
        Scene.model_validate(pinned([0.0] * 3, **changed))
