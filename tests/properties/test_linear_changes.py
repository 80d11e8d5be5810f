"""Exact changes of forces, against differences of the compiled right-hand side over several steps."""

from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from flexclear.dynamics import analyses
from flexclear.dynamics.linear.bench import Bench, balance, hold
from flexclear.dynamics.linear.tangent import Tangent, damping, stiffness, tangent
from flexclear.dynamics.linear.vibrations import vibrations
from flexclear.scene.load import load_scene
from flexclear.scene.schema import Scene
from flexclear.system.progress import silent
from tests.analytic.mechanism_runs import TREE, bundles
from tests.properties.articulated_chains import rods
from tests.properties.mechanisms import GRAVITY, body, frame, joint, scene

#: trees of both kinds, loops, couplings, flexible bodies, contacts, friction in ideal joints, bushings, controllers
NAMES = (
    *("andrews_squeezer", "bifilar_pendulum", "bricard", "bushing", "clearance_chain", "controllers", "gears"),
    *("flexible_slider_crank", "governor", "rubbing_slider_crank", "universal_shaft"),
)


def differences(bench: Bench, at: Tangent, step: float, *, speeds: bool) -> np.ndarray:
    """Central differences of forces along the free motions, (n, n)."""
    columns = []
    for direction in at.Z.T:
        sides = []
        for s in (step, -step):
            if speeds:
                sides.append(at.Z.T @ balance(bench, at.q, s * direction).bias)
            else:
                b = balance(bench, at.q + s * (at.moves @ direction))
                sides.append(at.Z.T @ (b.bias - b.jacobian.T @ at.multipliers))
        columns.append((sides[0] - sides[1]) / (2.0 * step))
    return np.array(columns).T


def agrees(bench: Bench, at: Tangent) -> None:
    """Differences come closer with the square of their step, until rounding is left."""
    for exact, speeds in ((stiffness(bench, at, at.Z)[0], False), (damping(bench, at, at.Z)[0], True)):
        size = np.abs(exact).max(initial=0.0) or 1.0
        # down to far below the speed at which friction begins, 1e-4 m/s, and the depth of a contact
        errors = [np.abs(differences(bench, at, 10.0**-k, speeds=speeds) - exact).max(initial=0.0) for k in range(3, 9)]
        best = int(np.argmin(errors))
        # measured 1e-8 at worst
        assert errors[best] < 1e-7 * size
        assert best == 0 or errors[best] < 0.02 * errors[best - 1] + 1e-7 * size


def pose(scene: Scene, time: float | None = None) -> tuple[Bench, Tangent]:
    """A pose off the equilibrium, the loops closed, the drives moving."""
    bench, q = hold(scene, bundles(scene), silent, time, None, True)
    return bench, tangent(bench, q)


@pytest.mark.parametrize("name", NAMES)
def test_forces_of_check_scenes_change_as_their_differences_say(name: str) -> None:
    agrees(*pose(load_scene(TREE / "scenes" / "checks" / f"{name}.toml"), 0.013))


@pytest.mark.parametrize("name", ["csj", "far_csj_cb"])
def test_forces_in_the_papers_mechanism_change_as_their_differences_say(name: str) -> None:
    agrees(*pose(load_scene(TREE / "scenes" / "sps4" / f"{name}.toml"), 0.09))


@pytest.mark.parametrize("driven", [(), (0, 4)], ids=["free", "driven"])
def test_forces_of_a_deep_tree_change_as_their_differences_say(driven: tuple[int, ...]) -> None:
    """Its bias is summed up of wrenches, which articulated inertias leave next to columns and origins."""
    bench, at = pose(Scene.model_validate(rods(16, ("revolute", "universal"), driven=driven)))
    agrees(bench, at)


def test_friction_at_rest_is_a_strong_damper() -> None:
    """A ball on a plane slides to rest at c (1/m + r^2/I), c = 1.5 mu_s m g / v_s; it rolls and spins freely."""
    mass, radius, inertia, static, slow, g = 2.0, 0.05, 0.002, 0.3, 1e-3, 9.81
    ball = {"type": "rigid", "mass": mass, "inertia": [inertia] * 3, "frames": {"centre": {}}}
    contact = {
        **joint("ball-on-plane", "ground.floor", "ball.centre"),
        "ball_radius": radius,
        "normal": {"law": "hertz", "exponent": 1.0, "stiffness": 1e7},
        "friction": {
            "law": "modified-coulomb", "static": static, "dynamic": 0.2, "v_static": slow, "v_dynamic": 2.0 * slow
        },
        "initial_approach_speed": 1e-3,
    }  # fmt: skip
    bodies = {
        "ground": {"type": "ground", "frames": {"floor": {}}},
        "ball": {**ball, "pose": {"position": [0.0, 0.0, radius - mass * g / 1e7]}},
    }
    found = analyses.frequencies(Scene.model_validate(scene(bodies, {"floor": contact}, load=GRAVITY)), {}, silent)
    rate = 1.5 * static * mass * g / slow * (1.0 / mass + radius**2 / inertia)
    # its arm is shorter than its radius by the depth of the contact, 4e-5 of it
    assert np.sort(found.decay_rate.values)[-2:] == pytest.approx([rate, rate], rel=1e-3)


#: a turn of the world about no axis of its own, and its axes then
TURN = Rotation.from_rotvec([0.3, -0.7, 1.1])


def arm(count: int) -> Scene:
    """An arm of rods of 0.1 m, bent at each hinge; hinges are along gravity, which is along no axis of the world."""
    lean = TURN.as_rotvec().tolist()
    bodies: dict[str, Any] = {"base": {"type": "ground", "frames": {"end": frame((0.0, 0.0, 0.0), lean)}}}
    joints, origin, before = {}, np.zeros(3), "base.end"
    for k in range(count):
        angle = 0.3 * (-1) ** k * (1.0 + 0.1 * k)
        along = TURN.apply([np.cos(angle), np.sin(angle), 0.0])
        ends = {"foot": frame((0.0, 0.0, 0.0), lean), "end": frame(tuple(0.1 * along), lean)}
        bodies[f"rod{k}"] = body(tuple(origin), frames=ends)
        joints[f"hinge{k}"] = joint("revolute", before, f"rod{k}.foot")
        origin, before = origin + 0.1 * along, f"rod{k}.end"
    weight = {"g": {"type": "gravity", "acceleration": (-9.81 * TURN.apply([0.0, 0.0, 1.0])).tolist()}}
    return Scene.model_validate(scene(bodies, joints, end=0.1, load=weight))


def test_an_arm_that_gravity_does_not_move_rests_anywhere() -> None:
    """Rounding of its weights is no stiffness, which the size of all that balances says."""
    bench, q = hold(arm(16), {}, silent, None, None, False)
    found = vibrations(bench, tangent(bench, q))
    assert found.free == 16
    assert found.stable
