"""Cases of the stability atlas: scenes of the 4-SPS/PS mechanism with varied parameters, and their verdicts.

Sweeps vary one parameter at a time over its range; random points vary all parameters.
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
from flexclear import dynamics
from flexclear.artifacts import quantities
from flexclear.artifacts.paths import PROJECT
from flexclear.dynamics.run.run import engine_of
from flexclear.scene.integrators import DEFAULT
from flexclear.scene.load import compose, scene_of
from flexclear.scene.quantity import parse
from flexclear.scene.schema import Scene
from flexclear.stages.scenes import Workplace, bundles, open_workplace
from flexclear.system.errors import FlexclearError, SolverError
from flexclear.system.progress import silent
from flexclear.workflow.progress import Monitor

if TYPE_CHECKING:
    import xarray as xr

CLEARANCE, STIFFNESS = 0.5e-3, 1.3631e11  # Table 3 [m], eq. (26) with its data [N/m^1.5]
#: radii of the joint circles, start height [m], and the angles of the joints that are far from singular [deg]
RADIUS_A, RADIUS_B, HEIGHT = 0.1, 0.2, 0.35
ANGLE_A, ANGLE_B, SINGULAR = 30.0, 60.0, 45.0
STROKE, LIFT = 0.18, 0.06  # duration [s] and change of the driven legs [m]
#: limit of evaluations, above which a case is refused: about a minute with rigid bodies, twice what 100 strokes take
CAP = 8_000_000
#: Craig-Bampton counts that cut no pair of equal frequencies: 6 static modes and pairs, torsion, axial
MODES = (0, 6, 8, 10, 11, 13, 15, 30)
#: values of each swept parameter
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
#: further parameters that a swept parameter needs to have an effect
ALONG: dict[str, dict[str, Any]] = {"damping": {"modes": 13}}


@dataclass(frozen=True)
class Parameters:
    """One point of the atlas; the defaults are the paper's clearance model.

    clearance [m]; stiffness, speed and mass: factors; modes: modal coordinates of rod 1, 0 for a rigid rod; damping:
    modal damping ratio; nearness: 0 for the scene's geometry, 1 for the singular one (aligned squares); joints: number
    of clearance joints (A1..A4, C); strokes: number of repetitions of the motion.
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
    """Return all sweeps and `random` random points; another seed gives other points of the same distribution."""
    return [*_sweeps(), *_random(seed, random)]


def sweep(case: str) -> str:
    """Return the parameter that a case of this name varies, or `random`."""
    return case.partition(" ")[0]


def _sweeps() -> Iterator[Case]:
    for name, values in RANGES.items():
        base = replace(Parameters(), **ALONG.get(name, {}))
        for value in values:
            change: dict[str, Any] = {name: value}
            yield Case(f"{name} {value:.6g}", replace(base, **change))


def _random(seed: int, count: int) -> Iterator[Case]:
    """Yield points with every parameter uniform over its range (logarithmic over decades); one in four is flexible."""
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
    """Return the scene of a point; raise InputError when no valid scene describes the point."""
    moved = edits(layout(p.nearness), flexible=bool(p.modes)) if p.nearness else {}
    table = compose(PROJECT / "scenes" / "sps4" / "variants" / "first_csj.toml")
    _scale_mass(table["body"]["platform"], p.mass)
    joint = _contact(table["joint"]["A1"], p)
    for name in ("A1", "A2", "A3", "A4", "C")[: p.joints]:
        table["joint"][name] = {**joint, "between": list(table["joint"][name]["between"])}
    if p.modes:
        table["body"]["rod1"] = _flexible(table["body"]["rod1"], p)
    _time(table, p)
    # a fixed method: automatic selection would choose the loosest tolerance that suffices up to the horizon
    table["solver"] = {"integrator": DEFAULT, "evaluations": CAP} | ({"rtol": rtol} if rtol else {})
    table.pop("ensemble", None)
    made = scene_of(table, moved)
    made._name = "stability"
    return made


def layout(nearness: float) -> Layout:
    """Return the joints on two circles; nearness 0: angles of the scene, 1: aligned squares, which are singular."""
    a, b = np.deg2rad([own + nearness * (SINGULAR - own) for own in (ANGLE_A, ANGLE_B)])
    joints = RADIUS_A * np.cos(a), RADIUS_A * np.sin(a), RADIUS_B * np.cos(b), RADIUS_B * np.sin(b)
    ax, ay, bx, by = map(float, joints)
    return Layout(ax, ay, bx, by, HEIGHT)


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
    """Return the paper's rod with Craig-Bampton modes; its mesh frame is at the lower end, with x along the rod."""
    z, x = (np.array(rod["pose"]["axes"][k]) for k in "zx")
    lower = np.array(rod["pose"]["position"]) - (ROD_END - ROD_CENTRE) * z / np.linalg.norm(z)
    return {
        "type": "flexible",
        "mesh": str(PROJECT / "meshes" / "actuated_rod.toml"),
        "modes": {"reference": "craig-bampton", "count": p.modes, "interfaces": ["bottom", "top"]},
        "pose": {"position": lower.tolist(), "axes": {"x": z.tolist(), "y": x.tolist()}},
    } | ({"damping": p.damping} if p.damping else {})


def _scale_mass(body: dict[str, Any], factor: float) -> None:
    if factor != 1.0:
        body["mass"] = f"{float(body['mass'].split()[0]) * factor} kg"
        body["inertia"] = [f"{float(i.split()[0]) * factor} kg mm^2" for i in body["inertia"]]


def _time(table: dict[str, Any], p: Parameters) -> None:
    """Set consecutive strokes, each `speed` times as fast as the paper's."""
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


#: processor time after which a case counts as hanging [s]; the most expensive case takes a fifth of this limit
LIMIT = 600
#: factor of the tolerance in the comparison run, and limit of evaluations of runs that are compared
TIGHTER, TWICE = 1e-2, 300_000
TIGHTEST = 1e-14
#: a finished run is wrong above this energy error, as a fraction of the largest energy in its ledger,
LEDGER = 1e-4
#: above this opening of a loop [m],
CLOSURE = 1e-9
#: or above this difference of the platform's velocity from a run at tighter tolerance, as a fraction of its largest
#: value, up to the predictability horizon, where a run and its perturbed run differ by a tenth of that
DEVIATION = 1e-2


#: code that determines an outcome besides the core's
CODE = (scene.__module__, "flexclear.structure", "flexclear.dynamics")


def measure(cases: Sequence[Case], jobs: int) -> Measured:
    """Yield a record for each case, also for a case that hangs or dies."""
    for case, found in processes.outcomes(list(cases), jobs, run_case, LIMIT):
        yield case, [{"sweep": sweep(case.name), "parameters": asdict(case.of), **found}]


def run_case(parameters: Parameters, compiled: Callable[[], None] = lambda: None) -> Record:
    """Return the outcome of a case.

    Refusals are outcomes; any other failure is a fault of the program and gets the verdict WRONG.
    compiled: called when the kernels are compiled, so that a time limit may begin.
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
    except Exception as error:  # the atlas reports faults and continues
        reason = f"{type(error).__name__}: {error}"
        return {"verdict": WRONG, "reason": reason, "seconds": time.process_time() - begun}


@cache
def _place() -> Workplace:
    """Return the usual workplace, without progress output, for the lifetime of this process."""
    return replace(open_workplace(), monitor=Monitor(io.StringIO()))


def _deviation(parameters: Parameters, described: Scene, run: xr.Dataset) -> float:
    """Return the largest difference of the platform's velocity from a tighter run, up to the horizon, over its largest.

    NaN where a second run would cost too much, or where the tighter run fails.
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
    return quantities.largest_distance(run, tight, velocity, until) / quantities.scale(run, velocity)


def judge(run: xr.Dataset, deviation: float, seconds: float) -> Record:
    """Return the record of a finished run.

    method: integrator that made the run; switched: why it replaced the requested one.  ledger: largest energy error, as
    a fraction of the largest energy in the ledger.  closure: largest opening of a loop [m].  deviation: of the
    platform's velocity from that of a tighter run, up to the horizon, as a fraction of its largest; NaN without a
    comparison.  horizon_share: predictability horizon as a fraction of the run.  seconds: processor time [s].
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
    """Return what is wrong with a finished run, in words; empty when nothing is wrong."""
    # events other than closings have no peak: their gaps are intended
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
