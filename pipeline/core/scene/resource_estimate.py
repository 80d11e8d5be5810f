"""What a run of a scene will ask of memory and disk, estimated and judged before anything is computed."""

from __future__ import annotations

from pathlib import Path

from flexclear.pipeline.core.scene.schema import Scene
from flexclear.pipeline.core.system import machine
from flexclear.pipeline.core.system.errors import ResourceError

#: bytes of a row of a run, fitted to runs of 1 to 24 bodies: always, of a body, joint, contact, load, coordinate
ALWAYS, BODY, JOINT, CONTACT, LOAD, MODE = 200, 160, 100, 350, 100, 24
#: a run is in memory so many times at its end, measured 3.5 to 4.4; and on disk, in the cache and shown
HELD, KEPT = 4.5, 2.0
#: of a member of an ensemble only some bodies' motion is recorded, at most as often as this
MEMBER_ROWS = 2000
SPEND = "choose a longer output.interval, or say more in [limits]"


def check_run(scene: Scene, results: Path) -> None:
    """ResourceError when a run or an ensemble of the scene would need more memory or disk than it may."""
    rows = (scene.time.end - scene.time.start) / scene.output.interval + 1.0
    need = rows * row(scene)
    what = f"a run of {rows:.3g} rows"
    machine.require_memory(HELD * need, what, SPEND, scene.limits.memory)
    machine.require_disk(KEPT * need, what, results, SPEND, scene.limits.disk)
    if scene.ensemble is not None:
        n_bodies = len(scene.ensemble.bodies or scene.contacts() or scene.body)
        need = scene.ensemble.members * min(rows, MEMBER_ROWS) * n_bodies * BODY
        what = f"an ensemble of {scene.ensemble.members} members"
        machine.require_memory(HELD * need, what, "ask for fewer members, or say more in [limits]", scene.limits.memory)
    for name, body in scene.flexible().items():
        if isinstance(body.modes.count, int) and body.modes.count > scene.limits.modes:
            raise ResourceError(
                f"body.{name}.modes.count = {body.modes.count} is more than the {scene.limits.modes} that limits.modes "
                "allows: matrices of that size are factorised at every step"
            )


def row(scene: Scene) -> int:
    """Bytes of a row of the scene's run, about."""
    modes = sum(b.modes.count if isinstance(b.modes.count, int) else 30 for b in scene.flexible().values())
    counts = (len(scene.owners()["body"]), len(scene.joint), len(scene.owners()["contact"]), len(scene.forces()), modes)
    each = (BODY, JOINT, CONTACT, LOAD, MODE)
    return ALWAYS + sum(count * size for count, size in zip(counts, each, strict=True))
