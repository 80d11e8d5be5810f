"""The cases of the atlas, and a scene for each: the 4-SPS/PS mechanism with its parameters free.

One parameter at a time is moved over its range, and there are random points of all of them.
"""

from __future__ import annotations

import io
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np

from benchmarks import processes
from benchmarks.family import FINISHED, REFUSED, WRONG, Case, Measured, Record
from benchmarks.layouts import ROD_CENTRE, ROD_END, Layout, edits
from flexclear.commands.scenes import Workplace, bundles, open_workplace
from flexclear.pipeline import dynamics
from flexclear.pipeline.core.artifacts import quantities
from flexclear.pipeline.core.scene.integrators import DEFAULT
from flexclear.pipeline.core.scene.load import compose, scene_of
from flexclear.pipeline.core.scene.quantity import parse
from flexclear.pipeline.core.scene.schema import Scene
from flexclear.pipeline.core.system.errors import FlexclearError, SolverError
from flexclear.pipeline.core.system.progress import silent
from flexclear.pipeline.core.workflow.fingerprint import TREE
from flexclear.pipeline.core.workflow.progress import Monitor
from flexclear.pipeline.core.workflow.task import in_order
from flexclear.pipeline.dynamics.run.run import engine_of
from flexclear.stages.graph import Graph

if TYPE_CHECKING:
    import xarray as xr

CLEARANCE, STIFFNESS = 0.5e-3, 1.3631e11  # Table 3 [m], eq. (26) with its data [N/m^1.5]
#: radii of the joint circles, start height [m], and the angles of the joints that are far from singular [deg]
RADIUS_A, RADIUS_B, HEIGHT = 0.1, 0.2, 0.35
ANGLE_A, ANGLE_B, SINGULAR = 30.0, 60.0, 45.0
STROKE, LIFT = 0.18, 0.06  # duration [s] and change of the driven legs [m]
#: evaluations after which a case counts as refused: with rigid bodies about a minute; a hundred strokes take half of it
CAP = 8_000_000
#: Craig-Bampton counts that cut no pair of equal frequencies: 6 static modes and pairs, torsion, axial
MODES = (0, 6, 8, 10, 11, 13, 15, 30)
#: ranges over which single parameters are varied; logarithmic ones by decades
RANGES: dict[str, tuple[float, ...]] = {
    "clearance": tuple(np.geomspace(1e-6, 2e-3, 14).tolist()),
    "stiffness": tuple(np.geomspace(1e-2, 1e4, 13).tolist()),
    "restitution": tuple(np.linspace(0.0, 1.0, 11).tolist()),
    "friction": tuple(np.linspace(0.0, 0.5, 11).tolist()),
    "speed": tuple(np.geomspace(0.1, 20.0, 10).tolist()),
    "mass": tuple(np.geomspace(1e-3, 1e3, 13).tolist()),
    "modes": MODES,
    "damping": (0.0, 0.001, 0.005, 0.01, 0.02, 0.05),
    "nearness": (0.0, *(1.0 - np.geomspace(1e-1, 1e-6, 6)).tolist()),
    "joints": (1, 2, 3, 4, 5),
    "strokes": (1, 10, 100),
}
#: the parameter that another one needs to mean anything
ALONG: dict[str, dict[str, Any]] = {"damping": {"modes": 13}}


@dataclass(frozen=True)
class Parameters:
    """One point of the atlas; the defaults are the paper's clearance model.

    clearance [m]; stiffness, speed and mass: factors; modes: elastic coordinates kept, 0 for a rigid rod; damping:
    modal damping ratio; nearness: 0 for the scene's geometry, 1 for the singular one (aligned squares); joints: number
    of clearance joints (A1..A4, C); strokes: how often the motion is repeated.
    """

    clearance: float = CLEARANCE
    stiffness: float = 1.0
    restitution: float = 0.9
    friction: float = 0.15
    speed: float = 1.0
    mass: float = 1.0
    modes: int = 0
    damping: float = 0.0
    nearness: float = 0.0
    joints: int = 1
    strokes: int = 1


def cases(seed: int, random: int) -> list[Case]:
    """All single sweeps, and so many random points; other seeds give others of the same kind."""
    return [*_sweeps(), *_random(seed, random)]


def sweep(case: str) -> str:
    """The parameter that moves in a case of this name, or `random`."""
    return case.partition(" ")[0]


def _sweeps() -> Iterator[Case]:
    for name, values in RANGES.items():
        base = replace(Parameters(), **ALONG.get(name, {}))
        for value in values:
            change: dict[str, Any] = {name: value}
            yield Case(f"{name} {value:.6g}", replace(base, **change))


def _random(seed: int, count: int) -> Iterator[Case]:
    """Every parameter uniform over its range (logarithmic where it spans decades); flexible rods in one of four."""
    random = np.random.default_rng(seed)
    for k in range(count):
        flexible = random.random() < 0.25
        yield Case(
            f"random {seed}/{k + 1}",
            Parameters(
                clearance=float(np.exp(random.uniform(np.log(1e-6), np.log(2e-3)))),
                stiffness=float(np.exp(random.uniform(np.log(1e-2), np.log(1e4)))),
                restitution=float(random.uniform(0.0, 1.0)),
                friction=float(random.choice([0.0, random.uniform(0.0, 0.5)])),
                speed=float(np.exp(random.uniform(np.log(0.1), np.log(20.0)))),
                mass=float(np.exp(random.uniform(np.log(1e-3), np.log(1e3)))),
                modes=int(random.choice(MODES[1:6])) if flexible else 0,
                damping=float(random.uniform(0.0, 0.05)) if flexible else 0.0,
                nearness=float(1.0 - 10.0 ** random.uniform(-6.0, 0.0)),
                joints=int(random.integers(1, 6)),
            ),
        )


def scene(p: Parameters, rtol: float | None = None) -> Scene:
    """The scene of a point. Raises InputError when it cannot be described."""
    moved = edits(layout(p.nearness), flexible=bool(p.modes)) if p.nearness else {}
    table = compose(TREE / "scenes" / "sps4" / "variants" / "first_csj.toml")
    _scale_mass(table["body"]["platform"], p.mass)
    joint = _contact(table["joint"]["A1"], p)
    for name in ("A1", "A2", "A3", "A4", "C")[: p.joints]:
        table["joint"][name] = {**joint, "between": list(table["joint"][name]["between"])}
    if p.modes:
        table["body"]["rod1"] = _flexible(table["body"]["rod1"], p)
    _time(table, p)
    # a method of its own: the program would look for the loosest tolerance that suffices up to the horizon
    table["solver"] = {"integrator": DEFAULT, "evaluations": CAP} | ({"rtol": rtol} if rtol else {})
    table.pop("ensemble", None)
    made = scene_of(table, moved)
    made._name = "stability"
    return made


def layout(nearness: float) -> Layout:
    """Joints on two circles, from the scene's own angles (0) to those of aligned squares, which are singular (1)."""
    angles = np.deg2rad([own + nearness * (SINGULAR - own) for own in (ANGLE_A, ANGLE_B)])
    (ax, ay), (bx, by) = (
        radius * np.array([np.cos(angle), np.sin(angle)])
        for radius, angle in zip((RADIUS_A, RADIUS_B), angles, strict=True)
    )
    return Layout(float(ax), float(ay), float(bx), float(by), HEIGHT)


def _contact(joint: Mapping[str, Any], p: Parameters) -> dict[str, Any]:
    found = {k: v for k, v in joint.items() if k not in ("socket_material", "ball_material", "source")}
    found["clearance"] = p.clearance
    found["normal"] = {**joint["normal"], "restitution": p.restitution, "stiffness": STIFFNESS * p.stiffness}
    if p.friction > 0.0:
        found["friction"] = {**joint["friction"], "static": p.friction, "dynamic": p.friction / 1.5}
    else:
        found.pop("friction")
    return found


def _flexible(rod: Mapping[str, Any], p: Parameters) -> dict[str, Any]:
    """The paper's rod with Craig-Bampton modes; its mesh frame lies at the lower end, x along the rod."""
    z, x = (np.array(rod["pose"]["axes"][k]) for k in "zx")
    lower = np.array(rod["pose"]["position"]) - (ROD_END - ROD_CENTRE) * z / np.linalg.norm(z)
    return {
        "type": "flexible",
        "mesh": str(TREE / "meshes" / "actuated_rod.toml"),
        "modes": {"reference": "craig-bampton", "count": p.modes, "interfaces": ["bottom", "top"]},
        "pose": {"position": lower.tolist(), "axes": {"x": z.tolist(), "y": x.tolist()}},
    } | ({"damping": p.damping} if p.damping else {})


def _scale_mass(body: dict[str, Any], factor: float) -> None:
    if factor != 1.0:
        body["mass"] = f"{float(body['mass'].split()[0]) * factor} kg"
        body["inertia"] = [f"{float(i.split()[0]) * factor} kg mm^2" for i in body["inertia"]]


def _time(table: dict[str, Any], p: Parameters) -> None:
    """Strokes one after the other, each `speed` times as fast as the paper's."""
    half = 0.5 * STROKE / p.speed
    starts = [k * half for k in range(2 * p.strokes)]
    law = {
        "type": "step",
        "start": starts,
        "end": [s + half for s in starts],
        "change": [LIFT, -LIFT] * p.strokes,
    }
    for leg in ("P1", "P2"):
        table["drive"][leg] = {"joint": leg, "law": law}
    table["time"] = {"end": 2 * p.strokes * half}
    table["output"] = {"interval": p.strokes * STROKE / p.speed / 1800}


#: processor time of a case after which it counts as hanging [s]; the dearest takes a fifth of it
LIMIT = 600
#: how much tighter the run is that a finished one is compared with, and runs so dear are not made twice
TIGHTER, TWICE = 1e-2, 300_000
TIGHTEST = 1e-14
#: a finished run is wrong when its energy is off by more than this share of the energy that passed through it,
LEDGER = 1e-4
#: when a loop is open by more than this [m],
CLOSURE = 1e-9
#: or when its platform's speed is off by more than this share of the largest, from that of a run at tighter tolerance,
#: before its own horizon, which ends where a run and its perturbed run separate by a tenth of that
DEVIATION = 1e-2


def modules(case: Case) -> set[str]:
    """What decides about a case: its scene, the dynamics, the stages before them, and the parts that it names."""
    tasks = in_order([Graph(scene(case.of), shown=False).simulate])
    named = {name for task in tasks for name in task.roots()}
    return {scene.__module__, "flexclear.pipeline.dynamics", *named}


def measure(cases: Sequence[Case], jobs: int) -> Measured:
    """A record for each case; one that hangs or dies is an outcome, too."""
    for case, found in processes.outcomes(list(cases), jobs, run_case, LIMIT):
        yield case, [{"sweep": sweep(case.name), "parameters": asdict(case.of), **found}]


def run_case(parameters: Parameters, compiled: Callable[[], None] = lambda: None) -> Record:
    """What becomes of a case.

    Refusals are outcomes; anything else that goes wrong is a fault of the program and listed as such.
    compiled: called when the kernels are there, so that a limit of time may begin.
    """
    begun = time.process_time()
    try:
        described = scene(parameters)
        reduced = bundles(described, _place())
        engine_of(described, reduced, silent)
        compiled()
        begun = time.process_time()
        run = dynamics.simulate(described, reduced, silent)
        seconds = time.process_time() - begun
        return judge(run, _deviation(parameters, described, run), seconds)
    except SolverError as error:
        return {"verdict": REFUSED, "reason": str(error), "seconds": time.process_time() - begun}
    except Exception as error:  # the atlas reports faults, it does not stop at them
        reason = f"{type(error).__name__}: {error}"
        return {"verdict": WRONG, "reason": reason, "seconds": time.process_time() - begun}


@cache
def _place() -> Workplace:
    """The usual one, for as long as this process lives; nobody watches it."""
    return replace(open_workplace(), monitor=Monitor(io.StringIO()))


def _deviation(parameters: Parameters, described: Scene, run: xr.Dataset) -> float:
    """Largest difference of the platform's velocity from that of a tighter run, up to the horizon, over its largest.

    Not a number where the run is too dear to be made twice, or the tighter one cannot be had.
    """
    if int(run.attrs["evaluations"]) > TWICE:
        return float("nan")
    tight_scene = scene(parameters, max(TIGHTEST, described.solver.rtol * TIGHTER))
    try:
        tight = dynamics.simulate(tight_scene, bundles(tight_scene, _place()), silent)
    except FlexclearError:
        return float("nan")
    velocity = parse("platform.velocity", described.owners())
    until = min(float(run["horizon"]), float(tight["horizon"]))
    return quantities.error(run, tight, velocity, until) / quantities.scale(run, velocity)


def judge(run: xr.Dataset, deviation: float, seconds: float) -> Record:
    """The outcome of a finished run.

    method: the integrator that made the run; switched: why it took the place of the one asked for.  ledger: largest
    energy error, as a share of the largest energy in the ledger.  closure: largest opening of a loop [m].  deviation:
    of the platform's velocity from that of a tighter run, up to the horizon, as a share of its largest; not a number
    where that was not looked for.  horizon_share: how much of the run can be believed point by point.  seconds: of
    processor time.
    """
    energies = ("kinetic", "potential", "elastic", "dissipated", "drive_work")
    largest = max(float(np.abs(run[name]).max()) for name in energies)
    ledger = float(np.abs(run["energy_error"]).max()) / largest
    closure = float(run["constraint_error"].max())
    start, end = float(run["time"][0]), float(run["time"][-1])
    reason = fault(run, ledger, closure, deviation)
    closings = run["event_kind"].values == "closing"
    return dict(
        verdict=WRONG if reason else FINISHED,
        reason=reason,
        method=str(run.attrs["method"]),
        switched=str(run.attrs.get("switched", "")),
        ledger=ledger,
        closure=closure,
        deviation=deviation,
        horizon_share=(float(run["horizon"]) - start) / (end - start),
        impacts=int(closings.sum()),
        peak_force=float(run["event_peak_force"].values[closings].max(initial=0.0)),
        evaluations=int(run.attrs["evaluations"]),
        seconds=seconds,
    )


def fault(run: xr.Dataset, ledger: float, closure: float, deviation: float) -> str:
    """What is wrong with a finished run, in words; empty when nothing is."""
    # an event that is no closing has no peak, so that its columns have gaps on purpose
    series = [name for name in run.data_vars if not str(name).startswith("event_")]
    if not all(np.isfinite(run[name]).all() for name in series):
        return "values that are not finite"
    if not ledger <= LEDGER:
        return f"energy off by {ledger:.1e} of the largest energy"
    if not closure <= CLOSURE:
        return f"a loop open by {closure:.1e} m"
    if "contact_friction_power" in run and float(run["contact_friction_power"].max()) > 0.0:
        return "friction feeds energy in"
    if deviation > DEVIATION:
        return f"velocity off by {deviation:.1e} of the largest before the horizon"
    return ""
