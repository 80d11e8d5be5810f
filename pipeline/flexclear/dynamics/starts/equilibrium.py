"""Start at the static equilibrium of a scene, with drives and given joint coordinates held."""

from __future__ import annotations

from collections.abc import Mapping

from flexclear.artifacts.labelled import Labelled
from flexclear.dynamics.linear.bench import state
from flexclear.dynamics.linear.equilibrium import bench_in_equilibrium
from flexclear.dynamics.model.start_table import given_coordinates
from flexclear.dynamics.starts.snapshot import joint_starts, with_held_drives, with_poses, with_resting_contacts
from flexclear.scene.laws import Constant
from flexclear.scene.schema import Scene
from flexclear.scene.start import JointStart, Start
from flexclear.system.progress import Progress


def begin(scene: Scene, bundles: Mapping[str, Labelled], progress: Progress) -> tuple[Scene, str]:
    """Return the scene at its equilibrium, and how it was assembled; velocities stay as the scene gives them.

    Raises InputError for a scene that cannot be built, SolverError without an equilibrium close to its poses.
    """
    bench, rest, _ = bench_in_equilibrium(with_placing_joints(scene), bundles, progress)
    progress(None, f"starts at the equilibrium: {rest.residual:.2g} N unbalanced, {rest.iterations} iterations")
    rest_state = with_poses(scene, bench.engine, state(bench, rest.at.q), bench.time)
    return with_resting_contacts(rest_state, scene.contacts(), stops=True), bench.engine.model.mechanism.choice


def with_placing_joints(scene: Scene) -> Scene:
    """Return the scene with given joint positions held by drives; of its start only position hints remain."""
    assert scene.start is not None
    holds = with_held_drives(scene, given_coordinates(scene), lambda _, value: Constant(type="constant", value=value))

    def hint(one: JointStart) -> JointStart | None:
        given = one.position is not None or one.near is not None
        return one.model_copy(update={"velocity": None}) if given else None

    hinted = Start(joint=joint_starts(scene.start, hint))
    hinted._sought = True
    return scene.model_copy(update={"drive": holds, "start": hinted})
