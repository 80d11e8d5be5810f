"""By how much members start apart where the scene does not say, on mechanisms of all sizes."""

import pytest

from flexclear.pipeline.core.scene.load import load_scene
from flexclear.pipeline.core.scene.schema import Scene
from flexclear.pipeline.core.system.progress import silent
from flexclear.pipeline.dynamics.model.contacts import arms
from flexclear.pipeline.dynamics.record.ensemble import difference_of_starts
from flexclear.pipeline.dynamics.run.evaluation.engine import Engine
from flexclear.pipeline.dynamics.run.evaluation.start import consistent_start
from flexclear.pipeline.dynamics.run.run import engine_of
from tests.analytic.mechanism_runs import TREE
from tests.properties.mechanisms import Table, frame, ground, joint, rigid, scene


def swinging_bar(size: float) -> Table:
    """A bar of 0.4 sizes on a hinge, whose swing ends at a stop."""
    bar = rigid(1.0, 0.01 * size**2, {"p": {}, "e": frame((0.4 * size, 0.0, 0.0))}, com=[0.2 * size, 0.0, 0.0], pose={})
    normal = {"law": "hunt-crossley", "restitution": 0.8, "stiffness": 1e3 * size**2}
    return scene(
        {"ground": ground(o=(0, 0, 0)), "bar": bar},
        {"A": joint("revolute", "ground.o", "bar.p")},
        end=0.1,
        stop={"A": {"joint": "A", "lower": -0.5, "normal": normal}},
        load={"gravity": {"type": "gravity", "acceleration": [0.0, -9.81 * size, 0.0]}},
    )


def made(scene: Scene) -> tuple[Engine, float]:
    engine = engine_of(scene, {}, silent)
    return engine, difference_of_starts(engine, consistent_start(engine)).perturbation


@pytest.mark.parametrize("size", [1e-5, 1.0, 1e3])
def test_an_angle_differs_by_as_much_whatever_the_size(size: float) -> None:
    engine, difference = made(Scene.model_validate(swinging_bar(size)))
    # 2.5e-8 of the size, in rad
    assert difference / arms(engine.model)[0] == pytest.approx(2.5e-8, rel=1e-12)


def test_a_ball_differs_by_a_thousandth_of_its_clearance() -> None:
    scene = load_scene(TREE / "scenes/checks/clearance_pendulum.toml")
    _, difference = made(scene)
    clearance = min(joint.clearance for joint in scene.contacts().values())
    assert difference == pytest.approx(1e-3 * clearance, rel=1e-12)
