"""Stage 4: scene and bundles -> one run, or an ensemble of runs."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from stages.families import constants, module

if TYPE_CHECKING:
    import xarray as xr

    from pipeline.core.scene.schema import Scene
    from pipeline.core.workflow.execute import Progress

DYNAMICS = "pipeline.dynamics"
#: methods that may be given up for an implicit one on the way (pipeline.dynamics.run)
EXPLICIT, IMPLICIT = ("dop853", "dopri5"), "radau"
#: what the generated files compose (pipeline.dynamics.compile.sources): for every scene, and
#: for scenes with flexible bodies and with contacts
KERNELS = (
    "compile.calls",
    "equations.closures",
    "equations.choice",
    "equations.right_hand_side",
    "equations.prescribed_motion",
    "equations.kinematics",
    "bodies.rigid",
    "equations.retraction",
    "equations.observation",
    "equations.projection",
    "integrate.stepper",
)
FLEXIBLE_KERNELS = ("bodies.flexible", "bodies.ports")
STIFFENING_KERNELS = ("bodies.shortening",)
CONTACT_KERNELS = (
    "contact.forces",
    "contact.form.elastic",
    "contact.form.hysteretic",
    "contact.form.linear_damper",
    "contact.validity",
    "integrate.events",
)
#: of scenes with contacts that are noticed at step ends, and of fixed or chosen steps
UNLOCATED_KERNELS = ("integrate.step_ends",)
FIXED_KERNELS, ADAPTIVE_KERNELS = ("integrate.fixed",), ("integrate.adaptive",)
LOAD_KERNELS = ("loads.composing",)
#: joint types that the chain of a joint with several axes, or of a path, is made of
CHAIN = ("fixed", "prismatic", "revolute", "rotation-vector", "spherical")


def params(scene: Scene, *, ensemble: bool = False) -> dict[str, Any]:
    """What the engine sees of a scene. Titles and the place of files on disk are not part of it,
    nor is the ensemble of a single run, nor in an ensemble the accuracy of a single run."""
    left_out = {"title", "description", "accuracy" if ensemble else "ensemble"}
    table = scene.model_dump(mode="json", exclude=left_out, exclude_none=True)
    for body in scene.flexible():
        table["body"][body]["mesh"] = Path(table["body"][body]["mesh"]).name
    return {"name": scene.name, "scene": table}


def modules(scene: Scene) -> tuple[str, ...]:
    """Modules of the parts that the scene names, so that editing a law leaves scenes without it alone.

    Raises InputError when a name is not listed in its family.
    """
    from pipeline.core.scene.laws import law_types

    joints = f"{DYNAMICS}.joints"
    found = {module(f"{DYNAMICS}.integrate", scene.solver.integrator, where="[solver]")}
    if scene.solver.integrator in EXPLICIT and scene.solver.step is None:
        found.add(module(f"{DYNAMICS}.integrate", IMPLICIT, where="[solver]"))
    found.add(module(joints, "free", where="joint"))  # of bodies that hang on no joint
    laws = {law for part in (*scene.drive.values(), *scene.load.values()) for law in law_types(part)}
    kernels: tuple[str, ...] = KERNELS + (ADAPTIVE_KERNELS if scene.solver.step is None else FIXED_KERNELS)
    kernels += (FLEXIBLE_KERNELS if scene.flexible() else ()) + (CONTACT_KERNELS if scene.contacts() else ())
    kernels += UNLOCATED_KERNELS if scene.contacts() and scene.solver.events != "located" else ()
    kernels += (LOAD_KERNELS if scene.forces() else ()) + (("drives.oscillation",) if "harmonic" in laws else ())
    if any(body.stiffening is not None for body in scene.flexible().values()):
        kernels += STIFFENING_KERNELS
    found |= {f"{DYNAMICS}.{kernel}" for kernel in kernels}
    for name, joint in scene.joint.items():
        table = "CONTACTS" if name in scene.contacts() else "NAMES"
        found.add(module(joints, joint.type, where=f"[joint.{name}]", table=table))
        if joint.type in constants(joints)["HELD"]:
            found.add(module(joints, constants(joints)["HELD"][joint.type], where=f"[joint.{name}]"))
    several = ("universal", "cylindrical", "planar", *constants(joints)["HELD"])
    if any(j.type in several for j in scene.joint.values()) or any(
        not hasattr(d, "joint") for d in scene.drive.values()
    ):
        found |= {module(joints, name, where="joint") for name in CHAIN}
    for name, contact in scene.contacts().items():
        where = f"[joint.{name}.normal]"
        found.add(module(f"{DYNAMICS}.contact", contact.type, where=where))
        found.add(module(f"{DYNAMICS}.contact.normal", contact.normal.law, where=where))
        if contact.friction is not None:
            where = f"[joint.{name}.friction]"
            found.add(module(f"{DYNAMICS}.contact.friction", contact.friction.law, where=where))
    found |= {module(f"{DYNAMICS}.drives", law, where="law") for law in laws}
    if scene.output.stress is not None:
        found.add(module(f"{DYNAMICS}.record", "stress", where="[output]"))
    for name, load in scene.load.items():
        found.add(module(f"{DYNAMICS}.loads", load.type, where=f"[load.{name}]"))
    return tuple(sorted(found))


def run(params: Mapping[str, Any], inputs: Mapping[str, xr.Dataset], progress: Progress) -> dict[str, Any]:
    """One run (schema RUN); inputs are ``bundle/<body>``.  What the bundles lack where it matters is told, and kept."""
    from pipeline import dynamics

    scene, reduced = rebuild(params), bundles(inputs)
    lacks = missing_compliance(scene, reduced)
    for text in lacks:
        progress(None, text)
    found = dynamics.simulate(scene, reduced, progress)
    told = "\n".join(filter(None, [str(found.attrs.get("warnings", "")), *lacks]))
    return {"nc": found.assign_attrs(warnings=told) if told else found}


def missing_compliance(scene: Scene, reduced: Mapping[str, xr.Dataset]) -> list[str]:
    """Sentences about flexible bodies whose modes lack static compliance between the frames that joints use."""
    from pipeline.core.artifacts import deficits

    found = []
    for body, bundle in reduced.items():
        ends = (end.partition(".") for joint in scene.joint.values() for end in joint.between)
        used = [frame for owner, _, frame in ends if owner == body]
        if used and "compliance_share" in bundle:
            found += deficits.warnings(bundle, used, body)
    return found


def run_ensemble(params: Mapping[str, Any], inputs: Mapping[str, xr.Dataset], progress: Progress) -> dict[str, Any]:
    """All members (schema ENSEMBLE); inputs are ``bundle/<body>``."""
    from pipeline import dynamics

    return {"nc": dynamics.ensemble(rebuild(params), bundles(inputs), progress)}


def bundles(inputs: Mapping[str, xr.Dataset]) -> dict[str, xr.Dataset]:
    """The inputs called ``bundle/<body>``, by body."""
    return {name.removeprefix("bundle/"): data for name, data in inputs.items() if name.startswith("bundle/")}


def rebuild(params: Mapping[str, Any]) -> Scene:
    """The scene again, from what `params` kept of it; its title is its name."""
    from pipeline.core.scene.schema import Scene

    scene = Scene.model_validate({**params["scene"], "title": params["name"]})
    scene._name = params["name"]
    return scene
