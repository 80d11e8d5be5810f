"""What absent effects cost, and how the cost grows with the number of loops, modes, contacts, rods and outputs.

The N-four-bar: N + 1 upright rods on revolute joints, their tops joined by N rods. In space, planar loops with
revolute joints alone are redundant; here the joining rods have a spherical joint at each end and may spin about their
own axes, which leaves the planar motion as it is and every closure independent.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np

from benchmarks.family import REFUSED, Case, Family, Measured, Record
from benchmarks.mechanisms import Mechanism, evaluation_time, mechanism, states, trajectory, without_clearance
from benchmarks.page import Columns, percent, short, spread, table
from benchmarks.timing import interleaved, once, slope
from flexclear.commands.scenes import bundles
from flexclear.pipeline import dynamics
from flexclear.pipeline.core.scene.load import edited
from flexclear.pipeline.core.scene.schema import Scene
from flexclear.pipeline.core.system.errors import FlexclearError
from flexclear.pipeline.core.system.progress import silent
from flexclear.pipeline.dynamics import memory as m
from flexclear.pipeline.dynamics.run.evaluation.engine import Engine

LOOPS = (5, 10, 20, 40, 80)
#: of the flexible rod, of whose Craig-Bampton modes six are static; none cuts a pair of equal frequencies
MODES, FLEXIBLE = (6, 13, 24, 48), "far_cb"
#: what else there are numbers of
PARTS = ("contacts", "flexible rods", "outputs")
#: of its run from which a state is taken [s]
MOMENT = 1e-3
#: joints of the scene with one contact that get its clearance, one after the other; rods that become flexible
LOOSE, CLEARANCE = ("A1", "A2", "A3", "A4", "C"), "csj"
RODS = ("rod1", "rod2", "rod3", "rod4")
#: outputs of a run, of which the least are its events' rows, too
OUTPUTS = (180, 1800, 18000)
#: what the fullest scene loses, and the scene that never had it
ABSENT = {"clearance and flexibility": "ideal", "flexibility": "csj", "clearance": "far_cb"}
ROUNDS, RUNS = 25, 3
#: from a rod's lower end to its centre of mass [m]
HALF_ROD = 0.12
#: evaluations of a round, for one loop or scene
EVALUATIONS = 4000


def cases() -> list[Case]:
    """Absent effects, then numbers of loops, modes, contacts, flexible rods and outputs."""
    ranges = {
        "loops": LOOPS,
        "modes": MODES,
        "contacts": range(1, len(LOOSE) + 1),
        "flexible rods": range(1, len(RODS) + 1),
        "outputs": OUTPUTS,
    }
    grown = [Case(f"{n} {what}", n) for what, numbers in ranges.items() for n in numbers]
    return [Case(effect) for effect in ABSENT] + grown


def measure(cases: Sequence[Case], jobs: int) -> Measured:
    """A record for each; numbers of one kind take turns."""
    for case in cases:
        if case.name in ABSENT:
            yield case, [_absent(case.name)]
    yield from _loops([case for case in cases if case.name.endswith("loops")])
    yield from _modes([case for case in cases if case.name.endswith("modes")])
    yield from _parts(with_contacts, "contacts", cases)
    yield from _parts(with_flexible_rods, "flexible rods", cases)
    yield from _outputs([case for case in cases if case.name.endswith("outputs")])


def _absent(effect: str) -> Record:
    full, without = mechanism("far_csj_cb"), mechanism(ABSENT[effect])
    engines = {"stripped": stripped(full, effect).general_engine(), "without": without.general_engine()}
    times = interleaved({label: _evaluation(engine, EVALUATIONS) for label, engine in engines.items()}, ROUNDS)
    return {
        "scene": without.name,
        "same_code": _code(engines["stripped"]) == _code(engines["without"]),
        "stripped_us": 1e6 * times["stripped"].median,
        "without_us": 1e6 * times["without"].median,
        "ratio": times["stripped"].over(times["without"]),
        "spread": max(t.spread for t in times.values()),
    }


def _code(engine: Engine) -> dict[str, int]:
    """Where each compiled function of an engine is: one and the same is loaded once."""
    return {**engine.entry.addresses, "late": engine.entry.late.address()}


def stripped(full: Mechanism, effect: str) -> Mechanism:
    """The fullest scene with a rigid rod in place of its flexible one, an ideal joint in place of the loose one."""
    scene = full.scene
    if "flexibility" in effect:
        scene = scene.model_copy(update={"body": scene.body | {"rod1": mechanism("csj").scene.body["rod1"]}})
    return full.with_scene(effect, without_clearance(scene) if "clearance" in effect else scene)


def _loops(cases: Sequence[Case]) -> Measured:
    tasks = {}
    for case in cases:
        try:
            engine = Mechanism(case.name, four_bars(case.of), {}).general_engine()
            tasks[case.name] = _evaluation(engine, max(EVALUATIONS // case.of, 10))
        except FlexclearError as error:
            yield case, [{"loops": case.of, "verdict": REFUSED, "reason": str(error)}]
    times = interleaved(tasks, ROUNDS)
    for case in cases:
        if case.name in times:
            yield case, [{"loops": case.of, **times[case.name].record("us")}]


def _modes(cases: Sequence[Case]) -> Measured:
    """Evaluations by the kernels and, where there is such, by straight code."""
    known, grown, full = dict[str, Record](), dict[str, Mechanism](), mechanism(FLEXIBLE)
    for case in cases:
        grown[case.name] = with_modes(full, case.of)
        arrays = grown[case.name].engine().model.arrays
        known[case.name] = {
            "modes": case.of,
            "held": int(arrays.table(m.FLEXES)["n_held"][0]),
            "products": len(arrays.table(m.MOMENTS)),
        }
    for case, measured in _both_ways(cases, grown):
        yield case, [known[case.name] | measured]


def _parts(made: Callable[[int], Mechanism], what: str, cases: Sequence[Case]) -> Measured:
    """Evaluations with so many parts of a kind, in free flight."""
    mine = [case for case in cases if case.name.endswith(what)]
    for case, measured in _both_ways(mine, {case.name: made(case.of) for case in mine}):
        yield case, [{what: case.of, **measured}]


def _both_ways(cases: Sequence[Case], grown: Mapping[str, Mechanism]) -> Iterator[tuple[Case, Record]]:
    """Times of evaluations by the kernels and, where there is such, by straight code."""
    tasks = dict[str, Callable[[], float]]()
    for name, here in grown.items():
        general, engine = here.general_engine(), here.engine()
        state = states(engine, trajectory(engine))["free"]
        tasks[name] = partial(evaluation_time, general, state, EVALUATIONS // 4)
        if engine.has_straight_code:
            tasks[f"{name}, straight"] = partial(evaluation_time, engine, state, EVALUATIONS // 4)
    times = interleaved(tasks, ROUNDS)
    for case in cases:
        straight = times.get(f"{case.name}, straight")
        yield case, times[case.name].record("us") | ({"straight": straight.record("us")} if straight else {})


def _outputs(cases: Sequence[Case]) -> Measured:
    """Whole runs from scene to dataset that differ in the number of outputs alone."""
    full, tasks = mechanism(CLEARANCE), dict[str, Callable[[], float]]()
    for case in cases:
        end = full.scene.time.end - full.scene.time.start
        here = full.with_scene(case.name, edited(full.scene, {"output.interval": end / case.of}))
        tasks[case.name] = partial(once, partial(dynamics.simulate, here.scene, here.bundles, silent))
    times = interleaved(tasks, RUNS)
    for case in cases:
        yield case, [{"outputs": case.of, **times[case.name].record("s")}]


def with_modes(full: Mechanism, count: int) -> Mechanism:
    """The mechanism with so many modes of its flexible body."""
    (body,) = full.scene.flexible()
    scene = edited(full.scene, {f"body.{body}.modes.count": count, "time.end": MOMENT})
    return Mechanism(f"{count} modes", scene, bundles(scene))


def with_contacts(count: int) -> Mechanism:
    """The mechanism with so many loose joints, for a moment."""
    full = mechanism(CLEARANCE)
    loose = full.scene.joint[LOOSE[0]]
    more = {name: loose.model_copy(update={"between": full.scene.joint[name].between}) for name in LOOSE[1:count]}
    scene = full.scene.model_copy(update={"joint": full.scene.joint | more})
    return full.with_scene(f"{count} contacts", edited(scene, {"time.end": MOMENT}))


def with_flexible_rods(count: int) -> Mechanism:
    """The mechanism with so many flexible rods, for a moment."""
    full, rigid = mechanism(FLEXIBLE).scene, mechanism("ideal").scene.model_dump(mode="json")["body"]
    changes: dict[str, Any] = {"time.end": MOMENT}
    for name in RODS[1:count]:
        flexible = full.body[RODS[0]].model_dump(mode="json", exclude_none=True)
        along, across = (np.array(rigid[name]["pose"]["axes"][axis]) for axis in "zx")
        bottom = np.array(rigid[name]["pose"]["position"]) - HALF_ROD * along / np.linalg.norm(along)
        pose = {"position": bottom.tolist(), "axes": {"x": along.tolist(), "y": across.tolist()}}
        changes[f"body.{name}"] = flexible | {"pose": pose}
    scene = edited(full, changes)
    return Mechanism(f"{count} flexible rods", scene, bundles(scene))


def _evaluation(engine: Engine, repeat: int) -> Callable[[], float]:
    state = states(engine, trajectory(engine))["free"]
    return lambda: evaluation_time(engine, state, repeat)


def four_bars(loops: int, lean: float = 0.0) -> Scene:
    """N-four-bar with rods of 1 m and 1 kg under gravity along -z, its motion in the plane of x and z.

    lean: angle about y by which the uprights have turned.

    Data: IFToMM benchmark problem A02 (links of 1 m and 1 kg, first top at 1 m/s); joints as said above.
    """
    thin = [1.0 / 12.0, 1.0 / 12.0, 1e-4]  # a rod of 1 kg and 1 m along z; the last only keeps the spin regular
    body: dict[str, Any] = {"ground": {"type": "ground", "frames": {}}}
    joint: dict[str, Any] = {}
    across = {"z": [0.0, 1.0, 0.0], "x": [1.0, 0.0, 0.0]}
    s, c = float(np.sin(lean)), float(np.cos(lean))
    for k in range(loops + 1):
        body["ground"]["frames"][f"P{k}"] = {"position": [float(k), 0.0, 0.0], "axes": across}
        body[f"upright{k}"] = {
            "type": "rigid",
            "mass": 1.0,
            "inertia": thin,
            "pose": {"position": [k + 0.5 * s, 0.0, 0.5 * c], "axes": {"z": [s, 0.0, c], "x": [c, 0.0, -s]}},
            "velocity": [0.5 * c, 0.0, -0.5 * s],
            "angular_velocity": [0.0, 1.0, 0.0],
            "frames": {"foot": {"position": [0.0, 0.0, -0.5], "axes": across}, "top": {"position": [0.0, 0.0, 0.5]}},
        }
        joint[f"P{k}"] = {"type": "revolute", "between": [f"ground.P{k}", f"upright{k}.foot"]}
    for k in range(loops):
        body[f"bar{k}"] = {
            "type": "rigid",
            "mass": 1.0,
            "inertia": thin,
            "pose": {"position": [k + 0.5 + s, 0.0, c], "axes": {"z": [1.0, 0.0, 0.0], "x": [0.0, 0.0, -1.0]}},
            "velocity": [c, 0.0, -s],
            "frames": {"left": {"position": [0.0, 0.0, -0.5]}, "right": {"position": [0.0, 0.0, 0.5]}},
        }
        joint[f"L{k}"] = {"type": "spherical", "between": [f"upright{k}.top", f"bar{k}.left"]}
        joint[f"R{k}"] = {"type": "spherical", "between": [f"upright{k + 1}.top", f"bar{k}.right"]}
    return Scene.model_validate(
        {
            "title": f"{loops} four-bars",
            "body": body,
            "joint": joint,
            "load": {"gravity": {"type": "gravity", "acceleration": [0.0, 0.0, -9.81]}},
            "time": {"end": 0.1},
            "output": {"interval": 0.01},
        }
    )


def hinged(links: int, end: float = 0.2) -> Scene:
    """An open chain of rods of 1 m and 1 kg on hinges about y, along x at the start, under gravity along -z."""
    across = {"z": [0.0, 1.0, 0.0], "x": [1.0, 0.0, 0.0]}
    body: dict[str, Any] = {"ground": {"type": "ground", "frames": {"tip": {"axes": across}}}}
    joint: dict[str, Any] = {}
    for k in range(links):
        body[f"link{k}"] = {
            "type": "rigid",
            "mass": 1.0,
            "inertia": [1e-4, 1.0 / 12.0, 1.0 / 12.0],
            "pose": {"position": [k + 0.5, 0.0, 0.0]},
            "frames": {
                "foot": {"position": [-0.5, 0.0, 0.0], "axes": across},
                "tip": {"position": [0.5, 0.0, 0.0], "axes": across},
            },
        }
        joint[f"J{k}"] = {"type": "revolute", "between": [f"link{k - 1}.tip" if k else "ground.tip", f"link{k}.foot"]}
    return Scene.model_validate(
        {
            "title": f"{links} links",
            "body": body,
            "joint": joint,
            "load": {"gravity": {"type": "gravity", "acceleration": [0.0, 0.0, -9.81]}},
            "time": {"end": end},
            "output": {"interval": end / 10.0},
            "solver": {"integrator": "dop853", "rtol": 1e-10},
        }
    )


def show(records: list[Record]) -> str:
    """All tables, with the exponents of the growth."""
    loops, modes = ([r for r in records if "us" in r and what in r] for what in ("loops", "modes"))
    absent: Columns = {
        "absent effect": lambda r: f"{r['case']}, against {r['scene']}",
        "removed [us]": lambda r: f"{r['stripped_us']:.2f}",
        "never there [us]": lambda r: f"{r['without_us']:.2f}",
        "ratio": lambda r: f"{r['ratio']:.3f}",
        "spread": lambda r: percent(r["spread"]),
        "same compiled code": lambda r: "yes" if r["same_code"] else "no",
    }
    growth: Columns = {
        "loops": lambda r: str(r["loops"]),
        "us per evaluation": lambda r: spread(r, "us", 1),
        "us per loop": lambda r: short(r["us"] / r["loops"]),
    }
    parts = [table([r for r in records if "same_code" in r], absent), table(loops, growth)]
    if len(loops) > 1:
        exponent = slope([r["loops"] for r in loops], [r["us"] for r in loops])
        parts.append(f"Time grows as the number of loops to the power {exponent:.2f}.")
    if modes:
        parts.append(_of_modes(modes))
    parts += [_of_parts(found, what) for what in PARTS if (found := [r for r in records if what in r])]
    return "\n\n".join(parts + [f"{r['case']} skipped: {r['reason']}" for r in records if "reason" in r])


def _straight(r: Record) -> Any:
    return r.get("straight", {}).get("us")


def _exponent(records: list[Record], number: str, of: Callable[[Record], Any]) -> Callable[[Record], str]:
    """The exponent of growth from each record to the next."""

    def to_here(r: Record) -> str:
        before = records[records.index(r) - 1] if r is not records[0] else r
        if before is r or not (of(before) and of(r)):
            return ""
        return f"{slope([before[number], r[number]], [of(before), of(r)]):.2f}"

    return to_here


def _of_parts(records: list[Record], what: str) -> str:
    """The table over numbers of contacts, flexible rods or outputs."""
    exponent = _exponent(records, what, lambda one: one.get("us", one.get("s")))
    if what == "outputs":
        runs: Columns = {
            what: lambda r: str(r[what]),
            "simulate stage [s]": lambda r: spread(r, "s", 3),
            "exponent": exponent,
        }
        return table(records, runs)
    columns: Columns = {
        what: lambda r: str(r[what]),
        "kernels [us]": lambda r: spread(r, "us", 2),
        "exponent": exponent,
        "straight [us]": lambda r: spread(r["straight"], "us", 2) if "straight" in r else "",
        "its exponent": _exponent(records, what, _straight),
    }
    return table(records, columns)


def _of_modes(records: list[Record]) -> str:
    """The table over numbers of modes, with exponents from each one to the next."""
    columns: Columns = {
        "modes": lambda r: str(r["modes"]),
        "of them held": lambda r: str(r["held"]),
        "integrals of two modes": lambda r: str(r["products"]),
        "kernels [us]": lambda r: spread(r, "us", 2),
        "exponent": _exponent(records, "modes", lambda one: one["us"]),
        "straight [us]": lambda r: spread(r["straight"], "us", 2) if "straight" in r else "",
        "its exponent": _exponent(records, "modes", _straight),
    }
    return table(records, columns)


FAMILY = Family(
    what="what absent effects cost, and growth with the numbers of loops, modes, contacts, rods and outputs",
    takes="6 min",
    page="benchmarks.md",
    cases=cases,
    measure=measure,
    show=show,
    quick="5 loops",
)
