"""Equilibria and vibrations under springs, dampers and forces, against closed forms."""

from typing import Any

import numpy as np
import pytest
import xarray as xr

from flexclear.pipeline.core.scene.schema import Scene
from flexclear.pipeline.dynamics import analyses
from tests.analytic.mechanism_runs import TREE, bundles
from tests.properties.mechanisms import GRAVITY, Table, joint, rigid

G, MASS, STIFFNESS, COUNT, REST = 9.81, 0.4, 900.0, 5, 0.1
SMOOTH = 1e-12  # rounding of some hundred products


def frequencies(table: dict[str, Any], time: float = 0.0) -> xr.Dataset:
    scene = Scene.model_validate({"title": "test", "time": {"end": 1.0}, **table})
    return analyses.frequencies(scene, bundles(scene), lambda fraction, text: None, time)


def chain(damping: float) -> dict[str, Any]:
    """Masses on a vertical rail, each hung from the one above by a spring."""
    body: Table = {"ground": {"type": "ground", "frames": {"top": {}}}}
    joints: Table = {}
    load = dict(GRAVITY)
    spring = {"type": "spring-damper", "stiffness": STIFFNESS, "damping": damping, "free_length": REST}
    for k in range(1, COUNT + 1):
        body[f"m{k}"] = rigid(MASS, 1e-3, {"F": {}}, pose={"position": [0.0, 0.0, -REST * k]})
        joints[f"m{k}"] = joint("prismatic", "ground.top", f"m{k}.F")
        above = "ground.top" if k == 1 else f"m{k - 1}.F"
        load[f"spring{k}"] = spring | {"between": [above, f"m{k}.F"]}
    return {"body": body, "joint": joints, "load": load}


@pytest.mark.parametrize("damping", [0.0, 2.0])
def test_a_hanging_chain_of_springs(damping: float) -> None:
    """Fixed above and free below: omega_i = 2 sqrt(k/m) sin((2 i - 1) pi / (4 n + 2)), ratio c omega / (2 k)."""
    found = frequencies(chain(damping))
    hung = np.cumsum([REST + MASS * G / STIFFNESS * (COUNT - k) for k in range(COUNT)])
    assert found.position.sel(axis="z").values == pytest.approx(-hung, rel=1e-11)
    i = np.arange(1, COUNT + 1)
    omega = 2.0 * np.sqrt(STIFFNESS / MASS) * np.sin((2 * i - 1) * np.pi / (4 * COUNT + 2))
    assert found.undamped_frequency.values == pytest.approx(omega / (2.0 * np.pi), rel=SMOOTH)
    ratio = 0.5 * damping * omega / STIFFNESS
    assert found.damping_ratio.values == pytest.approx(ratio, rel=SMOOTH, abs=0.0)
    assert found.frequency.values == pytest.approx(omega * np.sqrt(1.0 - ratio**2) / (2.0 * np.pi), rel=SMOOTH)
    assert found.load_force.sel(load="spring1").values == pytest.approx([0.0, 0.0, COUNT * MASS * G], rel=1e-9)


def rotor(rest: str, torque: object = 0.0) -> dict[str, Any]:
    spring = {"type": "joint-spring", "joint": "axle", "stiffness": 50.0, "damping": "60 N m s/rad", "rest": rest}
    return {
        "body": {"ground": {"type": "ground", "frames": {"F": {}}}, "rotor": rigid(1.0, [0.2, 0.2, 0.3], {"G": {}})},
        "joint": {"axle": joint("revolute", "ground.F", "rotor.G")},
        "load": {"spring": spring, "motor": {"type": "joint-force", "joint": "axle", "force": torque}},
    }


def test_a_torsional_spring_turns_a_rotor_beyond_half_a_turn_and_a_strong_damper_lets_it_creep() -> None:
    """From 0 to 500 deg; 0.3 l^2 + 60 l + 50 = 0 has two real roots: no vibration."""
    found = frequencies(rotor("500 deg"))
    assert float(found.load_length.sel(load="spring")) == pytest.approx(np.deg2rad(500.0), rel=1e-12)
    roots = np.sort(np.roots([0.3, 60.0, 50.0]))
    assert np.sort(-found.decay_rate.values) == pytest.approx(roots, rel=SMOOTH)
    assert found.frequency.values == pytest.approx([0.0, 0.0], abs=0.0)


def test_loads_are_as_large_as_at_the_time_of_the_pose() -> None:
    law = {"type": "harmonic", "amplitude": [20.0], "frequency": ["3 rad/s"]}
    found = frequencies(rotor("0 deg", law), time=0.4)
    assert float(found.load_length.sel(load="spring")) == pytest.approx(20.0 * np.sin(1.2) / 50.0, rel=1e-12)


def becks_column(load: float) -> xr.Dataset:
    """A clamped beam whose tip is pressed along its own end, in units of E I / L^2."""
    unit = 200e9 * np.pi * 0.002**4 / 4.0
    beam = {
        "type": "flexible",
        "mesh": str(TREE / "meshes" / "checks" / "slender_beam.toml"),
        "modes": {"reference": "craig-bampton", "count": 20},
        "stiffening": {},
    }
    push = {"type": "point-force", "frame": "beam.tip", "force": [0.0, 0.0, -load * unit], "axes": "frame"}
    return frequencies(
        {
            "body": {"ground": {"type": "ground", "frames": {"wall": {}}}, "beam": beam},
            "joint": {"clamp": joint("fixed", "ground.wall", "beam.root")},
            "load": {"push": push},
        }
    )


def test_a_load_that_follows_the_end_of_a_column_makes_it_flutter_and_never_buckle() -> None:
    """Beck's column: two frequencies meet at 20.0509 E I / L^2; forces without a potential, K is not symmetric.

    Sixteen elements and ten bending shapes per plane meet within 1e-3 of it.
    """
    critical = 20.0509
    below, above = (becks_column(fraction * critical) for fraction in (0.998, 1.002))
    lowest = below.frequency.values[:4]
    # both planes alike; the two frequencies of a plane have nearly met
    assert lowest[0] > 0.0
    assert lowest[3] / lowest[0] < 1.2
    largest = np.abs(above.decay_rate.values).max()
    assert largest > 0.01 * 2.0 * np.pi * above.frequency.values[0]
    assert np.abs(below.decay_rate.values).max() < 1e-3 * largest
    # Euler's load of the same column would be pi^2 / 4: it is far beyond that without falling over
    assert becks_column(10.0).frequency.values.min() > 0.0


@pytest.mark.parametrize("turn", [0.3, 1.1, 2.9])
def test_weights_that_balance_leave_no_stiffness_but_rounding(turn: float) -> None:
    """A balance on an oblique axle: what is left of its weights' moments is neither vibration nor instability."""
    arm = np.array([np.cos(turn), np.sin(turn), 0.0]) / 3.0
    table: dict[str, Any] = {
        "body": {
            "ground": {"type": "ground", "frames": {"F": {"axes": {"z": [1.0, 2.0, 3.0], "x": [3.0, 0.0, -1.0]}}}},
            "beam": rigid(0.3, [0.01, 0.01, 0.02], {"G": {}}),
        },
        "joint": {"axle": {"type": "revolute", "between": ["ground.F", "beam.G"]}},
        "load": GRAVITY,
    }
    for name, mass, end in (("near", 1.1, arm), ("far", 0.7, -1.1 / 0.7 * arm)):
        table["body"]["beam"]["frames"][name] = {"position": end.tolist()}
        table["body"][name] = rigid(mass, 1e-3, {"C": {}})
        table["joint"][name] = {"type": "fixed", "between": [f"beam.{name}", f"{name}.C"]}
    found = frequencies(table)
    assert found.attrs["motions_without_stiffness"] == 1
    assert found.frequency.values == pytest.approx([0.0], abs=0.0)
    assert found.decay_rate.values == pytest.approx([0.0], abs=0.0)


def test_a_spring_of_no_length_holds_in_every_direction() -> None:
    """Its ends meet in the equilibrium, where it has no direction."""
    body = rigid(MASS, 1e-3, {"C": {}}, pose={})
    spring = {"type": "spring-damper", "between": ["ground.O", "ball.C"], "stiffness": STIFFNESS, "free_length": 0.0}
    table = {"body": {"ground": {"type": "ground", "frames": {"O": {}}}, "ball": body}, "load": {"s": spring}}
    found = frequencies(table).undamped_frequency.values
    omega = np.sqrt(STIFFNESS / MASS)
    assert found[found > 0.0] == pytest.approx(np.full(3, omega / (2.0 * np.pi)), rel=SMOOTH)
