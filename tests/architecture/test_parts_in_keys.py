"""Every part of every family is in the key of the runs that name it, with all that it imports and compiles."""

from importlib import import_module
from pathlib import Path
from typing import Any

import pytest

from flexclear.dynamics import effects
from flexclear.dynamics.compile import reach
from flexclear.dynamics.compile.reach import met, modules
from flexclear.dynamics.compile.sources import kernels, sources
from flexclear.dynamics.effects import Parts, Scheme
from flexclear.dynamics.model.mechanism import build
from flexclear.dynamics.model.model import tabulate
from flexclear.scene.load import load_scene
from flexclear.scene.registry import lookup, module_of
from flexclear.scene.schema import Scene
from flexclear.workflow.fingerprint import Sources

BALL = {"type": "rigid", "mass": 1.0, "inertia": [1.0, 1.0, 1.0], "frames": {"F": {}}}


def families() -> list[tuple[str, str]]:
    """(package, name) of every part that a run can name."""
    laws = (effects.NORMAL_LAWS, effects.FRICTION_LAWS, effects.FORMS, effects.LAWS)
    packages = (effects.JOINTS, effects.SURFACES, *laws, effects.LOADS, effects.INTEGRATORS)
    return [(package, name) for package in packages for name in import_module(package).NAMES]


@pytest.mark.parametrize("package, name", families())
def test_what_a_family_lists_is_there(package: str, name: str) -> None:
    """Lists that follow from what scenes declare name modules and objects that exist."""
    assert lookup(package, name, where="here") is not None


#: where a part of a family is among the parts of the code
CODE = {
    effects.JOINTS: lambda name: Parts((name,), closures=True),
    effects.SURFACES: lambda name: Parts(("free",), surfaces=(name,), forms=("elastic",)),
    effects.FORMS: lambda name: Parts(("free",), surfaces=("clearance-spherical",), forms=(name,)),
    effects.FRICTION_LAWS: lambda name: Parts(
        ("free",), surfaces=("clearance-spherical",), forms=("elastic",), frictions=(name,)
    ),
    effects.LOADS: lambda name: Parts(("free",), loads=(name,)),
}


#: gravity is a field, not a kernel
COMPILED = [f for f in families() if f[0] in CODE and f != (effects.LOADS, "gravity")]


@pytest.mark.parametrize("package, name", COMPILED)
def test_what_a_part_compiles_reaches_its_module(package: str, name: str) -> None:
    """The digest of a compiled function changes with the sources of its parts."""
    parts = CODE[package](name)
    texts = (sources(parts, Scheme("dop853")) | kernels(parts)).values()
    reached = {found for text in texts for found in reach.reached(text)}
    assert module_of(package, name) in reached


def scene_with(joint: dict[str, Any], **tables: Any) -> Scene:
    table = {
        "title": "parts",
        "body": {"ground": {"type": "ground", "frames": {"F": {}}}, "ball": BALL},
        "joint": {"J": {"between": ["ground.F", "ball.F"], **joint}},
        "time": {"end": 1.0},
        **tables,
    }
    return Scene.model_validate(table)


#: types of joints that a scene of one body may have: a fixed one leaves no motion, and paths alone make the other
JOINTS = [name for name in import_module(effects.JOINTS).NAMES if name not in ("fixed", "rotation-vector")]


@pytest.mark.parametrize("name", JOINTS)
@pytest.mark.parametrize(
    "solver",
    [{}, {"integrator": "generalized-alpha"}, {"integrator": "rk4", "step": 1e-3, "events": "at step ends"}],
    ids=["default", "implicit", "fixed"],
)
def test_the_key_of_a_run_holds_all_modules_that_its_code_can_reach(root: Path, name: str, solver: dict) -> None:
    """For each type of joint, driven in part where it has several freedoms: a chain of others may take its place."""
    scene = scene_with({"type": name}, solver=solver)
    tree = Sources(root / "pipeline")
    known = tree.closure(["flexclear.stages.simulation", *modules(scene)]).keys()
    part = lookup(effects.JOINTS, name, where="here")
    possible = {name, "free", *(() if len(part.COORDINATES) < 2 else {c.part for c in part.COORDINATES} | {"fixed"})}
    for scheme in effects.schemes(scene):
        parts = Parts(tuple(sorted(possible)), closures=bool(scene.gear))
        texts = (sources(parts, scheme) | kernels(parts)).values()
        assert {found for text in texts for found in reach.reached(text)} <= set(known)


def test_a_joint_with_several_named_freedoms_may_become_a_chain() -> None:
    """The list of joints that stay one link is right, and the chain's parts are listed."""
    joints = import_module(effects.JOINTS)
    for name in joints.NAMES:
        part = lookup(effects.JOINTS, name, where="here")
        if len(part.COORDINATES) > 1:
            assert name not in joints.WHOLE
            assert {coordinate.part for coordinate in part.COORDINATES} <= set(joints.CHAIN)


#: what a scene says next to its joint -> parts of its code, and a module that must be in the key
BESIDE: dict[str, tuple[dict[str, Any], Parts, str]] = {
    "stop": (
        {
            "stop": {
                "end": {"joint": "J", "upper": 1.0, "normal": {"law": "flores", "restitution": 0.5, "stiffness": 1.0}}
            }
        },
        Parts(("cylindrical",), forms=("hysteretic",), effects=("stops",)),
        "flexclear.dynamics.contact.stops",
    ),
    "gear": (
        {"gear": {"screw": {"first": "J.rotation", "second": "J.translation", "ratio": 0.1}}},
        Parts(("cylindrical",), closures=True, effects=("gears",)),
        "flexclear.dynamics.equations.gears",
    ),
}


@pytest.mark.parametrize("family", BESIDE)
def test_stops_and_gears_are_in_the_key_of_the_runs_that_have_them_and_of_no_other(root: Path, family: str) -> None:
    tables, parts, module = BESIDE[family]
    if family == "stop":
        tables["stop"]["end"]["coordinate"] = "rotation"
    texts = (sources(parts, Scheme("dop853")) | kernels(parts)).values()
    reached = {found for text in texts for found in reach.reached(text)}
    scene = scene_with({"type": "cylindrical"}, **tables)
    known = Sources(root / "pipeline").closure(["flexclear.stages.simulation", *modules(scene)]).keys()
    assert module in reached
    assert reached <= set(known)
    without = modules(scene_with({"type": "cylindrical"}))
    assert module not in without
    for effect in parts.present:
        assert effect.modules
        assert effect.modules <= set(modules(scene))
        assert effect.modules & set(without) == set()
    if family == "stop":
        assert "flexclear.dynamics.contact.normal.flores" in modules(scene)


def reached(root: Path, scene: Scene) -> set[str]:
    """Modules in the key of a single run."""
    return set(Sources(root / "pipeline").closure(["flexclear.stages.simulation", *modules(scene, alone=True)]))


DYNAMICS = "flexclear.dynamics"
#: what no single run without `[accuracy]`, with a method of its own and without actuators on a path can reach
OTHERS = (
    *("analyses", "linear", "plan", "sensitivity", "record.ensemble", "record.sections", "run.method_choice"),
    *("run.inverse", "run.horizon.periods", "run.horizon.tangents", "compile.lanes", "specialise.dual"),
    *("specialise.batched", "run.evaluation.batched_evaluation", "model.refill"),
)


def test_a_single_run_depends_on_no_other_result(root: Path) -> None:
    names = reached(root, load_scene(root / "scenes" / "sps4" / "csj.toml"))
    found = {n for n in names for other in OTHERS if n.startswith(f"{DYNAMICS}.{other}")}
    assert found == set()
    assert {n for n in names if n.startswith(("flexclear.structure", "flexclear.post"))} == set()


#: scene, what it is given, and which ways of a run it then may take
LOOPS = {"beginning", "collocation", "passing"}
WAYS: list[tuple[str, dict[str, Any], set[str]]] = [
    ("checks/pendulum", {"solver.integrator": "dop853"}, set()),
    ("checks/pendulum", {"solver.rtol": 1e-9}, {"accuracy", "method selection"}),
    ("sps4/ideal", {}, LOOPS),
    ("sps4/csj", {}, {"horizon", *LOOPS}),
    ("sps4/ideal", {"accuracy": {"rod1.position": "1 um"}}, {"accuracy", "method selection", *LOOPS}),
    ("sps4/ideal", {"accuracy": {"rod1.position": "1 um"}, "solver": {"integrator": "dop853"}}, {"accuracy", *LOOPS}),
    ("sps4/ideal", {"solver": {}}, {"accuracy", "method selection", *LOOPS}),
    ("checks/expressions", {"solver.integrator": "dop853"}, {"expressions"}),
    ("gallery/stewart", {"solver.integrator": "dop853"}, {"inverse dynamics", *LOOPS}),
]


@pytest.mark.parametrize("name, change, known", WAYS)
def test_a_way_of_a_run_is_in_the_keys_of_the_scenes_that_call_for_it(
    root: Path, name: str, change: dict[str, Any], known: set[str]
) -> None:
    scene = load_scene(root / "scenes" / f"{name}.toml", change)
    assert set(effects.ways(scene)) == known
    names, known = reached(root, scene), known - LOOPS
    assert (effects.SINGULAR in met(scene)) == (set(effects.ways(scene)) >= LOOPS)
    for way in set(import_module(effects.RUNS).NAMES) - LOOPS:
        assert (module_of(effects.RUNS, way) in names) == (way in known), way
        assert (effects.way(scene, way) is not None) == (way in known), way


#: scenes whose bodies need no mesh
RIGID = [path for path in sorted(Path("scenes").rglob("*.toml")) if path.parent.name in ("checks", "gallery", "sps4")]


def test_only_scenes_whose_joints_make_loops_have_closures() -> None:
    """What the scene says of it holds whatever tree is taken, and often says no more than is there."""
    found = []
    for path in RIGID:
        scene = load_scene(path)
        if not scene.recipes():
            found.append((tabulate(build(scene, {})).parts.closures, effects.most_parts(scene).closures))
    assert len(found) > 30
    assert (True, False) not in found
    assert (False, False) in found
    assert (True, True) in found


def test_what_a_run_may_meet_is_in_no_key_before_it_has(root: Path) -> None:
    """Another integrator that takes over, articulated inertias of a deep tree, singular poses."""
    scene = load_scene(root / "scenes" / "sps4" / "csj.toml")
    names, may = reached(root, scene), met(scene)
    assert set(may) == {effects.DEEP, effects.SINGULAR, effects.METHOD.format("radau")}
    later = {f"{DYNAMICS}.equations.articulated", f"{DYNAMICS}.integrate.radau"}
    later |= {f"{DYNAMICS}.run.singular_poses.{name}" for name in LOOPS}
    assert later & names == set()
    assert later <= {name for known in may.values() for name in known}
    assert set(modules(scene, alone=True)).union(*may.values()) <= set(modules(scene))
    assert effects.METHOD.format("radau") not in met(load_scene(root / "scenes" / "sps4" / "csj.toml", {"solver": {}}))


def test_a_plan_holds_what_runs_without_its_flexible_bodies_call_for(root: Path) -> None:
    """Of a recipe's rigid body the frames are known as well as its mesh has them; a plan tries the scene with it."""
    scene = load_scene(root / "scenes/checks/flexible_slider_crank.toml")
    assert module_of(effects.RUNS, "frames to a tolerance") in modules(scene)
