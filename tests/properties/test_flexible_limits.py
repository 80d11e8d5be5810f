"""What a flexible mechanism tends to as it stiffens and its basis completes; loads on it reach its modes."""

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

from flexclear import dynamics
from flexclear.scene.load import load_scene, read_toml
from flexclear.scene.schema import Scene
from flexclear.structure.kinds import kind
from flexclear.structure.modes import bundle
from flexclear.structure.modes.geometric_stiffness import variables
from flexclear.structure.modes.solution import solve
from tests.analytic.mechanism_runs import TREE, bundles

END = 0.01


@cache
def stroke(
    scene: str, changes: tuple[tuple[str, object], ...] = (), stiffer: float = 1.0, elements: int = 12
) -> xr.Dataset:
    """The first 10 ms of the mechanism's stroke; rod 1 changed, its E times a factor."""
    overrides = {
        "time.end": END,
        "output.interval": 2e-5,
        **{f"body.rod1.{k}": v if v != () else {} for k, v in changes},
    }
    loaded = load_scene(TREE / "scenes" / f"{scene}.toml", overrides)
    bundles = {}
    for name, body in loaded.flexible().items():
        recipe = read_toml(Path(body.mesh))
        recipe["material"]["youngs_modulus"] *= stiffer
        grid = kind.build({**recipe, "elements": elements})
        shapes = solve(grid, body.modes.reference, body.modes.count, interfaces=body.modes.interfaces)
        bundles[name] = bundle.build(grid, shapes, variables(grid, shapes))
    return dynamics.simulate(loaded, bundles, lambda fraction, text: None)


def platform(found: xr.Dataset) -> np.ndarray:
    return found.position.sel(body="platform").values


def test_a_rod_of_growing_stiffness_becomes_rigid_as_one_over_e() -> None:
    """Displacements under given loads go as 1/E, and so do the vibrations that the drive's start excites."""
    rigid = platform(stroke("sps4/ideal"))
    factors = np.array([4.0, 16.0, 64.0, 256.0])
    away = [np.abs(platform(stroke("sps4/far_cb", stiffer=f)) - rigid).max() for f in factors]
    # vibrations of 1.4 kHz on, 20 us apart: their largest values are missed by up to a few per cent (0.9 % is found)
    assert np.polyfit(np.log(factors), np.log(away), 1)[0] == pytest.approx(-1.0, abs=0.03)
    assert away[-1] < 1e-8


#: all 24 elastic coordinates of four elements: the same space of shapes in other frames of reference
COMPLETE = {
    "held below": (("modes.reference", "craig-bampton"), ("modes.count", 24)),
    "held above": (("modes.reference", "craig-bampton"), ("modes.count", 24), ("modes.interfaces", ("top", "bottom"))),
    "free": (("modes.reference", "free-free"), ("modes.count", 24)),
}
#: linear shapes in two frames differ by the foreshortening, of second order in the deformation; with it, by the third
AGREEMENT = {"linear": ((), 2e-5), "stiffened": ((("stiffening", ()),), 1e-6)}


@pytest.mark.slow
@pytest.mark.parametrize("other", ["held above", "free"])
@pytest.mark.parametrize("shapes", AGREEMENT)
def test_complete_sets_of_two_reference_conditions_move_the_mechanism_alike(shapes: str, other: str) -> None:
    extra, near = AGREEMENT[shapes]
    first, second = (platform(stroke("sps4/far_cb", COMPLETE[n] + extra, elements=4)) for n in ("held below", other))
    rigid = platform(stroke("sps4/ideal"))
    moved = np.abs(rigid - rigid[0]).max()
    assert np.abs(first - rigid).max() > 1e-4 * moved  # there is something to agree about
    assert second == pytest.approx(first, abs=near * moved)


@pytest.mark.slow
@pytest.mark.parametrize("other", ["held above", "free"])
def test_what_linear_shapes_leave_between_two_frames_is_of_second_order(other: str) -> None:
    """A rod four times as stiff bends a quarter as much: two frames then differ by a quarter as large a share of it."""
    rigid = platform(stroke("sps4/ideal"))
    fractions = []
    for stiffer in (1.0, 4.0):
        first, second = (
            platform(stroke("sps4/far_cb", COMPLETE[n], stiffer, elements=4)) for n in ("held below", other)
        )
        fractions.append(np.abs(second - first).max() / np.abs(first - rigid).max())
    # the rod rings in other frequencies, and rows are taken at other phases of it: 0.263 and 0.276 were found
    assert fractions[1] / fractions[0] == pytest.approx(0.25, rel=0.15)


# Loads and joints with several axes on a flexible rod ---------------------------------------------------------------

LOADS: dict[str, Any] = {
    "gravity": {"type": "gravity", "acceleration": [0.0, 0.0, -9.81]},
    "spring": {
        "type": "spring-damper", "between": ["base.hook", "rod.top"],
        "stiffness": 2e4, "damping": 5.0, "free_length": 0.05,
    },
    "push": {"type": "point-force", "frame": "rod.top", "force": [0.0, 20.0, 5.0], "axes": "frame"},
    "twist": {"type": "point-torque", "frame": "rod.top", "torque": [0.5, 0.0, 0.2]},
    "coil": {"type": "joint-spring", "joint": "U", "coordinate": "first", "stiffness": 30.0, "damping": 0.01},
    "rub": {"type": "joint-friction", "joint": "U", "coordinate": "second", "viscous": 0.02},
}  # fmt: skip
#: parallel to rod.bottom, whose z is along the rod, so that the joint's axes are square whichever frame is first
CROSS = {"axes": {"z": [1, 0, 0], "x": [0, 1, 0]}}


def scene(swapped: bool, driven: bool) -> Scene:
    between = ["rod.bottom", "base.U"] if swapped else ["base.U", "rod.bottom"]
    drive = {"type": "harmonic", "amplitude": [0.02], "frequency": ["20 Hz"], "phase": ["90 deg"], "offset": -0.02}
    table = {
        "title": "rod",
        "time": {"end": 0.01},
        "output": {"interval": 1e-3},
        "solver": {"rtol": 1e-10},
        "body": {
            "base": {"type": "ground", "frames": {"U": CROSS, "hook": {"position": [0.05, 0.0, 0.3]}}},
            "rod": {
                "type": "flexible",
                "mesh": str(TREE / "meshes" / "actuated_rod.toml"),
                "modes": {"reference": "craig-bampton", "count": 13, "interfaces": ["bottom", "top"]},
                "pose": {},
            },
        },
        "joint": {"U": {"type": "universal", "between": between}},
        "load": LOADS,
        "drive": {"second": {"joint": "U", "coordinate": "second", "law": drive}} if driven else {},
    }
    return Scene.model_validate(table)


@cache
def run(swapped: bool, driven: bool) -> xr.Dataset:
    made = scene(swapped, driven)
    return dynamics.simulate(made, bundles(made), lambda fraction, text: None)


@pytest.mark.slow
@pytest.mark.parametrize("driven", [False, True])
def test_the_energy_of_a_loaded_flexible_rod_is_accounted_for(driven: bool) -> None:
    dataset = run(False, driven)
    exchanged = float(np.abs(dataset.load_work).max() + dataset.kinetic.max() + dataset.elastic.max())
    assert float(dataset.modal_coordinate.std("time").max()) > 1e-7  # it vibrates
    # integrated at rtol 1e-10 over a thousand steps of the axial modes
    assert float(np.abs(dataset.energy_error).max()) < 1e-8 * exchanged


@pytest.mark.slow
def test_loads_on_a_rod_that_carries_the_joints_first_axis_are_accounted_for() -> None:
    """The tree meets the joint from its second frame; loads along its coordinates turn with the rod."""
    dataset = run(True, False)
    assert float(np.abs(dataset.joint_position.sel(coordinate="U.first")).max()) > 1e-3  # it turns
    exchanged = float(np.abs(dataset.load_work).max() + dataset.kinetic.max() + dataset.elastic.max())
    assert float(np.abs(dataset.energy_error).max()) < 1e-8 * exchanged
    first = dataset.sel(coordinate="U.first")
    assert dataset.load_length.sel(load="coil").values == pytest.approx(first.joint_position.values, abs=1e-10)
    torque = -30.0 * first.joint_position - 0.01 * first.joint_velocity
    power = (torque * first.joint_velocity).values
    assert dataset.load_power.sel(load="coil").values == pytest.approx(power, abs=1e-9)


@pytest.mark.slow
def test_a_spring_on_a_flexible_tip_has_the_length_between_its_frames() -> None:
    dataset = run(False, False)
    ends = dataset.frame_position.sel(frame=["base.hook", "rod.top"]).values
    assert dataset.load_length.sel(load="spring").values == pytest.approx(
        np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1), abs=1e-13
    )
