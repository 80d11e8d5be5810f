"""Starts of a run, other than the poses of its scene. To add one: a module here, a line in the table, and its name in
`Start.at`, scene/start.

Each module has a function ``begin(scene, bundles, progress) -> (Scene, str)``: the scene with the poses, velocities and
modal coordinates of that start in place of its own, and `Mechanism.choice` of the mechanism that gave them;
and ``placed(scene) -> Scene``: the scene whose joints and drives position the bodies there, which `flexclear check`
builds.  `recorded` is that of ``[start] from``.
"""

from __future__ import annotations

from flexclear.dynamics.starts import equilibrium, ideal, recorded

STARTS = {"equilibrium": equilibrium, "ideal": ideal, "recorded": recorded}
