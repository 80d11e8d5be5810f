"""What absent effects cost, and how the cost grows with the number of loops.

An effect is absent when its part is: the fullest scene with its flexible rod replaced by a rigid one, or its clearance
joint by an ideal one, must cost what the scene costs that never had them.

The N-four-bar: N + 1 upright rods on revolute joints, their tops joined by N rods. In space, planar loops with
revolute joints alone are redundant; here the joining rods have a spherical joint at each end and may spin about their
own axes, which leaves the planar motion as it is and every closure independent.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from benchmarks.engines import Mechanism, evaluation_time, mechanism, states, trajectory, without_clearance
from benchmarks.measure import interleaved, slope
from benchmarks.tables import percent, short, table
from pipeline.core.errors import FlexclearError
from pipeline.core.scene.schema import Scene

TITLE = "Absent effects, and growth with the number of loops"
LOOPS = (5, 10, 20, 40, 80)
ROUNDS = 25
#: evaluations of a round, for one loop or scene
EVALUATIONS = 4000


def measure() -> Iterator[dict[str, Any]]:
    """Results of kind "absent", then of kind "loops"."""
    ideal, csj = mechanism("ideal"), mechanism("csj")
    far, full = mechanism("far_cb"), mechanism("far_csj_cb")
    rigid = full.scene.model_copy(update={"body": full.scene.body | {"rod1": csj.scene.body["rod1"]}})
    yield _absent("clearance and flexibility", full.with_scene("", without_clearance(rigid)), ideal)
    yield _absent("flexibility", full.with_scene("", rigid), csj)
    yield _absent("clearance", full.with_scene("", without_clearance(full.scene)), far)
    yield from _loops()


def _absent(effect: str, stripped: Mechanism, without: Mechanism) -> dict[str, Any]:
    engines = {"stripped": stripped.engine(), "without": without.engine()}
    tasks = {}
    for label, engine in engines.items():
        state = states(engine, trajectory(engine))["free"]
        tasks[label] = lambda e=engine, s=state: evaluation_time(e, s, EVALUATIONS)
    times = interleaved(tasks, ROUNDS)
    return {
        "kind": "absent",
        "effect": effect,
        "scene": without.name,
        "same_code": engines["stripped"].entry == engines["without"].entry,
        "stripped_us": 1e6 * times["stripped"].median,
        "without_us": 1e6 * times["without"].median,
        "ratio": times["stripped"].over(times["without"]),
        "spread": max(t.spread for t in times.values()),
    }


def _loops() -> Iterator[dict[str, Any]]:
    tasks, refused = {}, []
    for n in LOOPS:
        try:
            engine = Mechanism(f"{n} loops", four_bars(n), {}).engine()
            state = states(engine, trajectory(engine))["free"]
        except FlexclearError as error:
            refused.append({"kind": "loops", "loops": n, "skipped": str(error)})
            continue
        tasks[str(n)] = lambda e=engine, s=state, n=n: evaluation_time(e, s, max(EVALUATIONS // n, 10))
    times = interleaved(tasks, ROUNDS)
    for label, found in times.items():
        yield {"kind": "loops", "loops": int(label), "us": 1e6 * found.median, "spread": found.spread}
    yield from refused


def four_bars(loops: int) -> Scene:
    """N-four-bar with rods of 1 m and 1 kg under gravity along -z, its motion in the plane of x and z.

    Data: IFToMM benchmark problem A02 (links of 1 m and 1 kg, first top at 1 m/s); joints as said above.
    """
    thin = [1.0 / 12.0, 1.0 / 12.0, 1e-4]  # a rod of 1 kg and 1 m along z; the last only keeps the spin regular
    body: dict[str, Any] = {"ground": {"type": "ground", "frames": {}}}
    joint: dict[str, Any] = {}
    across = {"z": [0.0, 1.0, 0.0], "x": [1.0, 0.0, 0.0]}
    for k in range(loops + 1):
        body["ground"]["frames"][f"P{k}"] = {"position": [float(k), 0.0, 0.0], "axes": across}
        body[f"upright{k}"] = {
            "type": "rigid",
            "mass": 1.0,
            "inertia": thin,
            "pose": {"position": [float(k), 0.0, 0.5]},
            "velocity": [0.5, 0.0, 0.0],
            "angular_velocity": [0.0, 1.0, 0.0],
            "frames": {"foot": {"position": [0.0, 0.0, -0.5], "axes": across}, "top": {"position": [0.0, 0.0, 0.5]}},
        }
        joint[f"P{k}"] = {"type": "revolute", "between": [f"ground.P{k}", f"upright{k}.foot"]}
    for k in range(loops):
        body[f"bar{k}"] = {
            "type": "rigid",
            "mass": 1.0,
            "inertia": thin,
            "pose": {"position": [k + 0.5, 0.0, 1.0], "axes": {"z": [1.0, 0.0, 0.0], "x": [0.0, 0.0, -1.0]}},
            "velocity": [1.0, 0.0, 0.0],
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


def show(results: list[dict[str, Any]]) -> str:
    """Both tables, with the exponent of the growth."""
    absent = [r for r in results if r["kind"] == "absent"]
    rows = [
        [
            f"{r['effect']}, against {r['scene']}",
            f"{r['stripped_us']:.2f}",
            f"{r['without_us']:.2f}",
            f"{r['ratio']:.3f}",
            percent(r["spread"]),
            "yes" if r["same_code"] else "no",
        ]
        for r in absent
    ]
    head = ("absent effect", "removed [us]", "never there [us]", "ratio", "spread", "same compiled code")
    loops = [r for r in results if r["kind"] == "loops" and "us" in r]
    lines = [[str(r["loops"]), f"{r['us']:.1f} ± {percent(r['spread'])}", short(r["us"] / r["loops"])] for r in loops]
    text = f"{table(head, rows)}\n\n{table(('loops', 'us per evaluation', 'us per loop'), lines)}"
    if len(loops) > 1:
        exponent = slope([r["loops"] for r in loops], [r["us"] for r in loops])
        text += f"\n\nTime grows as the number of loops to the power {exponent:.2f}."
    for r in results:
        if "skipped" in r:
            text += f"\n\n{r['loops']} loops skipped: {r['skipped']}"
    return text
