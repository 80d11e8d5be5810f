"""Unbalanced rotors at steady speed: their poses below and above the critical speed, and their stability."""

import numpy as np
import pytest
import xarray as xr

from benchmarks.families.classes import ARM, MASS, SIDE, deflection, rotor
from flexclear.pipeline.core.numerics.rotations import rotation_vector_to_matrix
from flexclear.pipeline.core.scene.load import edited
from flexclear.pipeline.core.scene.schema import Scene
from flexclear.pipeline.core.system.errors import SolverError
from flexclear.pipeline.core.system.progress import silent
from flexclear.pipeline.dynamics import analyses
from tests.analytic.mechanism_runs import frequencies
from tests.properties.mechanisms import GRAVITY, Table, joint, rigid, scene

#: no turn, and two about axes that are parallel to none of the world's
TURNS = {"upright": (0.0, 0.0, 0.0), "oblique": (0.7, -1.9, 0.4), "over": (2.0, 1.0, -2.0)}


def axes(turn: str) -> dict[str, list[float]]:
    R = rotation_vector_to_matrix(np.array(TURNS[turn]))
    return {"z": R[:, 2].tolist(), "x": R[:, 0].tolist()}


def damped(scene: Scene, damping: float) -> Scene:
    """The rotor on a shaft that is damped sideways [N s/m] and couples no slope with a deflection."""
    shaft = {"damping": [damping, damping, 0, 0, 0, 0], "stiffness": [SIDE, SIDE, 1e8, 1e6, 1e6, 1e6]}
    return edited(scene, {f"load.shaft.{name}": value for name, value in shaft.items()})


def steady(scene: Scene) -> xr.Dataset:
    return analyses.frequencies(scene, {}, silent, moving=True)


@pytest.mark.parametrize(
    "speed, size, turn",
    [
        (20.0, 1.0, "over"),
        (125.0, 1e-3, "oblique"),
        (150.0, 1.0, "upright"),
        (150.0, 1e3, "oblique"),
        (600.0, 1.0, "over"),
    ],
)
def test_an_unbalanced_disc_turns_where_its_equations_say(speed: float, size: float, turn: str) -> None:
    unbalance = 1e-5
    found = steady(rotor(speed, unbalance, axes(turn), size))
    x = deflection(speed)
    # the deflection, 1e-4 of the arm at most, enters in second order
    R = rotation_vector_to_matrix(np.array(TURNS[turn]))
    place = R.T @ found.frame_position.sel(frame="disc.o").values - [0.0, 0.0, ARM * size]
    assert place[0] == pytest.approx(x * unbalance * size, rel=1e-3)
    assert np.abs(place[1]) < 1e-3 * abs(place[0])
    assert found.attrs["growth"] == 0.0


@pytest.mark.parametrize(
    "unbalance, turn", [(0.0, "oblique"), (1e-9, "over"), (1e-6, "upright"), (1e-6, "oblique"), (1e-3, "over")]
)
def test_neither_direction_nor_unbalance_makes_a_rotor_unsteady(unbalance: float, turn: str) -> None:
    """Nor does it change the frequencies, but for the unbalance's own inertia: m e^2 is 1.5e-4 of I_t at 1 mm."""
    found = steady(rotor(20.0, unbalance, axes(turn)))
    upright = steady(rotor(20.0))
    assert found.frequency.values == pytest.approx(upright.frequency.values, rel=2e-4 if unbalance > 1e-4 else 1e-8)


def test_weight_across_an_axle_is_unsteady_still() -> None:
    weight = {**GRAVITY["gravity"], "acceleration": [0.0, 0.0, -1e-4]}
    with pytest.raises(SolverError, match="not steady"):
        steady(edited(rotor(20.0, 1e-6, axes("oblique")), {"load.weight": weight}))


@pytest.mark.parametrize("speed, turn", [(200.0, "upright"), (300.0, "oblique")])
def test_damping_in_the_shaft_makes_the_forward_whirl_grow_above_the_critical_speed(speed: float, turn: str) -> None:
    """In turning axes m (r'' + 2 i Omega r' - Omega^2 r) + c r' + k r = 0; Genta (2005), sec. 2.5.2."""
    damping = 20.0
    roots = np.roots([MASS, 2j * MASS * speed + damping, SIDE - MASS * speed**2])
    growth = float(max(roots.real))
    assert (growth > 0.0) == (speed > np.sqrt(SIDE / MASS))
    # differences of forces to 1e-9, frequencies up to 1e4 rad/s
    found = steady(damped(rotor(speed, 1e-6, axes(turn)), damping))
    assert found.attrs["growth"] == pytest.approx(max(growth, 0.0), rel=1e-4)


@pytest.mark.parametrize("speed, unbalance", [(40.0, 1e-3), (100.0, 1e-3), (100.0, 1e-6)])
def test_a_flexible_shaft_holds_its_unbalanced_disc_above_the_critical_speed_too(
    speed: float, unbalance: float
) -> None:
    """The overhung rotor of the checks, about an oblique axis; deflection as of `deflection`."""
    overrides = (
        ("drive.axle.law.coefficients", (0.0, speed)),
        ("body.disc.com", (unbalance, 0.0, 0.0)),
        ("body.disc.pose", None),
        ("body.ground.frames.axle", {"axis": (1.0, 2.0, 3.0)}),
    )
    found = frequencies.__wrapped__("checks/overhung_rotor", overrides, moving=True)
    K = 200e9 * np.pi * 0.01**4 / 4.0 / 0.5**3 * np.array([[12.0, -3.0], [-3.0, 1.0]])
    x = np.linalg.solve(K - speed**2 * np.diag([10.0, -0.1]), [10.0 * speed**2 * unbalance, 0.0])[0]
    axis = np.array([1.0, 2.0, 3.0]) / np.sqrt(14.0)
    place = found.frame_position.sel(frame="disc.centre").values
    away = place - axis * (axis @ place)
    # the shaft's own mass is 1.6e-5 of the disc's, and its linear modes shorten nothing
    assert np.linalg.norm(away) == pytest.approx(abs(x), rel=1e-3)
    assert found.attrs["growth"] == 0.0


@pytest.mark.parametrize("speed, unbalance", [(100.0, 3e-4), (100.0, 1e-3), (100.0, 1e-2), (150.0, 3e-3)])
def test_no_motion_of_an_undamped_rotor_grows_by_rounding(speed: float, unbalance: float) -> None:
    """Its centrifugal and elastic forces balance: rounding of both remains in the forces per speed, 2e-6 1/s of it."""
    overrides = (("drive.axle.law.coefficients", (0.0, speed)), ("body.disc.com", (unbalance, 0.0, 0.0)))
    assert frequencies.__wrapped__("checks/overhung_rotor", overrides, moving=True).attrs["growth"] == 0.0


def test_a_rotor_on_a_bushing_alone_is_refused_with_its_remedy() -> None:
    alone = edited(rotor(20.0, 1e-6), {"joint.float": None})
    with pytest.raises(SolverError, match=r'disc is held by no joint.*type `free`.*between = \["hub.s", "disc.o"\]'):
        steady(alone)


@pytest.mark.parametrize("speed", [4.0, 12.0])
def test_an_arm_that_turns_fast_rises_to_its_stable_angle(speed: float) -> None:
    """A point on a hinged arm l: at rest below, above sqrt(g/l) at cos(angle) = g/(l Omega^2); Goldstein, ch. 2."""
    length, inertia = 0.4, 1e-6
    bodies: Table = {
        "ground": {"type": "ground", "frames": {"o": {}}},
        "hub": rigid(1.0, 1.0, {"o": {}, "h": {"axes": {"z": [0.0, 1.0, 0.0], "x": [0.0, 0.0, -1.0]}}}),
        "bob": rigid(1.0, inertia, {"h": {"position": [-length, 0.0, 0.0]}, "tip": {}}),
    }
    table = scene(
        bodies,
        {"axle": joint("revolute", "ground.o", "hub.o"), "hinge": joint("revolute", "hub.h", "bob.h")},
        load=GRAVITY,
        start={"joint": {"hinge": {"position": 0.1}}},
        drive={"motor": {"joint": "axle", "law": {"type": "polynomial", "coefficients": [0.0, speed]}}},
    )
    found = steady(Scene.model_validate(table))
    height = -found.frame_position.sel(frame="bob.tip", axis="z").item() / length
    # the bob's own inertia is 6e-6 of m l^2
    assert height == pytest.approx(min(1.0, 9.81 / (length * speed**2)), rel=1e-5)
    assert found.attrs["growth"] == 0.0
