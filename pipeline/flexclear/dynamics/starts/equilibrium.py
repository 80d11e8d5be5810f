"""Start at the static equilibrium of a scene, with drives and given joint coordinates held."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from flexclear.artifacts.labelled import Labelled
from flexclear.dynamics.linear.bench import state
from flexclear.dynamics.linear.equilibrium import balanced
from flexclear.dynamics.model.driving import joint_drives
from flexclear.dynamics.model.start_table import given_coordinates
from flexclear.dynamics.starts.snapshot import joint_starts, posed, resting
from flexclear.scene.drives import JointDrive
from flexclear.scene.laws import Constant
from flexclear.scene.schema import Scene
from flexclear.scene.start import JointStart, Start
from flexclear.system.progress import Progress


def begin(scene: Scene, bundles: Mapping[str, Labelled], progress: Progress) -> tuple[Scene, str]:
    """Return the scene at its equilibrium, and how it was assembled; velocities stay as the scene gives them.

    Raises InputError for a scene that cannot be built, SolverError without an equilibrium close to its poses.
    """
    bench, rest, _ = balanced(placed(scene), bundles, progress)
    progress(None, f"starts at the equilibrium: {rest.residual:.2g} N unbalanced, {rest.iterations} iterations")
    rest_state = resting(posed(scene, bench.engine, state(bench, rest.at.q), bench.time), scene.contacts())
    return rest_state, bench.engine.model.mechanism.choice


def placed(scene: Scene) -> Scene:
    """Return the scene with given joint positions held by drives; of its start only position hints remain."""
    assert scene.start is not None
    driven, holds = joint_drives(scene), dict[str, Any](scene.drive)
    for start in given_coordinates(scene):
        drives = driven.get(start.joint, ())
        if start.position is not None and not (drives and drives[start.number]):
            law = Constant(type="constant", value=start.position)
            name = f"hold-{start.joint}-{start.coordinate.name}"
            holds[name] = JointDrive(joint=start.joint, coordinate=start.coordinate.name, law=law)

    def hint(one: JointStart) -> JointStart | None:
        given = one.position is not None or one.near is not None
        return one.model_copy(update={"velocity": None}) if given else None

    hinted = Start(joint=joint_starts(scene.start, hint))
    return scene.model_copy(update={"drive": holds, "start": hinted})
