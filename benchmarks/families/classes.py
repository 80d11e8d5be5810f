"""Classes of hard cases of the stability atlas: one small scene each, with a known result."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from benchmarks.family import FINISHED, REFUSED, WRONG, Case, Family, Record, each
from benchmarks.page import Columns, table
from flexclear import dynamics
from flexclear.dynamics import analyses
from flexclear.scene.load import scene_of
from flexclear.scene.schema import Scene
from flexclear.system.errors import FlexclearError
from flexclear.system.progress import silent

if TYPE_CHECKING:
    import xarray as xr

Table = dict[str, Any]
#: stiffness of a shaft's end [N/m, N/rad, N m/rad], and its disc [kg, kg m^2, m]
SIDE, MIXED, SLOPE = 164163.04446739165, 20520.380558423956, 3420.0634264039927
MASS, ACROSS, ALONG, ARM = 3.0, 0.02, 0.036, 0.25
#: axes that are parallel to none of the world's
OBLIQUE = {"z": [2.0, 6.0, 3.0], "x": [-3.0, 1.0, 0.0]}
UPRIGHT = {"z": [0.0, 0.0, 1.0], "x": [1.0, 0.0, 0.0]}


@dataclass(frozen=True)
class HardCase:
    """A scene of a class, and its examination.

    compared: quantity and reference of the comparison.  examine: returns the largest relative deviation of a run or of
    its frequencies.  limit: of that deviation; 0 where the scene must be refused.  refused: words of the refusal.
    """

    scene: Callable[[], Scene]
    compared: str
    examine: Callable[[Scene], float]
    limit: float = 0.0
    refused: str = ""


def run(scene: Scene) -> xr.Dataset:
    """Simulate a scene without flexible bodies."""
    return dynamics.simulate(scene, {}, silent)


def _scene(end: float, **parts: Any) -> Scene:
    return scene_of({"title": "hard case", "time": {"end": end}, "output": {"interval": end / 100}, **parts})


def _body(frames: Table, mass: float = 1.0, inertia: float = 0.01, **more: Any) -> Table:
    return {"type": "rigid", "mass": mass, "inertia": [inertia] * 3, "pose": {}, "frames": frames, **more}


def _ground(**frames: Any) -> Table:
    return {"type": "ground", "frames": frames}


# Rotors -------------------------------------------------------------------------------------------------------------


def rotor(speed: float, unbalance: float = 0.0, axes: Mapping[str, list[float]] = UPRIGHT, size: float = 1.0) -> Scene:
    """Return a disc at the end of a massless shaft on a driven hub; unbalance: offset of its centre along x [m].

    size: factor of all lengths, the unbalance included; forces per displacement, and frequencies, are unchanged.
    """
    K = np.diag([SIDE, SIDE, 1e8, SLOPE * size**2, SLOPE * size**2, 1e5 * size**2])
    K[0, 4] = K[4, 0] = -MIXED * size
    K[1, 3] = K[3, 1] = MIXED * size
    arm, z = ARM * size, np.array(axes["z"]) / np.linalg.norm(axes["z"])
    hub = _body({"o": {}, "s": {"position": [0.0, 0.0, arm]}}, 1.0, 0.01 * size**2, pose={"axes": axes})
    pose = {"position": (arm * z).tolist(), "axes": axes}
    disc = _body({"o": {}}, MASS, com=[unbalance * size, 0.0, 0.0], pose=pose)
    disc["inertia"] = [moment * size**2 for moment in (ACROSS, ACROSS, ALONG)]
    return _scene(
        0.01,
        body={"ground": _ground(o={"axes": axes}), "hub": hub, "disc": disc},
        joint={
            "axle": {"type": "revolute", "between": ["ground.o", "hub.o"]},
            "float": {"type": "free", "between": ["hub.s", "disc.o"]},
        },
        load={"shaft": {"type": "bushing", "between": ["hub.s", "disc.o"], "stiffness": K.tolist()}},
        drive={"motor": {"joint": "axle", "law": {"type": "polynomial", "coefficients": [0.0, speed]}}},
    )


def _steady(scene: Scene) -> xr.Dataset:
    found = analyses.frequencies(scene, {}, silent, moving=True)
    if found.attrs["growth"]:
        raise ArithmeticError(f"small motions grow: {found.attrs['growth']}")
    return found


def _deflection(scene: Scene) -> float:
    """Return the relative error of the deflection of the shaft's end against its closed form."""
    return abs(float(_steady(scene).frame_position.sel(frame="disc.o", axis="x")) / (deflection(150.0) * 1e-5) - 1.0)


def deflection(speed: float) -> float:
    """Return the deflection of the shaft's end per unbalance, in the rotating axes.

    (K - Omega^2 diag(m, I_t - I_p)) (x, p) = (m Omega^2 e, 0); Genta (2005), Dynamics of Rotating Systems, sec. 2.6.
    """
    K = np.array([[SIDE, -MIXED], [-MIXED, SLOPE]])
    return float(np.linalg.solve(K - speed**2 * np.diag([MASS, ACROSS - ALONG]), [MASS * speed**2, 0.0])[0])


def _as_upright(scene: Scene) -> float:
    known = _steady(rotor(150.0)).frequency.values
    return float(np.abs(_steady(scene).frequency.values / known - 1.0).max())


# Contacts and stops -------------------------------------------------------------------------------------------------


def driven_into_a_stop() -> Scene:
    """Return a slide that its drive moves 10 mm into a stop: no coordinate is free."""
    return _scene(
        0.9,
        body={"ground": _ground(o={}), "slide": _body({"o": {}})},
        joint={"rail": {"type": "prismatic", "between": ["ground.o", "slide.o"]}},
        drive={"motor": {"joint": "rail", "law": {"type": "harmonic", "amplitude": [0.1], "frequency": [20.0]}}},
        stop={"end": {"joint": "rail", "upper": 0.09, "normal": {"law": "hertz", "stiffness": 1e6}}},
    )


def _of_closings(scene: Scene, name: str) -> np.ndarray:
    found = run(scene)
    return found[name].values[found.event_kind.values == "closing"]


def _peak(scene: Scene) -> float:
    """Return the error of the three peak forces against k d^1.5 = 1000 N; NaN for another number of peaks."""
    peaks = _of_closings(scene, "event_peak_force")
    return float(np.abs(peaks / 1e3 - 1.0).max()) if len(peaks) == 3 else float("nan")


def bounce(**solver: Any) -> Scene:
    """Return a ball that falls 0.2 m onto a stiff plane."""
    normal = {"law": "hertz", "stiffness": 1e8}
    plane = {"type": "ball-on-plane", "between": ["ground.f", "ball.c"], "ball_radius": 0.1, "normal": normal}
    return _scene(
        1.0,
        body={"ground": _ground(f={}), "ball": _body({"c": {}}, pose={"position": [0.0, 0.0, 0.3]})},
        joint={"floor": plane},
        load={"weight": {"type": "gravity", "acceleration": [0.0, 0.0, -9.81]}},
        solver=solver,
    )


def graze(depth: float, rtol: float) -> Scene:
    """Return a mass on a spring, 10 rad/s and 0.1 m, that meets a plane at `depth` before its lowest point [m]."""
    return _ball_on_a_spring(-0.12 + depth, {"law": "hertz", "stiffness": 1e8}, rtol)


def _ball_on_a_spring(height: float, normal: Table, rtol: float, unit: float = 1.0) -> Scene:
    """Return a ball on a spring above a plane at a height [m]; unit: factor of the ball's lengths."""
    plane = {"type": "ball-on-plane", "between": ["ground.f", "ball.c"], "ball_radius": 0.02 * unit, "normal": normal}
    floor, place = {"position": [0.0, 0.0, height]}, {"position": [0.0, 0.0, 0.1 * unit]}
    return _scene(
        3.0,
        body={"ground": _ground(o={}, f=floor), "ball": _body({"o": {}, "c": {}}, 1.0, 0.01 * unit**2, pose=place)},
        joint={"rail": {"type": "prismatic", "between": ["ground.o", "ball.o"]}, "floor": plane},
        load={"spring": {"type": "joint-spring", "joint": "rail", "stiffness": 100.0}},
        solver={"rtol": rtol},
    )


def _graze_speed(depth: float) -> Callable[[Scene], float]:
    def examined(scene: Scene) -> float:
        """Return the error of the five closing speeds, sqrt(2 w^2 A d - w^2 d^2); above 1 for a negative speed."""
        speeds = _of_closings(scene, "event_approach_speed")
        known = 10.0 * np.sqrt(0.2 * depth - depth**2)
        return float(np.abs(speeds / known - 1.0).max()) if len(speeds) == 5 else float("nan")

    return examined


def small_bounce(unit: float) -> Scene:
    """Return a lossy ball on a spring that meets a plane; `unit` scales all lengths, and forces per mass as well."""
    normal = {"law": "lankarani-nikravesh", "restitution": 0.6, "stiffness": 1e6 * unit**-0.5}
    return _ball_on_a_spring(-0.09 * unit, normal, 1e-10, unit)


def _as_in_metres(unit: float) -> Callable[[Scene], float]:
    def examined(scene: Scene) -> float:
        pairs = (small_bounce(1.0), 1.0), (scene, unit)
        speeds = [_of_closings(one, "event_approach_speed") / size for one, size in pairs]
        if len(speeds[0]) != len(speeds[1]) or len(speeds[0]) < 5:
            return float("nan")
        return float(np.abs(speeds[1] / speeds[0] - 1.0).max())

    return examined


# Sizes, turns, controllers, frames ----------------------------------------------------------------------------------


def stage_next_to_a_crane() -> Scene:
    """Return a stage that vibrates by 1 nm next to a swinging jib of 100 m, without any connection."""
    jib = _body({"o": {}}, 1e5, 1e6, com=[100.0, 0.0, 0.0])
    stage = _body({"o": {}}, pose={"position": [1.0, 0.0, 1e-9]})
    return _scene(
        2.0,
        body={"ground": _ground(o={}, q={"position": [1.0, 0.0, 0.0]}), "stage": stage, "jib": jib},
        joint={
            "rail": {"type": "prismatic", "between": ["ground.q", "stage.o"]},
            "hinge": {"type": "revolute", "between": ["ground.o", "jib.o"]},
        },
        load={
            "weight": {"type": "gravity", "acceleration": [0.0, -9.81, 0.0]},
            "spring": {"type": "joint-spring", "joint": "rail", "stiffness": 400.0},
        },
        solver={"rtol": 1e-10},
    )


def _vibration(scene: Scene) -> float:
    found = run(scene)
    z = found.position.sel(body="stage", axis="z").values
    return float(np.abs(z / 1e-9 - np.cos(20.0 * found.time.values)).max())


def wound_bushing() -> Scene:
    """Return a free body on an isotropic bushing that turns by 3.54 rad to either side."""
    spinning = _body({"o": {}}, angular_velocity=[0.0, 0.0, 50.0])
    stiffness = [1000.0, 1000.0, 1000.0, 2.0, 2.0, 2.0]
    load = {"type": "bushing", "between": ["ground.o", "body.o"], "stiffness": stiffness}
    return _scene(1.0, body={"ground": _ground(o={}), "body": spinning}, load={"bushing": load})


def _spin(scene: Scene) -> float:
    """Return the error of the spin against 50 cos(w t) rad/s, w^2 = 2/0.01 1/s^2."""
    found = run(scene)
    spin = found.angular_velocity.sel(body="body", axis="z").values
    return float(np.abs(spin / 50.0 - np.cos(np.sqrt(200.0) * found.time.values)).max())


def fast_sampler() -> Scene:
    """Return a controller whose period is too long for its gain."""
    control = {"type": "sampled-pid", "joint": "rail", "reference": 0.1, "proportional": 5e3, "period": 0.1}
    return _scene(
        6.0,
        body={"ground": _ground(o={}), "slide": _body({"o": {}})},
        joint={"rail": {"type": "prismatic", "between": ["ground.o", "slide.o"]}},
        load={"control": control},
    )


def meshed_loop() -> Scene:
    """Return a turning planar four-bar; its coupler's frames, as of a mesh, are off by up to 2.4e-7 m."""
    off = [[1.1e-7, -1.9e-7, 9e-8], [-2e-7, 6e-8, -1.2e-7]]
    corners = np.array([[0.0, 0.0, 0.0], [0.0, 0.05, 0.0], [0.2, 0.15, 0.0], [0.2, 0.0, 0.0]])
    bodies: Table = {"ground": _ground(o0={}, o3={"position": [0.2, 0.0, 0.0]})}
    for k, name in enumerate(("crank", "coupler", "rocker")):
        ends = np.array([np.zeros(3), corners[k + 1] - corners[k]]) + (np.array(off) if k == 1 else 0.0)
        frames = {end: {"position": p.tolist()} for end, p in zip("ab", ends, strict=True)}
        bodies[name] = _body(frames, pose={"position": corners[k].tolist()})
    bodies["coupler"]["frame_tolerance"] = 5e-7
    pins = (("o0", "ground.o0", "crank.a"), ("A", "crank.b", "coupler.a"), ("B", "coupler.b", "rocker.a"))
    joint = {n: {"type": "revolute", "between": [a, b]} for n, a, b in (*pins, ("o3", "ground.o3", "rocker.b"))}
    law = {"type": "polynomial", "coefficients": [0.0, 10.0]}
    return _scene(1.0, body=bodies, joint=joint, drive={"motor": {"joint": "o0", "law": law}})


def quick_return() -> Scene:
    """Return a driven crank whose pin slides in the slot of a rocker, the slot without clearance."""
    bodies = {"ground": _ground(o={}, p={"position": [0.0, -0.2, 0.0]})}
    bodies["crank"] = _body({"o": {}, "pin": {"position": [0.08, 0.0, 0.0]}})
    pose = {"position": [0.0, -0.2, 0.0], "rotation_vector": [0.0, 0.0, float(np.arctan2(0.2, 0.08))]}
    bodies["rocker"] = _body({"p": {}, "slot": {"position": [0.2, 0.0, 0.0]}}, pose=pose)
    pins = {"o": ("ground.o", "crank.o"), "p": ("ground.p", "rocker.p"), "slot": ("rocker.slot", "crank.pin")}
    joint = {n: {"type": "slot" if n == "slot" else "revolute", "between": [*pair]} for n, pair in pins.items()}
    drive = {"motor": {"joint": "o", "law": {"type": "polynomial", "coefficients": [0.0, 10.0]}}}
    return _scene(1.0, body=bodies, joint=joint, drive=drive)


def _sliding(scene: Scene) -> float:
    """Return the error of the pin's way along the slot, as a fraction of the crank."""
    found = run(scene)
    angle = 10.0 * found.time.values
    way = np.hypot(0.08 * np.cos(angle), 0.2 + 0.08 * np.sin(angle)) - 0.2
    slid = found.joint_position.sel(coordinate="slot.translation").values
    return float(np.abs(slid - way).max() / 0.08)


def _ledger(scene: Scene) -> float:
    found = run(scene)
    return float(np.abs(found.energy_error).max() / np.abs(found.kinetic).max())


def _opening(scene: Scene) -> float:
    return float(run(scene).constraint_error.max()) / 0.2


# Scenes that say too little about themselves --------------------------------------------------------------------------


def strobed(solver: Table) -> Scene:
    """Return a mass on a spring, 20 rad/s, whose outputs are a period apart."""
    period = 2.0 * np.pi / 20.0
    return _scene(
        10.0 * period,
        body={"ground": _ground(o={}), "mass": _body({"o": {}}, pose={"position": [0.0, 0.0, 0.01]})},
        joint={"rail": {"type": "prismatic", "between": ["ground.o", "mass.o"]}},
        load={"spring": {"type": "joint-spring", "joint": "rail", "stiffness": 400.0}},
        output={"interval": period},
        solver=solver,
    )


def _exchange(scene: Scene) -> float:
    """Return what is missing of the 0.02 J that go to and fro, as far as the steps meet them."""
    return max(0.0, 1.0 - float(run(scene).attrs["exchanged_energy"]) / 0.02)


def resting_on_a_stop() -> Scene:
    """Return a lever that its weight holds on a stop of 1e6 N m/rad, at its equilibrium."""
    turned = {"axes": {"z": [0.0, 1.0, 0.0], "x": [1.0, 0.0, 0.0]}}
    return _scene(
        0.01,
        body={"ground": _ground(o=turned), "lever": _body({"o": turned}, com=[0.5, 0.0, 0.0])},
        joint={"hinge": {"type": "revolute", "between": ["ground.o", "lever.o"]}},
        load={"weight": {"type": "gravity", "acceleration": [0.0, 0.0, -9.81]}},
        stop={"end": {"joint": "hinge", "upper": 0.0, "normal": {"law": "hertz", "exponent": 1, "stiffness": 1e6}}},
        start={"at": "equilibrium"},
    )


def _torque(scene: Scene) -> float:
    return float(np.abs(run(scene).contact_normal_force / (9.81 * 0.5) - 1.0).max())


def block_without_mass(mass: float = 1e-9) -> Scene:
    """Return a slider-crank whose weight moves it, and whose block has a negligible mass [kg]."""
    along = {"axes": {"z": [1.0, 0.0, 0.0], "x": [0.0, 1.0, 0.0]}}
    bodies = {
        "ground": _ground(o={}, guide=along),
        "crank": _body({"a": {}, "b": {"position": [0.5, 0.0, 0.0]}}),
        "rod": _body({"a": {}, "b": {"position": [1.0, 0.0, 0.0]}}, com=[0.5, 0.0, 0.0]),
        "block": _body({"a": {}, "guide": along}, mass, mass),
    }
    for name in ("crank", "rod", "block"):
        del bodies[name]["pose"]
    pins = {"main": ("ground.o", "crank.a"), "pin": ("crank.b", "rod.a"), "wrist": ("rod.b", "block.a")}
    joint = {name: {"type": "revolute", "between": list(ends)} for name, ends in pins.items()}
    joint["guide"] = {"type": "prismatic", "between": ["ground.guide", "block.guide"]}
    weight = {"type": "gravity", "acceleration": [0.0, -9.81, 0.0]}
    start = {"main": {"position": 1.0}, "guide": {"near": 1.2}}
    return _scene(1.0, body=bodies, joint=joint, load={"weight": weight}, start={"joint": start})


def _as_heavier(scene: Scene) -> float:
    """Return the difference of the crank's angle from that with a block of 1 mg, in units of 1 rad."""
    angles = [run(one).joint_position.sel(coordinate="main").values for one in (scene, block_without_mass(1e-6))]
    return float(np.abs(angles[1] - angles[0]).max())


#: the cases by name
LONG, UNBALANCED = {"integrator": "exponential"}, ("refusal", _ledger, 0.0, "the energy balance does not close")
CASES: dict[str, HardCase] = {
    "unbalanced rotor above its critical speed": HardCase(
        partial(rotor, 150.0, 1e-5), "deflection, closed form", _deflection, 1e-3
    ),
    "oblique rotor": HardCase(lambda: rotor(150.0, 0.0, OBLIQUE), "frequencies, upright rotor", _as_upright, 1e-7),
    "driven into a stop": HardCase(driven_into_a_stop, "peak forces, closed form", _peak, 1e-6),
    "multistep across impacts": HardCase(
        lambda: bounce(integrator="adams-bashforth-moulton", step=1e-3, events="at step ends"), *UNBALANCED
    ),
    "steps longer than an impact": HardCase(lambda: bounce(integrator="rk4", step=0.05, events="located"), *UNBALANCED),
    "1 nm next to 100 m": HardCase(stage_next_to_a_crane, "vibration, closed form", _vibration, 1e-8),
    "bushing beyond half a turn": HardCase(wound_bushing, "spin, closed form", _spin, 1e-7),
    "graze, 1e-7 of the amplitude": HardCase(
        partial(graze, 1e-8, 1e-10), "closings, closed form", _graze_speed(1e-8), 1e-2
    ),
    "graze at rtol 1e-4": HardCase(partial(graze, 1e-3, 1e-4), "closings, closed form", _graze_speed(1e-3), 1e-2),
    "diverging sampled controller": HardCase(fast_sampler, "refusal", _ledger, refused="the motion diverges"),
    "impacts of 0.1 um": HardCase(partial(small_bounce, 1e-6), "closings, as in metres", _as_in_metres(1e-6), 1e-6),
    "loop of a meshed body": HardCase(meshed_loop, "loops, per length", _opening, 1e-10),
    "pin in a slot without clearance": HardCase(quick_return, "sliding, closed form", _sliding, 1e-9),
    "output once a period": HardCase(partial(strobed, {}), "exchanged energy, closed form", _exchange, 0.5),
    "the same with long steps": HardCase(partial(strobed, LONG), "exchanged energy, closed form", _exchange, 0.5),
    "at rest on a stop": HardCase(resting_on_a_stop, "torque of the stop, closed form", _torque, 1e-6),
    "block without mass in a loop": HardCase(block_without_mass, "angle, with a block of 1 mg", _as_heavier, 1e-4),
}


COLUMNS: Columns = {
    "case": lambda r: r["case"],
    "outcome": lambda r: r["verdict"],
    "compared": lambda r: r["compared"],
    "largest deviation": lambda r: "–" if r["deviation"] is None else f"{r['deviation']:.1e}",
    "counts as wrong above": lambda r: f"{r['limit']:.0e}" if r["limit"] else "–",
}


def examined(name: str) -> Record:
    """Return the outcome of a case: `verdict`, `reason`, largest `deviation`, seconds with compiling."""
    case, begun, deviation, reason = CASES[name], time.process_time(), None, ""
    try:
        deviation = case.examine(case.scene())
        verdict = FINISHED if deviation < case.limit else WRONG
        reason = "" if verdict == FINISHED else f"off by {deviation:.1e}, where it should be below {case.limit:.0e}"
    except FlexclearError as error:
        verdict, reason = REFUSED if case.refused and case.refused in str(error) else WRONG, str(error)
    except ArithmeticError as error:
        verdict, reason = WRONG, str(error)
    facts = {"compared": case.compared, "limit": case.limit, "deviation": deviation}
    return {"verdict": verdict, "reason": reason, **facts, "seconds": time.process_time() - begun}


def show(records: list[Record]) -> str:
    """Return a table, and the first part of the messages of the cases that did not finish."""
    messages = [
        f"- {r['case']} ({r['verdict']}): {' '.join(r['reason'].split()).partition('; ')[0]}"
        for r in records
        if r["reason"]
    ]
    return table(records, COLUMNS) + (
        "\n\nMessages of the cases that did not finish:\n\n" + "\n".join(messages) + "\n" if messages else ""
    )


FAMILY = Family(
    what="classes of hard cases, each with a closed form, a second computation or a refusal",
    takes="2 min",
    page="stability.md",
    cases=lambda: [Case(name) for name in CASES],
    measure=each(lambda case: [examined(case.name)]),
    show=show,
    times=False,
    code=("flexclear.dynamics",),
)
