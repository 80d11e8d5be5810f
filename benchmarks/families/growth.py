"""Cost of absent effects and of each pair of surfaces, and growth with numbers of loops, modes and others.

The N-four-bar has N + 1 upright rods on revolute joints, whose tops are joined by N rods. In space, planar loops with
revolute joints alone are redundant. Here the joining rods have a spherical joint at each end and may spin about their
own axes, which leaves the planar motion unchanged and every closure independent.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np

from benchmarks.family import Case, Family, Measured, Record
from benchmarks.loose_pairs import NAMES, loose_pair
from benchmarks.mechanisms import (
    Mechanism,
    evaluation_time,
    mechanism,
    most_touching,
    states,
    trajectory,
    without_clearance,
)
from benchmarks.page import Columns, percent, short, spread, table
from benchmarks.timing import interleaved, once, slope
from flexclear import dynamics
from flexclear.dynamics import memory as m
from flexclear.dynamics.run.evaluation.engine import Engine
from flexclear.scene.load import edited
from flexclear.scene.schema import Scene
from flexclear.stages.scenes import bundles
from flexclear.system.progress import silent

LOOPS = (5, 10, 20, 40, 80)
#: counts of Craig-Bampton modes (six are static) that cut no pair of equal frequencies, and the scene of the rod
MODES, FLEXIBLE = (6, 13, 24, 48), "far_cb"
#: end of the run from which a state is taken [s]
MOMENT = 1e-3
#: joints that get clearance, one after the other, in the scene with one contact; rods that become flexible
LOOSE, CLEARANCE = ("A1", "A2", "A3", "A4", "C"), "csj"
RODS = ("rod1", "rod2", "rod3", "rod4")
#: numbers of outputs of a run; a run also has rows of events
OUTPUTS = (180, 1800, 18000)
#: effects that the fullest scene loses -> the scene that never had them
ABSENT = {"clearance and flexibility": "ideal", "flexibility": "csj", "clearance": "far_cb"}
ROUNDS, RUNS = 25, 3
#: distance from a rod's lower end to its centre of mass [m]
HALF_ROD = 0.12
#: evaluations per round, for one loop or scene
EVALUATIONS = 4000


def cases() -> list[Case]:
    """Return as cases the absent effects, pairs, then numbers of loops, modes, contacts, flexible rods and outputs."""
    grown = [Case(f"{n} {what}", n) for what, (numbers, _) in KINDS.items() for n in numbers]
    grown += [Case(f"pair: {name}", name) for name in NAMES]
    return [Case(effect) for effect in ABSENT] + grown


def measure(cases: Sequence[Case], jobs: int) -> Measured:
    """Yield a record for each case; the numbers of one kind take turns."""
    for case in cases:
        if case.name in ABSENT:
            yield case, [_absent(case.name)]
    yield from _pairs({case: loose_pair(case.of) for case in cases if case.name.startswith("pair: ")})
    for what, (_, made) in KINDS.items():
        yield from _grown(what, {case: made(case.of) for case in cases if case.name.endswith(what)})


def _absent(effect: str) -> Record:
    full, without = mechanism("far_csj_cb"), mechanism(ABSENT[effect])
    engines = {"stripped": stripped(full, effect).general_engine(), "without": without.general_engine()}
    times = interleaved({label: _evaluation(engine, EVALUATIONS) for label, engine in engines.items()}, ROUNDS)
    return {
        "scene": without.name,
        "same_code": engines["stripped"].entry.addresses == engines["without"].entry.addresses,
        "stripped_us": 1e6 * times["stripped"].median,
        "without_us": 1e6 * times["without"].median,
        "ratio": times["stripped"].over(times["without"]),
        "spread": max(t.spread for t in times.values()),
    }


def stripped(full: Mechanism, effect: str) -> Mechanism:
    """Return the fullest scene without an effect: with a rigid rod, with an ideal joint, or with both."""
    scene = full.scene
    if "flexibility" in effect:
        scene = scene.model_copy(update={"body": scene.body | {"rod1": mechanism("csj").scene.body["rod1"]}})
    return full.with_scene(effect, without_clearance(scene) if "clearance" in effect else scene)


def _grown(what: str, grown: Mapping[Case, Mechanism]) -> Measured:
    """Yield times of evaluations in free flight by lists of calls and by straight code; for outputs, of whole runs."""
    tasks, more = dict[str, Callable[[], float]](), dict[str, Record]()
    for case, here in grown.items():
        if what == "outputs":
            tasks[case.name] = partial(once, partial(dynamics.simulate, here.scene, here.bundles, silent))
            continue
        tasks[case.name] = _evaluation(
            here.general_engine(), max(EVALUATIONS // (case.of if what == "loops" else 4), 10)
        )
        engine = here.engine() if what != "loops" else None
        if engine is not None:
            tasks[f"{case.name}, straight"] = _evaluation(engine, EVALUATIONS // 4)
        if engine is not None and what == "modes":
            arrays = engine.model.arrays
            held, products = int(arrays.table(m.FLEXES)["n_held"][0]), len(arrays.table(m.MOMENTS))
            more[case.name] = {"held": held, "products": products}
    unit, rounds = ("s", RUNS) if what == "outputs" else ("us", ROUNDS)
    times = interleaved(tasks, rounds)
    for case in grown:
        straight = times.get(f"{case.name}, straight")
        record = {what: case.of, **more.get(case.name, {}), **times[case.name].record(unit)}
        yield case, [record | ({"straight": straight.record(unit)} if straight else {})]


def _pairs(made: Mapping[Case, Mechanism]) -> Measured:
    """Yield times of evaluations in free flight and where most contacts touch, by calls and by straight code."""
    tasks, touching = dict[tuple[Case, str, str], Callable[[], float]](), dict[Case, tuple[int, int]]()
    for case, here in made.items():
        for label, engine in (("us", here.general_engine()), ("straight", here.engine())):
            run = trajectory(engine)
            found = most_touching(run) | {"free": states(engine, run)["free"]}
            touching[case] = run.contacts, int(found["touching"].modes.sum()) if "touching" in found else 0
            for at, state in found.items():
                tasks[case, label, at] = partial(evaluation_time, engine, state, EVALUATIONS // 4)
    times = interleaved(tasks, ROUNDS)
    for case in made:
        record: Record = dict(zip(("contacts", "touching"), touching[case], strict=True))
        measured = {
            f"{label} {at}": times[key].record("us") for key in tasks if key[0] == case for _, label, at in [key]
        }
        yield case, [{"pair": case.of} | {"numbers": record} | measured]


def _evaluation(engine: Engine, repeat: int) -> Callable[[], float]:
    state = states(engine, trajectory(engine))["free"]
    return lambda: evaluation_time(engine, state, repeat)


def with_outputs(count: int) -> Mechanism:
    """Return the mechanism with clearance and `count` outputs, otherwise unchanged."""
    full = mechanism(CLEARANCE)
    time = full.scene.time
    return full.with_scene(f"{count} outputs", edited(full.scene, {"output.interval": (time.end - time.start) / count}))


def with_modes(count: int) -> Mechanism:
    """Return the mechanism with `count` modes of its flexible body, for a short run."""
    full = mechanism(FLEXIBLE)
    (body,) = full.scene.flexible()
    scene = edited(full.scene, {f"body.{body}.modes.count": count, "time.end": MOMENT})
    return Mechanism(f"{count} modes", scene, bundles(scene))


def with_contacts(count: int) -> Mechanism:
    """Return the mechanism with `count` clearance joints, for a short run."""
    full = mechanism(CLEARANCE)
    loose = full.scene.joint[LOOSE[0]]
    more = {name: loose.model_copy(update={"between": full.scene.joint[name].between}) for name in LOOSE[1:count]}
    scene = full.scene.model_copy(update={"joint": full.scene.joint | more})
    return full.with_scene(f"{count} contacts", edited(scene, {"time.end": MOMENT}))


def with_flexible_rods(count: int) -> Mechanism:
    """Return the mechanism with `count` flexible rods, for a short run."""
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


def four_bars(loops: int, lean: float = 0.0) -> Scene:
    """Return the N-four-bar with rods of 1 m and 1 kg under gravity along -z, its motion in the plane of x and z.

    lean: angle about y by which the uprights have turned [rad].

    Data: IFToMM benchmark problem A02 (links of 1 m and 1 kg, first top at 1 m/s); joints as in the module's text.
    """
    s, c = float(np.sin(lean)), float(np.cos(lean))
    upright, lying = {"z": [s, 0.0, c], "x": [c, 0.0, -s]}, {"z": [1.0, 0.0, 0.0], "x": [0.0, 0.0, -1.0]}
    body: dict[str, Any] = {"ground": {"type": "ground", "frames": {}}}
    joint: dict[str, Any] = {}
    for k in range(loops + 1):
        body["ground"]["frames"][f"P{k}"] = {"position": [float(k), 0.0, 0.0], "axes": ACROSS}
        body[f"upright{k}"] = _rod(
            [k + 0.5 * s, 0.0, 0.5 * c],
            "z",
            ("foot", "top"),
            ("foot",),
            axes=upright,
            velocity=[0.5 * c, 0.0, -0.5 * s],
        ) | {"angular_velocity": [0.0, 1.0, 0.0]}
        joint[f"P{k}"] = {"type": "revolute", "between": [f"ground.P{k}", f"upright{k}.foot"]}
    for k in range(loops):
        body[f"bar{k}"] = _rod([k + 0.5 + s, 0.0, c], "z", ("left", "right"), axes=lying, velocity=[c, 0.0, -s])
        joint[f"L{k}"] = {"type": "spherical", "between": [f"upright{k}.top", f"bar{k}.left"]}
        joint[f"R{k}"] = {"type": "spherical", "between": [f"upright{k + 1}.top", f"bar{k}.right"]}
    return _scene(f"{loops} four-bars", body, joint, 0.1, {})


def hinged(links: int) -> Scene:
    """Return an open chain of rods of 1 m and 1 kg on hinges about y, along x at the start, under gravity along -z."""
    body: dict[str, Any] = {"ground": {"type": "ground", "frames": {"tip": {"axes": ACROSS}}}}
    joint: dict[str, Any] = {}
    for k in range(links):
        body[f"link{k}"] = _rod([k + 0.5, 0.0, 0.0], "x", ("foot", "tip"), ("foot", "tip"))
        joint[f"J{k}"] = {"type": "revolute", "between": [f"link{k - 1}.tip" if k else "ground.tip", f"link{k}.foot"]}
    return _scene(f"{links} links", body, joint, 0.2, {"integrator": "dop853", "rtol": 1e-10})


#: axes of a frame whose hinge turns about the world's y
ACROSS = {"z": [0.0, 1.0, 0.0], "x": [1.0, 0.0, 0.0]}


def _rod(
    place: list[float],
    along: str,
    ends: tuple[str, str],
    hinges: Sequence[str] = (),
    axes: dict[str, Any] | None = None,
    **moving: Any,
) -> dict[str, Any]:
    """Return a rod of 1 kg and 1 m along one of its own axes; hinges: ends whose frames have a hinge's axes."""
    # the small moment keeps the spin about the rod's own axis regular
    inertia = [1e-4 if axis == along else 1.0 / 12.0 for axis in "xyz"]
    frames = {
        end: {"position": [side if axis == along else 0.0 for axis in "xyz"]}
        | ({"axes": ACROSS} if end in hinges else {})
        for end, side in zip(ends, (-0.5, 0.5), strict=True)
    }
    pose = {"position": place} | ({"axes": axes} if axes else {})
    return {"type": "rigid", "mass": 1.0, "inertia": inertia, "pose": pose, "frames": frames, **moving}


def _scene(title: str, body: dict[str, Any], joint: dict[str, Any], end: float, solver: dict[str, Any]) -> Scene:
    return Scene.model_validate(
        {
            "title": title,
            "body": body,
            "joint": joint,
            "load": {"gravity": {"type": "gravity", "acceleration": [0.0, 0.0, -9.81]}},
            "time": {"end": end},
            "output": {"interval": end / 10.0},
            "solver": solver,
        }
    )


#: varied number -> its values, and the function that returns the mechanism with one of them
KINDS: dict[str, tuple[Sequence[int], Callable[[int], Mechanism]]] = {
    "loops": (LOOPS, lambda n: Mechanism(f"{n} loops", four_bars(n), {})),
    "modes": (MODES, with_modes),
    "contacts": (range(1, len(LOOSE) + 1), with_contacts),
    "flexible rods": (range(1, len(RODS) + 1), with_flexible_rods),
    "outputs": (OUTPUTS, with_outputs),
}


def show(records: list[Record]) -> str:
    """Return all tables, with the exponents of the growth."""
    absent: Columns = {
        "absent effect": lambda r: f"{r['case']}, against {r['scene']}",
        "removed [us]": lambda r: f"{r['stripped_us']:.2f}",
        "never present [us]": lambda r: f"{r['without_us']:.2f}",
        "ratio": lambda r: f"{r['ratio']:.3f}",
        "spread": lambda r: percent(r["spread"]),
        "same compiled code": lambda r: "yes" if r["same_code"] else "no",
    }
    parts = [table([r for r in records if "same_code" in r], absent)]
    if pairs := [r for r in records if "pair" in r]:
        parts.append(table(pairs, PAIRS))
    for what in KINDS:
        if found := [r for r in records if what in r]:
            parts.append(table(found, _columns(found, what)))
        if what == "loops" and len(found) > 1:
            exponent = slope([r[what] for r in found], [r["us"] for r in found])
            parts.append(f"Time grows as the number of loops to the power {exponent:.2f}.")
    return "\n\n".join(parts)


def _time(key: str) -> Callable[[Record], str]:
    return lambda r: spread(r[key], "us", 2) if key in r else ""


PAIRS: Columns = {
    "joint of one body": lambda r: r["pair"],
    "contacts": lambda r: str(r["numbers"]["contacts"]),
    "routines, free [us]": _time("us free"),
    "specialised, free [us]": _time("straight free"),
    "touching": lambda r: str(r["numbers"]["touching"] or ""),
    "routines, touching [us]": _time("us touching"),
    "specialised, touching [us]": _time("straight touching"),
}


def _columns(records: list[Record], what: str) -> Columns:
    """Return the columns over numbers of a kind; exponents are those from each record to the next."""

    def exponent(of: Callable[[Record], Any]) -> Callable[[Record], str]:
        def to_here(r: Record) -> str:
            before = records[max(records.index(r) - 1, 0)]
            if before is r or not (of(before) and of(r)):
                return ""
            return f"{slope([before[what], r[what]], [of(before), of(r)]):.2f}"

        return to_here

    columns: dict[str, Callable[[Record], str]] = {what: lambda r: str(r[what])}
    if what == "loops":
        return columns | {
            "us per evaluation": lambda r: spread(r, "us", 1),
            "us per loop": lambda r: short(r["us"] / r[what]),
        }
    if what == "outputs":
        return columns | {"simulate stage [s]": lambda r: spread(r, "s", 3), "exponent": exponent(lambda r: r["s"])}
    if what == "modes":
        columns |= {
            "of them held": lambda r: str(r["held"]),
            "integrals of two modes": lambda r: str(r["products"]),
        }
    return columns | {
        "routines [us]": lambda r: spread(r, "us", 2),
        "exponent": exponent(lambda r: r["us"]),
        "specialised [us]": lambda r: spread(r["straight"], "us", 2) if "straight" in r else "",
        "exponent ": exponent(lambda r: r.get("straight", {}).get("us")),
    }


FAMILY = Family(
    what="what absent effects and pairs cost, and growth with the numbers of loops, modes, contacts, rods and outputs",
    takes="7 min",
    page="benchmarks.md",
    cases=cases,
    measure=measure,
    show=show,
    rows=r"none|pin held|the same|in a plane|bounded|flat|backlash",
    quick="5 loops",
)
