"""Where a run may begin, other than where its scene puts the bodies. To add one: a module here, and its name in
`Start.at`, core/scene/start.

Each module has a function ``begin(scene, bundles, progress) -> (Scene, str)``: the scene with the poses, velocities and
modal coordinates of that start instead of what it says itself, and `Mechanism.choice` of what they were found by;
and ``placed(scene) -> Scene``: the one whose joints and drives position the bodies there, which `flexclear check`
builds.
"""

from typing import get_args

from flexclear.pipeline.core.scene.start import At

KIND = "start"
NAMES = {name: f"{name}:begin" for name in get_args(At)}
