"""Teeth with backlash, and other ends of combined coordinates, against closed forms."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from flexclear.dynamics.model.mechanism import build
from flexclear.dynamics.model.model import tabulate
from flexclear.dynamics.sensitivity.dataset import sensitivities
from flexclear.post.answers.effect_sizes import IDEAL
from flexclear.scene.ends import Gear
from flexclear.scene.load import load_scene
from flexclear.scene.schema import Scene
from flexclear.scene.variants import effects, ideal_scene
from flexclear.study import compare
from flexclear.study.effects import removals
from flexclear.system.errors import InputError
from flexclear.system.progress import silent
from tests.analytic.mechanism_runs import TREE, impacts
from tests.properties.mechanisms import GRAVITY, Table, frame, ground, joint, rigid, scene, simulate

PLAY, STIFFNESS, RATIO, INERTIAS = 0.01, 400.0, -1.5, (0.02, 0.05)
#: of the play's coordinate, second - ratio first
REDUCED = 1.0 / (1.0 / INERTIAS[1] + RATIO**2 / INERTIAS[0])


def wheels(teeth: Table, speeds: tuple[float, float], **more: Any) -> Table:
    """Two wheels on the ground, about x, with a gear between them."""
    turn = [0.0, np.pi / 2.0, 0.0]
    bodies: Table = {"ground": {"type": "ground", "frames": {}}}
    for k, (inertia, speed) in enumerate(zip(INERTIAS, speeds, strict=True)):
        at = frame([0.0, 0.3 * k, 0.0], turn)
        bodies["ground"]["frames"][f"W{k}"] = at
        bodies[f"wheel{k}"] = rigid(
            1.0, [inertia] * 3, {"O": frame([0.0] * 3, turn)}, angular_velocity=[speed, 0.0, 0.0]
        ) | {"pose": {"position": at["position"]}}
    joints = {f"w{k}": joint("revolute", f"ground.W{k}", f"wheel{k}.O") for k in range(2)}
    gear = {"first": "w0", "second": "w1", "ratio": RATIO, "backlash": PLAY, **teeth}
    return scene(bodies, joints, gear={"mesh": gear}, **more)


def between_flanks(t: np.ndarray, speed: float) -> np.ndarray:
    """The play's coordinate from the middle on, at a speed, with lossless flanks: half sines and straight lines."""
    omega = np.sqrt(STIFFNESS / REDUCED)
    way, contact = PLAY / speed, np.pi / omega
    s = (t + 0.5 * way) % (2.0 * (way + contact))
    sense = np.where(s < way + contact, 1.0, -1.0)
    s = s % (way + contact)
    beyond = np.where(s < way, -0.5 * PLAY + speed * s, 0.5 * PLAY + speed / omega * np.sin(omega * (s - way)))
    return sense * beyond


def test_teeth_rattle_between_their_flanks_by_half_sines() -> None:
    """Over some turns: the torques of the teeth keep I1 w1 + ratio I2 w2 from the pair's momentum, and the energy."""
    speeds = (20.0, 20.0 * RATIO + 1.0)
    found = simulate(wheels({"stiffness": STIFFNESS}, speeds, end=0.9))
    first, second = (found.joint_position.sel(coordinate=f"w{k}").values for k in (0, 1))
    assert first[-1] > 4.0 * np.pi
    t = found.time.values
    # located contacts at rtol 1e-12 of some radians
    assert second - RATIO * first == pytest.approx(between_flanks(t, 1.0), abs=1e-9)
    steady = (INERTIAS[0] * first + RATIO * INERTIAS[1] * second) / t.clip(1e-9)
    assert steady[1:] == pytest.approx(INERTIAS[0] * speeds[0] + RATIO * INERTIAS[1] * speeds[1], rel=1e-9)
    closing = impacts(found, contact="mesh.upper")["start"]
    contact = np.pi / np.sqrt(STIFFNESS / REDUCED)
    every = 0.5 * PLAY + 2.0 * (PLAY + contact) * np.arange(len(closing))
    assert len(closing) > 3
    assert closing == pytest.approx(every, abs=1e-10)
    assert closing[0] == pytest.approx(every[0], abs=1e-12)
    force = found.gear_force.sel(gear="mesh").values
    inside = np.abs(between_flanks(t, 1.0)) - 0.5 * PLAY
    expected = -STIFFNESS * np.sign(second - RATIO * first) * inside.clip(0.0)
    assert force == pytest.approx(expected, abs=1e-6 * STIFFNESS * PLAY)
    assert np.abs(found.energy_error).max() < 1e-8 * found.kinetic.max()


def test_stiff_teeth_without_much_play_follow_the_ideal_gear() -> None:
    """Pushed by a steady torque on the first wheel they rest on one flank, where the load's share bends them."""
    push = {"push": {"type": "joint-force", "joint": "w0", "force": 3.0}}
    ideal = simulate(wheels({"backlash": None}, (0.0, 0.0), load=push, end=0.1, rtol=1e-10))
    whole = INERTIAS[0] + RATIO**2 * INERTIAS[1]
    torque, off = 3.0 / whole * RATIO * INERTIAS[1], list[float]()
    assert ideal.gear_force.sel(gear="mesh").values == pytest.approx(torque, rel=1e-9)
    for stiffness, play in ((1e4, 1e-4), (1e5, 1e-5)):
        damping = 2.0 * np.sqrt(stiffness * REDUCED)
        teeth = {"backlash": play, "stiffness": stiffness, "damping": damping}
        found = simulate(wheels(teeth, (0.0, 0.0), load=push, end=0.1, rtol=1e-10))
        last = [found.joint_position.sel(coordinate=f"w{k}").values[-1] for k in (0, 1)]
        # second < 0 leads the pinion's torque: the upper flank touches, critically damped long since
        assert last[1] - RATIO * last[0] == pytest.approx(0.5 * play - torque / stiffness, rel=1e-6)
        assert found.gear_force.sel(gear="mesh").values[-1] == pytest.approx(torque, rel=1e-6)
        off.append(abs(last[0] - ideal.joint_position.sel(coordinate="w0").values[-1]))
    assert off[1] < 0.15 * off[0]


def test_teeth_take_up_their_load_in_an_equilibrium_and_over_phases(tmp_path: Path) -> None:
    """A rack hangs on a held pinion: K x = m g. An event, and a run that goes on, know the middle of the backlash."""
    mass, g, r = 0.5, 9.81, 0.1
    bodies = {
        "ground": {
            "type": "ground",
            "frames": {"P": frame([0.0] * 3, [-np.pi / 2.0, 0.0, 0.0]), "R": frame([0.1, 0.0, 0.0])},
        },
        "pinion": rigid(1.0, 1e-3, {"O": frame([0.0] * 3, [-np.pi / 2.0, 0.0, 0.0])}),
        "rack": rigid(mass, 1e-3, {"O": frame([0.0] * 3)}) | {"pose": {"position": [0.1, 0.0, 0.0]}},
    }
    joints = {"pinion": joint("revolute", "ground.P", "pinion.O"), "rack": joint("prismatic", "ground.R", "rack.O")}
    teeth = {"first": "pinion", "second": "rack", "ratio": "-100 mm/rad", "backlash": "0.4 mm", "stiffness": 1e5}
    brake = {"type": "joint-spring", "joint": "pinion", "stiffness": 500.0, "damping": 1.0}
    made = scene(bodies, joints, gear={"mesh": teeth}, load={**GRAVITY, "brake": brake}, end=0.2)
    resting = simulate(made | {"start": {"at": "equilibrium"}})
    rack, pinion = (resting.joint_position.sel(coordinate=name).values for name in ("rack", "pinion"))
    assert pinion == pytest.approx(r * mass * g / 500.0, rel=1e-9)
    assert rack + r * pinion == pytest.approx(-0.2e-3 - mass * g / 1e5, rel=1e-9)
    assert resting.gear_force.sel(gear="mesh").values == pytest.approx(mass * g, rel=1e-9)
    # falls from the middle, and goes on from an event at which nothing changes
    free = simulate(made)
    loosed = made | {"load": {**made["load"], "spare": {"type": "joint-force", "joint": "pinion", "force": 0.0}}}
    phases = simulate(loosed | {"event": {"loose": {"at": "0.1 s", "release": "load.spare"}}})
    for name in ("rack", "pinion"):
        known, found = (one.joint_position.sel(coordinate=name).values[-1] for one in (free, phases))
        assert found == pytest.approx(known, abs=1e-9)
    # another run begins with the last row of this one
    half = simulate(made | {"time": {"end": 0.1}})
    half.to_netcdf(tmp_path / "run.nc")
    going_on = simulate(made | {"time": {"start": 0.1, "end": 0.2}, "start": {"from": str(tmp_path / "run.nc")}})
    assert going_on.joint_position.sel(coordinate="rack").values[-1] == pytest.approx(
        free.joint_position.sel(coordinate="rack").values[-1], abs=1e-9
    )


def test_a_rattle_has_derivatives_by_backlash_and_stiffness() -> None:
    """After a flank the play's coordinate is b - v (t - pi sqrt(I/K)); the second wheel turns by I/I2 of its change."""
    loose = Scene.model_validate(wheels({"stiffness": STIFFNESS}, (20.0, 20.0 * RATIO + 1.0), end=0.022))
    keys = ["gear.mesh.backlash", "gear.mesh.stiffness"]
    found = sensitivities(loose, {}, silent, ["w1.joint_position"], keys)["w1.joint_position"]
    share = REDUCED / INERTIAS[1]
    known = [share, -share * 0.5 * np.pi * np.sqrt(REDUCED) * STIFFNESS**-1.5]
    assert [float(found.sel(parameter=key).values[-1]) for key in keys] == pytest.approx(known, rel=1e-6)


def test_a_stop_of_two_coordinates_is_a_buffer_between_their_bodies() -> None:
    """Two sliders of 1 and 3 kg on a rail: an elastic collision exchanges momentum as in the textbook."""
    speeds, masses, least = (2.0, -0.5), (1.0, 3.0), 0.1
    bodies: Table = {"ground": ground(R=[0.0] * 3)}
    for k in range(2):
        bodies[f"s{k}"] = rigid(masses[k], 1.0, {"O": frame([0.0] * 3)}, velocity=[0.0, 0.0, speeds[k]])
        bodies[f"s{k}"]["pose"] = {"position": [0.0, 0.0, 0.5 * k]}
    joints = {f"p{k}": joint("prismatic", "ground.R", f"s{k}.O") for k in range(2)}
    law = {"law": "hertz", "stiffness": 1e6}
    buffer = {"joint": "p1", "relative_to": "p0", "lower": least, "normal": law}
    found = simulate(scene(bodies, joints, stop={"buffer": buffer}, end=0.3))
    (start,) = impacts(found, contact="buffer.lower")["start"]
    assert start == pytest.approx((0.5 - least) / (speeds[0] - speeds[1]), abs=1e-12)
    total, momentum = sum(masses), sum(m * v for m, v in zip(masses, speeds, strict=True))
    for k in range(2):
        after = 2.0 * momentum / total - speeds[k]
        assert found.joint_velocity.sel(coordinate=f"p{k}").values[-1] == pytest.approx(after, rel=1e-9)


def test_the_play_of_teeth_is_an_effect_that_the_ideal_mechanism_lacks() -> None:
    loose = Scene.model_validate(wheels({"stiffness": STIFFNESS}, (1.0, 0.0)))
    assert [(one.name, one.kind) for one in effects(loose)] == [("gear.mesh.backlash", "backlash")]
    assert ideal_scene(loose).gear["mesh"] == Gear(first="w0", second="w1", ratio=RATIO)
    assert loose.stop_ends() == ["mesh.lower", "mesh.upper"]
    assert ideal_scene(loose).stop_ends() == []
    assert [one.name for one in compare.ideal_scenes(loose, "clearance")] == [f"{loose.name} without clearance"]
    # nothing else is ideal there, so that it is listed as that effect
    together, alone = (removals(loose, effects(loose), IDEAL)[name] for name in (IDEAL, "gear.mesh.backlash"))
    assert together == alone == {"gear.mesh.backlash"}


HERTZ = {"law": "hertz", "stiffness": 1.0}
STOP = {"joint": "A", "upper": 0.1, "normal": HERTZ}
TEETH = {"first": "sun", "second": "P1", "ratio": -1.0, "backlash": "1 deg", "stiffness": 1e4}
#: scene and part -> what is wrong of it, and what is said
WRONG: dict[tuple[str, str], list[tuple[Table, tuple[str, ...]]]] = {
    ("stops", "stop.s"): [
        (STOP | {"ratio": 2.0}, ("relative_to", "give both")),
        (STOP | {"relative_to": "A"}, ("stop.s.relative_to", "is the coordinate itself")),
        (STOP | {"relative_to": "B", "ratio": "1 m"}, ("stop.s.ratio", "number")),
        (STOP | {"relative_to": "K"}, ("stop.s.relative_to", "no joint 'K'")),
    ],
    ("gears", "gear.g"): [
        (TEETH | {"backlash": "-1 deg"}, ("gear.g.backlash", "must be positive, not -0.0174533 rad", "rigid teeth")),
        (TEETH | {"backlash": "1 mm"}, ("gear.g.backlash", "a length", "angle")),
        (TEETH | {"stiffness": None}, ("stiffness, normal says how stiff the teeth are", "nothing does")),
        (TEETH | {"stiffness": -1.0}, ("gear.g.stiffness", "greater than 0")),
        (TEETH | {"backlash": None}, ("stiffness is of teeth with a backlash",)),
        (TEETH | {"normal": HERTZ}, ("stiffness and normal do",)),
        (TEETH | {"stiffness": None, "normal": HERTZ, "damping": 1.0}, ("damping belongs to stiffness",)),
        (TEETH | {"stiffness": None, "normal": {"law": "hertz"}}, ("stiffness of a flank is unknown",)),
    ],
}


@pytest.mark.parametrize("where, part, table, words", [(*at, *case) for at, cases in WRONG.items() for case in cases])
def test_teeth_and_ends_that_cannot_be_are_refused_in_words(
    where: str, part: str, table: Table, words: tuple[str, ...]
) -> None:
    with pytest.raises(InputError) as error:
        tabulate(build(load_scene(TREE / "scenes" / "checks" / f"{where}.toml", {part: table}), {}))
    assert part in str(error.value)
    assert [word for word in words if word not in str(error.value)] == []
