"""An effect that a scene does not have is not there: not compiled, and no key of the machine code."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import pytest

from flexclear.dynamics.compile import functions
from flexclear.dynamics.compile.sources import source_of_steps, sources_of_functions
from flexclear.dynamics.contact import form as contact_forms
from flexclear.dynamics.effects import CHAIN, FORMS, WHOLE, Parts, Scheme, most_parts, scheme_of
from flexclear.dynamics.joints import JOINTS
from flexclear.dynamics.mechanics.of_topology import list_of
from flexclear.dynamics.model.mechanism import build
from flexclear.dynamics.model.model import tabulate
from flexclear.dynamics.specialise.topology import topology_of
from flexclear.scene.load import compose, load_scene
from flexclear.scene.schema import Scene
from tests.analytic.mechanism_runs import bundles
from tests.processes import printed

SCHEME = Scheme("dop853")
CSJ, IDEAL = "sps4/csj", "sps4/ideal"

#: reads a scene, then says which models of its parts have a schema of their own
BUILT = """
import sys
from flexclear.scene.fields import Part
from flexclear.scene.load import load_scene
load_scene(sys.argv[1])
found = [Part]
for model in found:
    found += model.__subclasses__()
print(len(found), *[model.__name__ for model in found if model.__pydantic_complete__])
"""


def path_of(root: Path, scene: str) -> Path:
    return root / "scenes" / f"{scene}.toml"


def test_parts_are_built_with_their_scene_and_not_one_by_one(root: Path) -> None:
    """But for those that stand as defaults in others: to build all seventy takes as long as to import NumPy."""
    number, *built = printed(BUILT, path_of(root, CSJ)).split()
    assert int(number) > 70
    assert set(built) == {"Scene", "Limits", "Output", "Pose", "Solver"}


# What is compiled ---------------------------------------------------------------------------------------------------


def parts_of(scene: Scene) -> Parts:
    return tabulate(build(scene, bundles(scene))).parts


@cache
def parts(path: Path) -> Parts:
    return parts_of(load_scene(path))


#: effect -> word that its generated source must have
EFFECTS = {
    "contact events": "contact_events import located",
    "sliding": "contact_phases import regimes",
    "closures": "calls.project",
    "singular poses": "poses=singular_step",
    "harmonics": "import oscillate",
    "guards": "integrate.guards import",
}
SPRING = ("spring-damper",)
SMOOTH = {"surfaces": ("clearance-spherical",), "forms": ("hysteretic",)}
RUBBING = {**SMOOTH, "frictions": ("modified-coulomb",)}
CASES: dict[str, tuple[Parts, set[str]]] = {
    "tree": (Parts(("spherical",)), set()),
    "ideal": (Parts(("prismatic", "spherical"), closures=True), {"closures"}),
    "smooth clearance": (Parts(("free",), **SMOOTH), {"contact events"}),
    "clearance": (
        Parts(("prismatic", "spherical"), **RUBBING, closures=True),
        {"contact events", "sliding", "closures", "guards"},
    ),
    "flexible": (Parts(("fixed",), flexible=True), set()),
    "stiffened": (Parts(("fixed",), flexible=True, effects=("stiffening",)), set()),
    "springs": (Parts(("prismatic",), loads=SPRING), set()),
    "waves": (Parts(("prismatic",), harmonics=True), {"harmonics"}),
    "geared": (Parts(("revolute",), closures=True, effects=("gears",)), {"closures"}),
    "stopped": (Parts(("revolute",), forms=("hysteretic",), effects=("stops",)), {"contact events"}),
    "rubbing hinges": (
        Parts(("revolute",), closures=True, effects=("joint_friction modified-coulomb",)),
        {"closures", "guards"},
    ),
    "worn": (Parts(("free",), **SMOOTH, effects=("wear",)), {"contact events"}),
    "everything": (
        Parts(
            ("fixed", "spherical"),
            **RUBBING,
            loads=("joint-friction", *SPRING),
            effects=("gears", "joint_friction ambrosio", "stiffening", "stops", "wear"),
            closures=True,
            flexible=True,
            harmonics=True,
            load_kinks=True,
        ),
        set(EFFECTS),
    ),
}


@pytest.mark.parametrize("case", CASES)
def test_the_entry_names_the_effects_present_and_no_other(case: str) -> None:
    found, present = CASES[case]
    source = "".join(sources_of_functions(found, SCHEME).values())
    if "closures" in present:  # loops alone have singular poses
        present = present | {"singular poses"}
    for effect, word in EFFECTS.items():
        assert (word in source) == (effect in present), effect


def test_absent_contacts_loads_and_loops_are_not_called(root: Path) -> None:
    """Of a pendulum nothing but a tree is evaluated; of the paper's mechanism contacts and loops as well."""
    found = []
    for name in ("checks/pendulum", CSJ):
        model = tabulate(build(load_scene(path_of(root, name)), {}))
        codes = list_of(model.parts, topology_of(model.arrays, model.arrays.h)).codes
        found.append({code.name for code in codes} & {"touch", "stop", "act", "closure", "coupling", "friction_of"})
    assert found == [set(), {"touch", "closure"}]


def test_declarations_of_effects_are_read_without_what_compiles() -> None:
    """Light commands read them."""
    names = set(printed("import sys; from flexclear.dynamics import effects; print(*sys.modules)").split())
    assert not names & {"numba", "numpy", "flexclear.dynamics.kernels", "flexclear.dynamics.memory"}


def test_a_joint_with_several_named_freedoms_may_become_a_chain() -> None:
    """The list of joints that stay one link is right, and the chain's parts are listed."""
    for name, part in JOINTS.items():
        if len(part.COORDINATES) > 1:
            assert name not in WHOLE
            assert {coordinate.part for coordinate in part.COORDINATES} <= set(CHAIN)


def test_all_forms_of_normal_laws_may_be_composed() -> None:
    assert set(FORMS) < set(contact_forms.FORMS)  # those of tight fits follow from the scene


#: scenes whose bodies need no mesh
RIGID = [path for path in sorted(Path("scenes").rglob("*.toml")) if path.parent.name in ("checks", "gallery", "sps4")]


def test_only_scenes_whose_joints_make_loops_have_closures() -> None:
    """What the scene says of it holds whatever tree is taken, and often says no more than is there."""
    found = []
    for path in RIGID:
        scene = load_scene(path)
        if not scene.recipes():
            found.append((parts_of(scene).closures, most_parts(scene).closures))
    assert len(found) > 30
    assert (True, False) not in found
    assert (False, False) in found
    assert (True, True) in found


# What the machine code is keyed by ----------------------------------------------------------------------------------


def digests(found: Parts, scheme: Scheme) -> dict[str, str]:
    return {name: functions.digest(text) for name, text in sources_of_functions(found, scheme).items()}


def digest(scene: Scene) -> str:
    return " ".join(digests(parts_of(scene), scheme_of(scene.solver)).values())


def specialised_code(scene: Scene) -> str:
    """Made for the topology of a mechanism."""
    model = tabulate(build(scene, bundles(scene)))
    return source_of_steps(model.parts, topology_of(model.arrays, model.arrays.h))


#: one number of every kind that a scene has
NUMBERS: dict[str, object] = {
    "joint.A1.clearance": "0.2 mm",
    "joint.A1.ball_radius": "15 mm",
    "joint.A1.socket_material.youngs_modulus": "70 GPa",
    "joint.A1.normal.restitution": 0.5,
    "joint.A1.normal": {"law": "flores", "restitution": 0.5, "exponent": 2.0, "stiffness": 1e13},
    "joint.A1.friction.static": 0.2,
    "joint.A1.friction.v_static": "0.1 mm/s",
    "joint.A1.floor": "1 mm/s",
    "body.platform.mass": "1 kg",
    "body.platform.inertia": ["2000 kg mm^2", "2000 kg mm^2", "3000 kg mm^2"],
    "body.ball_A1.com": [0.0, 0.0, 0.0],
    "body.platform.frames.A1.position": ["120 mm", "70 mm", 0.0],
    "body.rod1.frames.bottom.position": [0.0, 0.0, "-119 mm"],
    "body.platform.pose.position": [0.0, 0.0, "235 mm"],
    "drive.P1.law.change": ["30 mm", "-30 mm"],
    "drive.P2.law": {"type": "constant", "value": 0.0},
    "drive.P3.law": {"type": "step", "start": [0.0], "end": [0.1], "change": ["1 mm"]},
    "drive.P4.law": {"type": "spline", "time": [0.0, 0.1, 0.2], "value": ["0 mm", "2 mm", "1 mm"]},
    "load": {"gravity": {"type": "gravity", "acceleration": [0.0, 0.0, -9.81]}},
    "time.end": "1 s",
    "output": {"interval": "1 ms"},
    "solver": {"rtol": 1e-8, "evaluations": 1000},
}


@pytest.mark.parametrize("place", NUMBERS)
def test_no_number_of_a_scene_is_compiled_in(root: Path, place: str) -> None:
    known, changed = load_scene(path_of(root, CSJ)), load_scene(path_of(root, CSJ), {place: NUMBERS[place]})
    assert changed != known
    assert digest(changed) == digest(known)
    assert specialised_code(changed) == specialised_code(known)


def without_leg(table: dict[str, Any], k: int) -> dict[str, Any]:
    """The table without the bodies, joints and drive of leg k; its socket stays on the platform."""
    bodies = {f"{part}{k}" for part in ("cylinder", "rod", "ball_A", "ball_B")}
    joints = {n for n, j in table["joint"].items() if any(f.partition(".")[0] in bodies for f in j["between"])}
    result = dict(table)
    result["body"] = {n: b for n, b in table["body"].items() if n not in bodies}
    result["joint"] = {n: j for n, j in table["joint"].items() if n not in joints}
    result["drive"] = {n: d for n, d in table["drive"].items() if d["joint"] not in joints}
    return result


def test_the_number_of_bodies_and_legs_is_not_compiled_in(root: Path) -> None:
    table = compose(path_of(root, CSJ))
    known = digest(Scene.model_validate(table))
    for k in (4, 3):
        fewer = without_leg(table, k)
        assert len(fewer["body"]) == len(table["body"]) - 4
        assert digest(Scene.model_validate(fewer)) == known
        table = fewer


def test_a_second_clearance_joint_of_the_same_kind_is_not_compiled_in(root: Path) -> None:
    table = compose(path_of(root, CSJ))
    known = digest(Scene.model_validate(table))
    table["joint"]["A3"] = {**table["joint"]["A1"], "between": table["joint"]["A3"]["between"], "source": None}
    assert digest(Scene.model_validate(table)) == known


def test_the_order_in_which_parts_are_written_is_not_compiled_in(root: Path) -> None:
    table = compose(path_of(root, CSJ))
    turned = {**table, **{f: dict(reversed(table[f].items())) for f in ("body", "joint", "drive")}}
    assert digest(Scene.model_validate(turned)) == digest(Scene.model_validate(table))


def test_another_set_of_laws_is_other_machine_code(root: Path) -> None:
    def clearance(change: dict[str, Any]) -> str:
        table = compose(path_of(root, CSJ))
        table["joint"]["A1"] = {k: v for k, v in {**table["joint"]["A1"], **change}.items() if v is not None}
        return specialised_code(Scene.model_validate(table))

    found = [clearance({}), clearance({"friction": None}), clearance({"normal": {"law": "hertz"}})]
    found.append(specialised_code(load_scene(path_of(root, IDEAL))))
    assert len(set(found)) == len(found)


def test_a_flexible_rod_makes_another_kind_of_mechanism(root: Path) -> None:
    rigid, flexible = (parts(path_of(root, name)) for name in (CSJ, "sps4/far_csj_cb"))
    assert not rigid.flexible
    assert flexible.flexible
    same = ("surfaces", "forms", "frictions", "closures")
    assert all(getattr(rigid, kind) == getattr(flexible, kind) for kind in same)


def test_the_reference_condition_and_the_number_of_modes_are_not_compiled_in(root: Path) -> None:
    free, clamped = (parts(path_of(root, f"sps4/far_csj_{name}")) for name in ("free", "cb"))
    # the same joints in the tree and the same laws, so the same code
    assert free == clamped


def test_mechanisms_share_the_code_in_which_they_are_alike() -> None:
    """Steps know neither joints nor bodies nor laws; what is recorded and the equations know no integrator."""
    one, whole = CASES["clearance"][0], CASES["everything"][0]
    mine, theirs = digests(one, SCHEME), digests(whole, SCHEME)
    assert [name for name in mine if mine[name] == theirs[name]] == ["project", "resolve", "observe", "advance"]
    # they end on guards, whatever these watch: sliding in joints or along coordinates
    hinges, springs = CASES["rubbing hinges"][0], replace(CASES["springs"][0], closures=True, load_kinks=True)
    assert digests(hinges, SCHEME)["advance"] == digests(springs, SCHEME)["advance"] != mine["advance"]
    assert digests(replace(one, frictions=()), SCHEME)["advance"] != mine["advance"]  # it has no guards
    radau = digests(one, Scheme("radau"))
    assert [name for name in mine if mine[name] != radau[name]] == ["resolve", "advance"]
    assert digests(CASES["ideal"][0], SCHEME)["advance"] != mine["advance"]  # it has no contacts to watch
    assert "resolve" not in digests(CASES["ideal"][0], SCHEME)
    assert "project" not in digests(CASES["tree"][0], SCHEME)


#: runs scenes one after the other in one process
BOTH = """
import sys
from dataclasses import replace
from flexclear import dynamics
from flexclear.scene.load import load_scene
for path in sys.argv[1:]:
    done = dynamics.simulate(load_scene(path, {"time.end": "0.2 ms"}), {}, lambda share, text: None)
    assert abs(done.energy_error).max() < 1e-9, path
"""


def test_two_topologies_from_the_disk_cache_keep_their_own_code(root: Path) -> None:
    """Numba names symbols by a counter of each process; the loader takes the first of two that are named alike."""
    one, other = (str(path_of(root, name)) for name in (IDEAL, "checks/free_body"))
    for scenes in ([one], [other], [one, other], [other, one]):  # each compiled by a process of its own, if at all
        printed(BOTH, *scenes)
