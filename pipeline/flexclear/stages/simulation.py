"""Stage 4: scene and bundles -> a run; `stages.analyses` contains the other analyses of a scene."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from flexclear import dynamics
from flexclear.artifacts.paths import results_root
from flexclear.scene import provenance
from flexclear.scene.parts import UNSEEN
from flexclear.system import machine
from flexclear.system.errors import ResourceError, refuse
from flexclear.workflow import stopping
from flexclear.workflow.task import given_arrays

if TYPE_CHECKING:
    from flexclear.artifacts.labelled import Labelled
    from flexclear.scene.schema import Scene
    from flexclear.system.progress import Progress

#: code that decides results of the engine, besides the module of a stage's own function
CODE = ("flexclear.stages.simulation", "flexclear.dynamics")
#: either datasets or labelled arrays
Data = TypeVar("Data")
#: limits of a scene rebuilt without its own: its requests were checked when the scene was read
UNLIMITED = {"rows": sys.maxsize, "members": sys.maxsize}

#: bytes of a row of a run, fitted to runs of 1 to 24 bodies: constant, per body, joint, contact, load, modal coordinate
ALWAYS, BODY, JOINT, CONTACT, LOAD, MODE = 200, 160, 100, 350, 100, 24
#: copies of a run in memory at its end, measured 3.5 to 4.4; copies on disk, in the cache and shown
TIMES_IN_MEMORY, TIMES_ON_DISK = 4.5, 2.0
#: prefix of the inputs that hold rigid bodies of recipes; the body's name follows
RIGID = "rigid/"
REMEDY = "choose a longer output.interval, or raise [limits]"


def params(
    scene: Scene, *, ensemble: bool = False, sections: bool = False, without: Sequence[str] = ()
) -> dict[str, Any]:
    """Return the part of a scene that the engine sees. It excludes titles, views, shapes, limits, sources and paths of
    files. A single run excludes ensemble and sections; an ensemble excludes the accuracy of a single run, and a run
    excludes whether that accuracy may be missed.

    without: further settings that the result does not depend on.
    """
    unseen = ("title", "description", "view", "limits", "accuracy" if ensemble else "ensemble", *without)
    left_out: dict[str, Any] = dict.fromkeys(unseen, True)
    left_out["body"] = {"__all__": set(UNSEEN)}
    if not ensemble:
        left_out.setdefault("accuracy", {"allow_missed"})
    if not sections:
        left_out["sections"] = True
    table = scene.model_dump(mode="json", exclude=left_out, exclude_none=True)
    for body in scene.recipes():
        table["body"][body]["mesh"] = ""  # the reduced body comes as an input, whose digest is in the key
    return {"scene": provenance.without_sources(table)}


@given_arrays
def run(params: Mapping[str, Any], inputs: Mapping[str, Labelled], progress: Progress) -> dict[str, Any]:
    """Run the scene once (schema RUN); inputs are ``bundle/<body>``. Compliance that bundles lack where joints use it
    is reported, and stored as a warning."""
    scene, reduced = rebuild(params, inputs), bundles(inputs)
    check_run(scene, results_root())
    lacks = missing_compliance(scene, reduced)
    for text in lacks:
        progress(None, text)
    with in_time(scene):
        simulated = dynamics.simulated(scene, reduced, progress)
    warnings = "\n".join(filter(None, [str(simulated.attrs.get("warnings", "")), *lacks]))
    return {"nc": simulated.assign_attrs(warnings=warnings) if warnings else simulated}


def check_parts(params: Mapping[str, Any]) -> None:
    """Raise InputErrors for the parts of a scene that are wrong on their own, before its bodies are reduced."""
    from flexclear.dynamics.model.checks import part_errors

    refuse(part_errors(rebuild(params)))


def check_run(scene: Scene, results: Path) -> None:
    """Raise ResourceError when a run or an ensemble would need more memory or disk than the limits allow."""
    rows = (scene.time.end - scene.time.start) / scene.output.interval + 1.0
    need = rows * row(scene)
    what = f"a run of {rows:.3g} rows"
    machine.require_memory(TIMES_IN_MEMORY * need, what, REMEDY, scene.limits.memory)
    machine.require_disk(TIMES_ON_DISK * need, what, results, REMEDY, scene.limits.disk)
    if scene.ensemble is not None:
        n_bodies = len(scene.ensemble.bodies or scene.contacts() or scene.body)
        # 2000: largest number of rows recorded of an ensemble member, which holds only some bodies' motion
        need = scene.ensemble.members * min(rows, 2000) * n_bodies * BODY
        what = f"an ensemble of {scene.ensemble.members} members"
        machine.require_memory(
            TIMES_IN_MEMORY * need, what, "request fewer members, or raise [limits]", scene.limits.memory
        )
    for name, body in scene.flexible().items():
        if isinstance(body.modes.count, int) and body.modes.count > scene.limits.modes:
            raise ResourceError(
                f"body.{name}.modes.count = {body.modes.count} exceeds limits.modes = "
                f"{scene.limits.modes}: matrices of that size are factorised at every step"
            )


def row(scene: Scene) -> int:
    """Return the estimated size of a row of the scene's run [bytes]."""
    modes = sum(b.modes.count if isinstance(b.modes.count, int) else 30 for b in scene.flexible().values())
    counts = (len(scene.owners()["body"]), len(scene.joint), len(scene.owners()["contact"]), len(scene.forces()), modes)
    each = (BODY, JOINT, CONTACT, LOAD, MODE)
    return ALWAYS + sum(count * size for count, size in zip(counts, each, strict=True))


def missing_compliance(scene: Scene, reduced: Mapping[str, Labelled]) -> list[str]:
    """Return warnings on flexible bodies whose modes lack static compliance between frames of joints and loads."""
    if not reduced:
        return []
    from flexclear.artifacts import compliance

    messages, loads = [], scene.load.values()
    named = [end for part in (*scene.joint.values(), *loads) for end in getattr(part, "between", ())]
    named += [load.frame for load in loads if hasattr(load, "frame")]
    for body, bundle in reduced.items():
        used = [frame for owner, _, frame in (end.partition(".") for end in named) if owner == body]
        if used and "compliance_share" in bundle:
            messages += compliance.warnings(bundle, used, body)
    return messages


@contextmanager
def in_time(scene: Scene) -> Iterator[None]:
    """Stop the work inside this context when the scene's time limit is over."""
    with stopping.stop_after(scene.limits.time, scene.limits.time_words):
        yield


def bundles(inputs: Mapping[str, Data]) -> dict[str, Data]:
    """Return the inputs named ``bundle/<body>``, by body."""
    return {name.removeprefix("bundle/"): data for name, data in inputs.items() if name.startswith("bundle/")}


def rebuild(params: Mapping[str, Any], inputs: Mapping[str, Labelled] | None = None) -> Scene:
    """Rebuild the scene from `params`; its title is its name.

    inputs: among them ``rigid/<body>`` of the rigid bodies that recipes describe, whose numbers are filled in.
    """
    from flexclear.scene.schema import Scene

    table, name = params["scene"], str(params.get("name", "scene"))
    body = fill_in_recipes(table["body"], inputs or {})
    own = {"body": body, "title": name, "limits": params.get("limits", UNLIMITED)}
    scene = Scene.model_validate({**table, **own})
    scene._name = name
    return scene


def fill_in_recipes(bodies: Mapping[str, Any], inputs: Mapping[str, Labelled]) -> dict[str, Any]:
    """Return the table of bodies with numbers from the inputs ``rigid/<body>`` instead of recipes."""
    import numpy as np

    from flexclear.numerics.rotations import matrix_to_quaternion
    from flexclear.scene.parts import FRAME_ERROR

    result = dict(bodies)
    for name, data in inputs.items():
        if not name.startswith(RIGID):
            continue
        body = name.removeprefix(RIGID)
        frames = {
            str(frame): {
                "position": data["frame_position"].values[k].tolist(),
                "quaternion": matrix_to_quaternion(data["frame_rotation"].values[k]).tolist(),
            }
            for k, frame in enumerate(data["frame"].values)
        }
        numbers = {
            "mass": float(data["mass"].values),
            "com": data["com"].values.tolist(),
            "inertia": data["inertia"].values.tolist(),
            "frames": frames,
            "frame_tolerance": FRAME_ERROR * float(np.ptp(data["frame_position"].values, axis=0).max()),
        }
        result[body] = {key: value for key, value in bodies[body].items() if key not in ("mesh", "segment")} | numbers
    return result
