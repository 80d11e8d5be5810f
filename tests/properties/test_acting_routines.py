"""Compiled contacts, stops and loads compute what they do in Python: of random mechanisms, in contact and out of it."""

from functools import cache
from itertools import product

import numpy as np
import pytest

from flexclear.dynamics import loads as kinds_of_loads
from flexclear.dynamics import memory as m
from flexclear.dynamics.contact import surfaces as kinds_of_surfaces
from flexclear.dynamics.contact.friction import FRICTION_LAWS
from flexclear.dynamics.contact.normal import NORMAL_LAWS
from flexclear.dynamics.mechanics.of_topology import list_of
from flexclear.dynamics.model.mechanism import build
from flexclear.dynamics.model.model import tabulate
from flexclear.dynamics.specialise.topology import topology_of
from flexclear.scene.load import load_scene
from flexclear.scene.schema import Scene
from tests.analytic.mechanism_runs import TREE
from tests.properties.articulated_chains import Evaluated, bending, evaluated, rods, tabulated
from tests.properties.mechanisms import GRAVITY, Table, two_loops
from tests.properties.test_articulated import BENT, BOTH, FREE, ONE, UP_AND_DOWN, apart
from tests.properties.test_dynamics_clearance import FRICTION, SURFACES
from tests.properties.test_routines import ROUNDING, assert_alike, by_routines, by_ways

NUMBERS = range(24)
#: by name, with keys that each demands
NORMAL: dict[str, Table] = {name: {"delivered_restitution": 0.7} for name in NORMAL_LAWS if name != "hertz"}
NORMAL |= {
    "hertz": {},
    "kelvin-voigt": {"damping": 100.0, "stiffness": 1e7},
    "flores": {"restitution": 0.6, "exponent": 1.3},
}
IDEAL = ("revolute", "prismatic", "spherical", "cylindrical", "universal")
LAW = {"type": "harmonic", "amplitude": 3.0, "frequency": 4.0, "phase": 0.3}
#: of loads along a coordinate, between two frames, and on one
ALONG: tuple[Table, ...] = (
    {"type": "joint-force", "force": LAW},
    {"type": "joint-spring", "stiffness": 40.0, "damping": 2.0, "rest": 0.2},
    {
        "type": "joint-friction",
        "viscous": 0.4,
        "coulomb": {"static": 3.0, "dynamic": 2.0, "v_static": 0.01, "v_dynamic": 0.3},
    },
    {"type": "joint-friction", "viscous": 0.4},
    {"type": "pid", "reference": LAW, "proportional": 20.0, "integral": 9.0, "derivative": 2.0, "limits": [-9.0, 5.0]},
    {"type": "sampled-pid", "reference": 0.1, "proportional": 20.0, "period": 0.01},
)
STIFF = np.diag([200.0, 300.0, 400.0, 5.0, 6.0, 7.0])
BETWEEN: tuple[Table, ...] = (
    {"type": "spring-damper", "stiffness": 300.0, "damping": 5.0, "free_length": 0.4},
    {
        "type": "line-expression",
        "force": "max(0, k * (length - l) + c * min(rate, v)) + f * abs(rate / v)",
        "values": {"k": "200 N/m", "l": "0.9 m", "c": "2 N s/m", "v": "0.05 m/s", "f": "0.3 N"},
    },
    {"type": "bushing", "stiffness": STIFF.tolist(), "damping": (0.01 * STIFF).tolist()},
    {"type": "bushing", "stiffness": [*STIFF[:3].tolist(), *[[0.0] * 6] * 3], "damping": [[0.0] * 6] * 6},
)
ON_ONE: tuple[Table, ...] = (
    {"type": "point-force", "force": [LAW, 1.0, 2.0]},
    {"type": "point-torque", "torque": [LAW, 1.0, 2.0], "axes": "frame"},
    {"type": "point-force", "force": [LAW, 1.0, 2.0], "axes": "frame"},
    {
        "type": "point-expression",
        "force": "-c * norm(rod2.velocity) * rod2.velocity + k * (rod1.position - rod0.end1.position) / 2",
        "values": {"c": "0.05 kg/m", "k": "20 N/m"},
    },
    {
        "type": "point-expression",
        "axes": "frame",
        "force": ["c * rod1.angular_velocity.y * (1 + sqrt(abs(rod1.velocity.z) / v))", "0", "a * sin(2 * w * t)^3"],
        "values": {"c": "0.1 N s/rad", "v": "1 m/s", "a": "2 N", "w": "20 rad/s"},
    },
)


def loads(random: np.random.Generator, number: int, joints: Table) -> Table:
    """Gravity and loads of each kind in turn."""
    found: Table = dict(GRAVITY)
    single = [name for name, one in joints.items() if one["type"] in ("revolute", "prismatic")]
    for k, name in enumerate(single[:2]):
        found[f"along{k}"] = ALONG[(number + 3 * k) % len(ALONG)] | {"joint": name}
    if single:
        formula = "m * cos(q / r) - c * abs(u) * u + m * tanh(exp(q / r)) * log(2 + q^2 / r^2)"
        one, values = single[-1], {"m": "2 N", "r": "1 rad", "c": "0.3 N s^2/rad^2"}
        if joints[one]["type"] == "prismatic":
            values |= {"r": "1 m", "c": "0.3 N s^2/m^2"}
        else:
            values |= {"m": "2 N m", "c": "0.3 N m s^2/rad^2"}
        text = formula.replace("q", f"{one}.position").replace("u", f"{one}.velocity")
        found["written"] = {"type": "joint-expression", "joint": one, "force": text, "values": values}
    ends = "ground.end0" if number % 2 else "rod0.foot", f"rod{2 + number % 3}.foot"
    found["between"] = BETWEEN[number % len(BETWEEN)] | {"between": list(ends)}
    found["on"] = ON_ONE[number % len(ON_ONE)] | {"frame": f"rod{number % 4}.foot"}
    return found


def worn(joint: Table, random: np.random.Generator) -> Table:
    """Worn surfaces of a joint: depths of micrometres by band and sector."""
    radius = joint["ball_radius"] if "ball_radius" in joint else joint["pin_radius"]
    depths = 1e-6 * random.random((2, 4 if "ball_radius" in joint else 1, 7))
    return {"radii": [radius + joint["clearance"], radius], "outer": depths[0].tolist(), "inner": depths[1].tolist()}


def table(number: int) -> Table:
    """A tree of rods on joints, some with clearance, under loads; some joints have ends, some are driven."""
    random = np.random.default_rng([number, 9])
    loose = [list(SURFACES)[(number + k) % 4] for k in range(2)]
    kinds = [IDEAL[random.integers(2)], *random.choice(IDEAL, size=4), *loose]
    order = random.permutation(len(kinds))
    made = rods(8, tuple(str(kinds[k]) for k in order), int(random.integers(1, 4)))
    contacts = {name: joint for name, joint in made["joint"].items() if joint["type"] in SURFACES}
    for k, (name, joint) in enumerate(contacts.items()):
        law = list(NORMAL)[(number + 5 * k) % len(NORMAL)]
        joint |= SURFACES[joint["type"]] | {"normal": {"law": law, "stiffness": 1e8} | NORMAL[law]}
        friction = [*FRICTION, None][(number // 2 + k) % (len(FRICTION) + 1)]
        if friction:
            joint["friction"] = {"law": friction} | FRICTION[friction]
        if (number + k) % 3 == 0 and "slot" not in joint["type"] and "plane" not in joint["type"]:
            joint["wear"] = {"coefficient": 1e-4, "hardness": 1e9}
            if friction != "lugre":
                joint["wear"]["shapes"] = {name: worn(joint, np.random.default_rng(number))}
        if (number + k) % 2 == 0 and joint["type"] in ("clearance-revolute", "clearance-spherical"):
            # forces of thin films take the fifth power of the rounding of an eccentricity of 1
            joint["film"] = {"viscosity": 0.1, "roughness": 0.3 * joint["clearance"]}
    single = [name for name, one in made["joint"].items() if one["type"] in ("revolute", "prismatic")]
    law = list(NORMAL)[number % len(NORMAL)]
    stop = {"joint": single[0], "lower": -0.4, "upper": 0.5, "normal": {"law": law, "stiffness": 1e5} | NORMAL[law]}
    driven = (
        {"turn": {"joint": single[-1], "law": {"type": "polynomial", "coefficients": [0.0, 0.3, 0.2]}}}
        if len(single) > 1 and number % 3 == 0
        else {}
    )
    train = {"first": single[0], "second": single[-1], "ratio": 0.7}
    teeth = {"backlash": 0.01, "stiffness": 1e5, "damping": 30.0} if number % 2 else {}
    geared = {"train": train | teeth} if len(single) > 1 and not driven else {}
    acting = {"load": loads(random, number, made["joint"]), "stop": {"end": stop}, "gear": geared, "drive": driven}
    return made | acting


@cache
def pressed(number: int) -> Evaluated:
    """A random mechanism off its start; each contact is closed, and penetrates by micrometres, or open."""
    model = tabulate(build(Scene.model_validate(table(number)), {}))
    random, off = np.random.default_rng([number, 10]), {"speeds": 0.3, "turns": 0.1, "internal": 1e-6}
    gap = evaluated(model, **off).table(m.TOUCH)["gap"].astype(float)
    depth = random.uniform(1e-6, 1e-4, size=len(gap))
    numbers, touching = model.arrays.table(m.CONTACT_NUMBERS), model.arrays.size(m.N_SURFACES)
    for c, (_, joint, *_) in enumerate(model.contacts):
        way = "radius" if joint.type == "ball-on-plane" else "clearance"
        if c < touching:
            numbers[way][c] += (gap + depth)[c] * (1.0 if way == "radius" else -1.0)
        else:
            numbers["shape"][c, 0] -= numbers["shape"][c, 1] * (gap + depth)[c]
    return evaluated(model, **off, closed=np.arange(len(gap)) * random.random(len(gap)) < 0.7)


@pytest.mark.parametrize("number", NUMBERS)
@pytest.mark.filterwarnings("ignore:divide by zero", "ignore:invalid value")
def test_random_mechanisms_in_contact_move_as_in_python(number: int) -> None:
    """Rates of positions, speeds, bristles, turns and integral parts, powers of the ledger; what steps read."""
    found = pressed(number)
    assert_alike(found)
    (w, _), model = by_routines(found), found.model
    made, known = (
        m.named(m.TOUCH, np.array(one[found.h[m.TOUCH.at] :][: m.TOUCH.size * len(model.contacts)], dtype=float))
        for one in (w, found.w)
    )
    closed = found.space.n[found.space.n[m.MODE] :][: len(model.contacts)] == 1
    assert (known["normal_force"][closed] > 0.0).any()
    for name in known.dtype.names:
        rows = closed if name == "point" else slice(None)
        assert apart(made[name][rows], known[name][rows]) < ROUNDING
    bends = [one[found.h[m.LOAD_BENDS.at] :][: model.arrays.size(m.N_LOAD_BENDS)] for one in (w, found.w)]
    assert apart(*(np.array(one, dtype=float) for one in bends)) < ROUNDING


def test_every_surface_law_and_load_is_tried() -> None:
    models = [pressed(number).model for number in NUMBERS]
    strips = {"ball-on-strip"}  # of sliders
    assert set().union(*(model.parts.surfaces for model in models)) | strips == set(kinds_of_surfaces.SURFACES)
    assert set().union(*(model.parts.frictions for model in models)) == set(FRICTION_LAWS)
    assert {contact.joint.normal.law for model in models for contact in model.contacts} == set(NORMAL)
    effects = {one.name for model in models for one in model.parts.present}
    assert effects == {"bushings", "controllers", "films", "gears", "stops", "wear"}
    kinds = {load.partition(" ")[0] for model in models for load in model.parts.loads}
    assert kinds == set(kinds_of_loads.LOADS)


def sampled(*of: list[float], between: str) -> Table:
    """A table over one or two angles."""
    columns = [{"column": f"q{k}", "unit": "rad"} for k in range(len(of))]
    points = [[*place, float(np.sin(3.0 * sum(place)))] for place in product(*of)]
    value = {"column": "m", "unit": "N m"}
    return {"file": "given.csv", "of": columns, "value": value, "between": between, "points": points}


@pytest.mark.parametrize("between", ["cubic", "linear"])
@pytest.mark.parametrize("angles", [0.0, 0.4, 3.0])
def test_tables_are_looked_up_as_in_python(between: str, angles: float) -> None:
    """Over one and two quantities, with one interval and many; outside of them nothing is a number."""
    random = np.random.default_rng(3)
    near, far = ([-1.0, *np.sort(random.uniform(-1.0, 1.0, size=count)).tolist(), 1.0] for count in (3, 9))
    of = {"a": ([-1.0, 1.0],), "b": (far,), "c": (near, far)}
    tables = {name: sampled(*axes, between=between) for name, axes in of.items()}
    force = "table(c, joint0.position, joint1.position) + table(b, joint2.position) * 2 - table(a, joint1.position)"
    load = {"type": "joint-expression", "joint": "joint0", "force": force, "tables": tables}
    model = tabulate(build(Scene.model_validate(rods(3, load={"measured": load})), {}))
    with np.errstate(invalid="ignore"):
        found = evaluated(model, turns=angles)
    if angles < 1.0:
        assert_alike(found)
        return
    w, n = by_routines(found)
    assert np.isnan(found.rates[model.speeds]).all()
    assert np.isnan(w[found.h[m.SLOPES] :][model.speeds]).all()
    assert n[m.EVALUATION] == found.report


# Friction of ideal joints, gears --------------------------------------------------------------------------------------
RUBBED = ("revolute", "prismatic", "cylindrical", "universal", "spherical")
BEARING: Table = {"radius": 0.02, "length": 0.2, "preload": 3.0}


def with_friction(made: Table, number: int) -> Table:
    """A scene whose ideal joints rub by the laws in turn."""
    for k, joint in enumerate(made["joint"].values()):
        if joint["type"] in RUBBED:
            law = list(FRICTION)[(number + k) % len(FRICTION)]
            keys = ("radius", "preload") if joint["type"] == "spherical" else BEARING
            joint["friction"] = {"law": law} | FRICTION[law] | {key: BEARING[key] for key in keys}
            if joint["type"] == "revolute":
                joint["friction"]["axial_radius"] = 0.03
    return made


def rubbing_tree(number: int) -> Table:
    random = np.random.default_rng([number, 11])
    kinds = tuple(str(kind) for kind in [RUBBED[number % 5], *random.choice(RUBBED, size=2), "fixed"])
    driven = (2,) if kinds[2] in ("revolute", "prismatic") else ()
    return with_friction(rods(4, kinds, int(random.integers(1, 3)), driven=driven), number)


def assert_rubs_alike(found: Evaluated) -> None:
    """And what steps read of bearings: loads, and quantities with kinks; nothing but the report where they jam."""
    w, n = by_routines(found)
    assert n[m.EVALUATION] == found.report
    if found.report == m.JAMMED:
        return
    assert_alike(found)
    count = found.model.arrays.size(m.SIZES["n_bearings"])
    for table, fields in (("bends", slice(None)), ("bearing", slice(1))):
        made, known = (
            np.array(one[found.h[m.NAMED[table].at] :][: m.NAMED[table].size * count], dtype=float).reshape(count, -1)
            for one in (w, found.w)
        )
        assert apart(made[:, fields], known[:, fields]) < 1e-9  # they end within a rounding of Newton's iteration


@pytest.mark.parametrize("number", range(10))
@pytest.mark.filterwarnings("ignore:divide by zero", "ignore:invalid value")
def test_joints_rub_as_in_python(number: int) -> None:
    assert_rubs_alike(evaluated(tabulate(build(Scene.model_validate(rubbing_tree(number)), {})), turns=0.1))


@pytest.mark.filterwarnings("ignore:divide by zero", "ignore:invalid value")
def test_many_joints_rub_as_in_python_and_code_grows_little() -> None:
    """Bearings of another number are other rows of the same routines, which a loop of calls runs."""
    sizes = []
    for count in (9, 18):
        scene = Scene.model_validate(with_friction(rods(count, ("revolute", "spherical"), children=2), 0))
        model = tabulate(build(scene, {}))
        assert_rubs_alike(evaluated(model, turns=0.1))
        codes = list_of(model.parts, topology_of(model.arrays, model.arrays.h)).codes
        sizes.append(sum(len(code.program.block) for code in codes))
    assert sizes[1] < 5 * sizes[0]


@pytest.mark.filterwarnings("ignore:divide by zero", "ignore:invalid value")
def test_some_of_these_joints_jam() -> None:
    reports = {evaluated(tabulate(build(Scene.model_validate(rubbing_tree(k)), {})), turns=0.1).report for k in (0, 1)}
    assert reports == {m.OK, m.JAMMED}


def pressed_rods() -> Table:
    """Flexible and rigid rods; the second one hangs in a bearing with clearance, the last one rubs, loads act on
    frames of flexible ones."""
    made = bending((FREE, None, ONE, BOTH), ("revolute", "clearance-revolute", "revolute", "spherical"), UP_AND_DOWN)
    normal = {"law": "gonthier", "stiffness": 1e8, "delivered_restitution": 0.7}
    made["joint"]["joint1"] |= SURFACES["clearance-revolute"] | {"normal": normal}
    made["joint"]["joint1"]["friction"] = {"law": "lugre"} | FRICTION["lugre"]
    made["joint"]["joint3"]["friction"] = {"law": "ambrosio", "radius": 0.01} | FRICTION["ambrosio"]
    ends = {"between": ["rod0.middle", "rod2.slider"]}
    made["load"] |= {"spring": BETWEEN[0] | ends, "mount": BETWEEN[2] | ends}
    made["load"] |= {"push": ON_ONE[2] | {"frame": "rod2.middle"}, "turn": ON_ONE[1] | {"frame": "rod0.slider"}}
    return made


@pytest.mark.parametrize("name", ["friction", "friction in a loop", "pressed"])
@pytest.mark.filterwarnings("ignore:divide by zero", "ignore:invalid value")
def test_forces_act_on_flexible_bodies_as_in_python(name: str) -> None:
    found = evaluated(tabulated(Scene.model_validate(BENT[name] if name in BENT else pressed_rods())))
    assert found.model.parts.flexible
    assert_rubs_alike(found)


@pytest.mark.parametrize("number", range(3))
@pytest.mark.filterwarnings("ignore:divide by zero", "ignore:invalid value")
def test_joints_of_loops_rub_as_in_python(number: int) -> None:
    assert_rubs_alike(evaluated(tabulate(build(Scene.model_validate(with_friction(two_loops(), number)), {}))))


# Steps ----------------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("name", ["checks/clearance_pendulum", "checks/stops", "checks/rubbing_slider_crank"])
def test_steps_in_contact_run_on_routines(name: str) -> None:
    """Events, guards and impact rates are as by straight code; steps between, where no force acts, follow rounding."""
    scene = load_scene(TREE / f"scenes/{name}.toml")
    runs = by_ways(scene.model_copy(update={"time": scene.time.model_copy(update={"end": 0.1 * scene.time.end})}))
    events = {way: np.array([one.events[key] for key in ("time", "contact", "kind")]) for way, one in runs.items()}
    for way, run in runs.items():
        assert events[way] == pytest.approx(events["straight code"], abs=1e-9)
        assert apart(run.state, runs["straight code"].state) < 1e-9
