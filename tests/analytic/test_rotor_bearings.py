"""Rotors in bearings of unequal stiffness, whose equations vary with the angle of the drive, by Floquet's theorem.

Values: closed forms in fixed axes, multipliers by integration over a turn, and Friswell et al. (2010), *Dynamics of
Rotating Machines*, sec. 5.9.
"""

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import xarray as xr
from scipy.integrate import solve_ivp

from benchmarks.families import turning
from benchmarks.hard_scenes import MASS, rotor
from flexclear.commands.frequencies import text
from flexclear.dynamics import analyses
from flexclear.dynamics.linear import floquet
from flexclear.dynamics.linear.campbell import campbell
from flexclear.scene.load import edited
from flexclear.scene.schema import Scene
from flexclear.system import threads
from flexclear.system.errors import SolverError
from flexclear.system.progress import silent
from tests.analytic.mechanism_runs import frequencies
from tests.properties.mechanisms import Table, joint, rigid, scene

#: 4000 rpm [rad/s]
SPEED = 4000.0 * np.pi / 30.0


@pytest.fixture(autouse=True)
def one_thread() -> Iterator[None]:
    """As in the program: matrices are small."""
    with threads.one():
        yield


def steady(of: Scene) -> xr.Dataset:
    return analyses.frequencies(of, {}, silent, moving=True)


def exponents(found: xr.Dataset) -> np.ndarray:
    """Return lambda of each vibration, with Im >= 0 [1/s]."""
    return np.asarray(2j * np.pi * found.frequency.values - found.decay_rate.values)


def bearing(stiffness: object, frames: tuple[str, str] = ("ground.m", "disc.o"), **more: object) -> Table:
    return {"type": "bushing", "between": list(frames), "stiffness": stiffness, **more}


def supported(speed: float, shaft: tuple[float, float], kx: float, ky: float, **more: object) -> Scene:
    """A disc on a shaft with the stiffness `shaft` across, in turning axes, in a bearing of the ground [N/m]."""
    disc = rotor(speed)
    pose = disc.body["disc"].pose
    assert pose is not None
    changes: Table = {
        "load.shaft.stiffness": [*shaft, 1e8, 1e5, 1e5, 1e5],
        "body.ground.frames.m": {"position": pose.position},
        "load.bearing": bearing([kx, ky, 0, 0, 0, 0]),
    }
    return edited(disc, changes | more)


def multipliers(matrices: Callable[[float], tuple[np.ndarray, ...]], period: float) -> np.ndarray:
    """Return the eigenvalues of the motions x'' = -K x - D x' over a period; matrices: K and D at a time."""

    def rate(t: float, y: np.ndarray) -> np.ndarray:
        K, D = matrices(t)
        x, v = y.reshape(2, len(K), -1)
        return np.concatenate([v, -K @ x - D @ v]).ravel()

    n = 2 * len(matrices(0.0)[0])
    end = solve_ivp(rate, (0.0, period), np.eye(n).ravel(), method="DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
    return np.asarray(np.linalg.eigvals(end.reshape(n, n)))


def turned(angle: float, values: tuple[float, float]) -> np.ndarray:
    c, s = np.cos(angle), np.sin(angle)
    R = np.array([[c, -s], [s, c]])
    return np.asarray(R @ np.diag(values) @ R.T)


def assert_contained(wanted: np.ndarray, found: xr.Dataset, period: float) -> None:
    """Assert that every multiplier is one of the vibrations', and that the fastest growth is the printed one."""
    own = np.exp(exponents(found) * period)
    for value in wanted:
        # integrated to 1e-12, with some hundred steps in a turn
        assert np.abs(np.concatenate([own, own.conj()]) - value).min() < 1e-9 * max(1.0, abs(value))
    growth = np.log(np.abs(wanted).max()) / period
    assert found.attrs["growth"] == pytest.approx(growth if growth > 1e-6 else 0.0, rel=1e-8)


# Rigid rotors ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("speed", [5.0, 300.0, 1000.0])
def test_the_speed_does_not_change_how_a_disc_vibrates_across_on_unequal_springs(speed: float) -> None:
    """With m x'' + c_x x' + k_x x = 0, and likewise y: no gyroscopic moment acts on a motion without tilt."""
    kx, ky, cx, cy = 4e5, 3e5, 60.0, 20.0
    found = steady(supported(speed, (0.0, 0.0), kx, ky, **{"load.bearing.damping": [cx, cy, 0, 0, 0, 0]}))
    assert found.attrs["frequency_axes"] == "fixed"
    for k, c in ((kx, cx), (ky, cy)):
        exact = max(np.roots([MASS, c, k]), key=np.imag)
        # eigenvalues of a matrix with entries up to 6e3 1/s
        assert np.abs(exponents(found) - exact).min() < 1e-9 * abs(exact)
    x = found.frame_translation.sel(frame="disc.o", part="real")[
        np.abs(exponents(found) - np.sqrt(-kx / MASS + 0j)).argmin()
    ]
    assert np.abs(x.values[1:]).max() < 1e-9 * abs(x.values[0])
    assert "frequencies in fixed axes" in text(found.assign_attrs(scene="disc"))


@pytest.mark.parametrize("speed, damping", [(200.0, 0.0), (420.0, 0.0), (450.0, 0.0), (433.0, 30.0)])
def test_a_flat_shaft_in_unequal_bearings_has_the_multipliers_of_its_equations(speed: float, damping: float) -> None:
    """With m r'' + C r' + (K_bearing + R K_shaft R^T) r = 0 with R(Omega t); unstable about 420 to 450 rad/s."""
    shaft, bearings = (3e5, 1e5), (4e5, 3e5)
    found = steady(supported(speed, shaft, *bearings, **{"load.bearing.damping": [damping, damping / 3, 0, 0, 0, 0]}))
    D = np.diag([damping, damping / 3.0]) / MASS
    period = 2.0 * np.pi / speed
    wanted = multipliers(lambda t: ((np.diag(bearings) + turned(speed * t, shaft)) / MASS, D), period)
    assert_contained(wanted, found, period)
    assert (found.attrs["growth"] > 1.0) == (speed > 400.0)


@pytest.mark.parametrize("speed", [50.0, 120.0])
def test_two_blades_on_an_unequal_mount_have_the_multipliers_of_their_equations(speed: float) -> None:
    """(R I R^T + I_mount) a'' + (d/dt(R I R^T) + Omega I_p J) a' + K a = 0 for tilts a in fixed axes."""
    own, polar, mount, stiffness = (0.05, 0.25), 0.3, 0.2, (1e3, 2e3)
    bodies: Table = {
        "ground": {"type": "ground", "frames": {"o": {}}},
        "mount": rigid(5.0, mount, {"o": {}}),
        "blades": rigid(1.0, [*own, polar], {"o": {}}),
    }
    joints = {"float": joint("free", "ground.o", "mount.o"), "axle": joint("revolute", "mount.o", "blades.o")}
    law = {"type": "polynomial", "coefficients": [0.0, speed]}
    loads = {"springs": bearing([1e5, 2e5, 1e6, *stiffness, 1e5], ("ground.o", "mount.o"))}
    found = steady(
        Scene.model_validate(scene(bodies, joints, load=loads, drive={"axle": {"joint": "axle", "law": law}}))
    )

    def matrices(t: float) -> tuple[np.ndarray, ...]:
        inertia = turned(speed * t, own) + mount * np.eye(2)
        quarter = np.array([[0.0, -1.0], [1.0, 0.0]])
        rate = speed * (quarter @ turned(speed * t, own) - turned(speed * t, own) @ quarter)
        inverse = np.linalg.inv(inertia)
        return inverse @ np.diag(stiffness), inverse @ (rate - speed * polar * quarter)

    period = 2.0 * np.pi / speed
    assert_contained(multipliers(matrices, period), found, period)
    assert (found.attrs["growth"] > 1.0) == (speed > 100.0)


@pytest.mark.parametrize("kx, ky", [(4e5, 3e5), (4e5, 4e5)])
def test_a_bearing_in_an_elastic_housing_makes_two_masses_of_either_direction(kx: float, ky: float) -> None:
    """Coordinates of the housing stand still, those of the disc turn: the equations vary with a whole turn."""
    between, housing = 6e5, 2.0
    body = rigid(
        housing, 0.02, {"o": {}}, pose={"position": supported(50.0, (0.0, 0.0), kx, ky).body["disc"].pose.position}
    )
    found = steady(
        supported(
            50.0,
            (0.0, 0.0),
            kx,
            ky,
            **{
                "body.housing": body,
                "joint.housing": joint("free", "ground.m", "housing.o"),
                "load.bearing": bearing([between, between, 0, 0, 0, 0], ("housing.o", "disc.o")),
                "load.mount": bearing([kx, ky, 1e6, 1e3, 2e3, 1e3], ("ground.m", "housing.o")),
            },
        )
    )
    for k in (kx, ky):
        K = np.array([[k + between, -between], [-between, between]]) / np.array([[housing], [MASS]])
        for omega in np.sqrt(np.linalg.eigvals(K)):
            assert np.abs(exponents(found) - 1j * omega).min() < 1e-9 * omega
    assert found.attrs["growth"] == 0.0


@pytest.mark.parametrize("ring, refused", [(50.0, False), (37.0, True)])
def test_bearings_that_another_drive_turns_need_a_common_period(ring: float, refused: bool) -> None:
    """With m r'' + R K R^T r = 0 with R of the ring's angle; the shaft turns at 100 rad/s."""
    stiffness, shaft = (4e5, 3e5), (2e5, 1e5)
    law = {"type": "polynomial", "coefficients": [0.0, ring]}
    place = supported(100.0, shaft, *stiffness).body["disc"].pose.position
    of = supported(
        100.0,
        shaft,
        *stiffness,
        **{
            "body.ring": rigid(1.0, 0.01, {"o": {}}, pose={"position": place}),
            "joint.ring": joint("revolute", "ground.m", "ring.o"),
            "drive.ring": {"joint": "ring", "law": law},
            "load.bearing": bearing([*stiffness, 0, 0, 0, 0], ("ring.o", "disc.o")),
        },
    )
    if refused:
        with pytest.raises(SolverError, match="not the same after a turn"):
            steady(of)
        return
    period = 2.0 * np.pi / ring
    K = multipliers(
        lambda t: ((turned(ring * t, stiffness) + turned(100.0 * t, shaft)) / MASS, np.zeros((2, 2))), period
    )
    assert_contained(K, steady(of), period)


def test_both_whirls_on_unequal_springs_are_critical() -> None:
    """Unbalance drives sqrt(k_x/m) and sqrt(k_y/m): ellipses contain both senses."""
    made = campbell(supported(200.0, (0.0, 0.0), 4e5, 3e5), {}, silent, [0.0, 200.0, 300.0, 340.0, 400.0])
    critical = made.critical_speed.values
    for k in (4e5, 3e5):
        assert np.nanmin(np.abs(critical - np.sqrt(k / MASS))) < 1e-6
        of = 2.0 * np.pi * made.frequency.values[:, np.nanargmin(np.abs(critical - np.sqrt(k / MASS)))]
        assert of == pytest.approx(np.sqrt(k / MASS), rel=1e-8)


# What is refused --------------------------------------------------------------------------------------------------


def test_a_bearing_that_resists_the_rotation_of_its_shaft_is_refused() -> None:
    tilting = {"load.bearing.stiffness": [4e5, 3e5, 0, 1e2, 1e2, 0]}
    with pytest.raises(SolverError, match="may resist its displacement, not its rotation"):
        steady(supported(100.0, (3e5, 3e5), 4e5, 3e5, **tilting))


def test_slow_drives_need_many_harmonics(monkeypatch: pytest.MonkeyPatch) -> None:
    """A flat shaft vibrates many times in a turn, each time about other axes."""
    slow, of = 20.0, ((3e5, 1e5), (4e5, 3e5))
    found = steady(supported(slow, of[0], *of[1]))
    period = 2.0 * np.pi / slow
    K = multipliers(lambda t: ((np.diag(of[1]) + turned(slow * t, of[0])) / MASS, np.zeros((2, 2))), period)
    assert_contained(K, found, period)
    monkeypatch.setattr(floquet, "LARGEST", 100)
    with pytest.raises(SolverError, match="fewer modes or a higher speed"):
        steady(supported(slow, of[0], *of[1]))


def test_a_rotor_without_joint_is_told_the_frames_of_the_bushing_that_turns() -> None:
    """Not those of the bearing, whose joint to the ground would help nothing."""
    alone = supported(100.0, (3e5, 3e5), 4e5, 3e5, **{"joint.float": None})
    loads = {"load.bearing": None, "load.shaft": None}
    first = {"load.bearing": alone.load["bearing"], "load.shaft": alone.load["shaft"]}
    with pytest.raises(SolverError, match=r'between = \["hub.s", "disc.o"\]'):
        steady(edited(edited(alone, loads), first))


def test_a_slot_in_which_the_end_of_a_turning_shaft_slides_is_refused() -> None:
    along = {"axes": {"z": [1.0, 0.0, 0.0], "x": [0.0, 1.0, 0.0]}}
    tip = {"position": [0.0, 0.0, 0.5]}
    overrides = {
        "body.ground.frames.slot": tip | along,
        "body.slider": rigid(1.0, 0.01, {"o": {}, "slot": along}, pose=tip),
        "joint.slot": joint("prismatic", "ground.slot", "slider.slot"),
        "joint.pivot": joint("spherical", "slider.o", "disc.centre"),
    }
    with pytest.raises(SolverError, match="closed loops leave free vary with the angle"):
        frequencies.__wrapped__("checks/overhung_rotor", tuple(overrides.items()), moving=True)


# A flexible shaft with two discs ----------------------------------------------------------------------------------


@cache
def shaft() -> turning.Body:
    whole = turning.CASES["8-5.9.1"]()
    return replace(whole, recipe=whole.recipe | {"elements": 12}, up_to=2e3)


@pytest.mark.parametrize(
    "stiffness, known",
    [
        # example 5.9.2, printed; 5.9.4, by exact transfer matrices; almost 5.9.1, converged
        ((1e6, 0.8e6), [82.33, 86.86, 239.64, 287.25, 583.49, 806.89]),
        ((1e6, 1e6, 0.5e6), [73.2097878, 92.9155927, 208.31636, 312.188177, 561.721074, 840.19362]),
        ((1e6, (1.0 + 1e-6) * 1e6), [85.389, 87.796, 251.781, 294.706, 600.081, 826.657]),
    ],
)
def test_a_two_disc_rotor_has_the_frequencies_of_friswell(stiffness: tuple[float, ...], known: list[float]) -> None:
    found = analyses.frequencies(
        turning.two_discs(shaft(), *stiffness), {"rod": turning.reduced(shaft())}, silent, moving=True
    )
    omega = 2.0 * np.pi * found.frequency.values
    off = [abs(omega[np.argmin(np.abs(omega - value))] / value - 1.0) for value in known]
    # printed digits: 6e-5 of the first; modes above 2 kHz, which are absent, lower the sixth by 2.5e-4
    assert max(off[:4]) < 1e-4
    assert max(off) < 1e-3
    assert (found.attrs["frequency_axes"], found.attrs["growth"]) == ("fixed", 0.0)


def test_the_masses_of_all_modes_are_rounded_and_do_not_vary_with_the_angle() -> None:
    """Frequencies of 150 modes differ by 5e5; values: converged, in fixed axes, by exact transfer matrices."""
    body = replace(shaft(), up_to=None)
    found = turning.vibrations(body, SPEED)
    assert found.attrs["frequency_axes"] == "coordinates"
    turned = 2.0 * np.pi * found.frequency.values
    for value in (85.3894, 87.7958, 251.7805, 294.7058, 600.0813, 826.6568):
        # 12 elements: the sixth of these modes spans three
        assert np.abs(np.abs(turned[:, None] + [SPEED, -SPEED]) - value).min() < 1e-4 * value


def test_equal_bearings_of_the_ground_are_those_of_the_hub() -> None:
    """Constant equations: frequencies in turning axes, and whirls in fixed ones."""
    bundles = {"rod": turning.reduced(shaft())}
    found = analyses.frequencies(turning.two_discs(shaft(), 1e6, 1e6), bundles, silent, moving=True)
    assert found.attrs["frequency_axes"] == "coordinates"
    # eigenvalues up to 1e5 times the lowest
    assert found.frequency.values[:12] == pytest.approx(
        turning.vibrations(shaft(), SPEED).frequency.values[:12], rel=1e-7
    )
    unequal = campbell(turning.two_discs(shaft(), 1e6, 0.8e6), bundles, silent, [SPEED])
    whirls = np.sort(np.abs(2.0 * np.pi * unequal.whirl_frequency.values[0]))
    assert whirls[:4] == pytest.approx([82.33, 86.86, 239.64, 287.25], rel=1e-4)
