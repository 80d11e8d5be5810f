"""Classes of hard cases of the stability atlas: one small scene each, with a known result."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from benchmarks import hard_scenes as scenes
from benchmarks.families import turning
from benchmarks.family import FINISHED, REFUSED, WRONG, Case, Family, Record, each
from benchmarks.page import Columns, table
from flexclear import dynamics
from flexclear.dynamics import analyses
from flexclear.scene.schema import Scene
from flexclear.system.errors import FlexclearError
from flexclear.system.progress import silent

if TYPE_CHECKING:
    import xarray as xr


@dataclass(frozen=True)
class HardCase:
    """The examination of a scene of a class.

    compared: quantity and reference of the comparison.  examine: returns the largest relative deviation of a run or of
    frequencies.  limit: of that deviation; 0 where the scene must be refused.  refused: words of the refusal.
    """

    compared: str
    examine: Callable[[], float]
    limit: float = 0.0
    refused: str = ""


def run(scene: Scene) -> xr.Dataset:
    """Simulate a scene without flexible bodies."""
    return dynamics.simulate(scene, {}, silent)


def _steady(scene: Scene) -> xr.Dataset:
    found = analyses.frequencies(scene, {}, silent, moving=True)
    if found.attrs["growth"]:
        raise ArithmeticError(f"small motions grow: {found.attrs['growth']}")
    return found


def _deflection() -> float:
    """Return the relative error of the deflection of the shaft's end against its closed form."""
    found = _steady(scenes.rotor(150.0, 1e-5)).frame_position.sel(frame="disc.o", axis="x")
    return abs(float(found) / (scenes.deflection(150.0) * 1e-5) - 1.0)


def _as_upright() -> float:
    known, found = (_steady(scenes.rotor(150.0, 0.0, axes)).frequency for axes in (scenes.UPRIGHT, scenes.OBLIQUE))
    return float(np.abs(found.values / known.values - 1.0).max())


def _of_closings(scene: Scene, name: str) -> np.ndarray:
    found = run(scene)
    return found[name].values[found.event_kind.values == "closing"]


def _peak() -> float:
    """Return the error of the three peak forces against k d^1.5 = 1000 N; NaN for another number of peaks."""
    peaks = _of_closings(scenes.driven_into_a_stop(), "event_peak_force")
    return float(np.abs(peaks / 1e3 - 1.0).max()) if len(peaks) == 3 else float("nan")


def _graze_speed(depth: float, rtol: float) -> float:
    """Return the error of the five closing speeds, sqrt(2 w^2 A d - w^2 d^2); above 1 for a negative speed."""
    speeds = _of_closings(scenes.graze(depth, rtol), "event_approach_speed")
    known = 10.0 * np.sqrt(0.2 * depth - depth**2)
    return float(np.abs(speeds / known - 1.0).max()) if len(speeds) == 5 else float("nan")


def _as_in_metres(unit: float) -> float:
    speeds = [_of_closings(scenes.small_bounce(size), "event_approach_speed") / size for size in (1.0, unit)]
    if len(speeds[0]) != len(speeds[1]) or len(speeds[0]) < 5:
        return float("nan")
    return float(np.abs(speeds[1] / speeds[0] - 1.0).max())


def _vibration() -> float:
    found = run(scenes.stage_next_to_a_crane())
    z = found.position.sel(body="stage", axis="z").values
    return float(np.abs(z / 1e-9 - np.cos(20.0 * found.time.values)).max())


def _spin() -> float:
    """Return the error of the spin against 50 cos(w t) rad/s, w^2 = 2/0.01 1/s^2."""
    found = run(scenes.wound_bushing())
    spin = found.angular_velocity.sel(body="body", axis="z").values
    return float(np.abs(spin / 50.0 - np.cos(np.sqrt(200.0) * found.time.values)).max())


def _sliding() -> float:
    """Return the error of the pin's way along the slot, as a fraction of the crank."""
    found = run(scenes.quick_return())
    angle = 10.0 * found.time.values
    way = np.hypot(0.08 * np.cos(angle), 0.2 + 0.08 * np.sin(angle)) - 0.2
    slid = found.joint_position.sel(coordinate="slot.translation").values
    return float(np.abs(slid - way).max() / 0.08)


def _ledger(scene: Callable[[], Scene]) -> float:
    found = run(scene())
    return float(np.abs(found.energy_error).max() / np.abs(found.kinetic).max())


def _opening() -> float:
    return float(run(scenes.meshed_loop()).constraint_error.max()) / 0.2


def _exchange(**solver: str) -> float:
    """Return what is missing of the 0.02 J that go to and fro, as far as the steps meet them."""
    return max(0.0, 1.0 - float(run(scenes.strobed(solver)).attrs["exchanged_energy"]) / 0.02)


def _torque(**stop: float) -> float:
    return float(np.abs(run(scenes.resting_on_a_stop(**stop)).contact_normal_force / (9.81 * 0.5) - 1.0).max())


def _as_heavier() -> float:
    """Return the difference of the crank's angle from that with a block of 1 mg, in units of 1 rad."""
    runs = (run(scenes.block_without_mass(mass)) for mass in (1e-9, 1e-6))
    angles = [found.joint_position.sel(coordinate="main").values for found in runs]
    return float(np.abs(angles[1] - angles[0]).max())


def _moment_arm() -> float:
    """Return the error of the torque that holds the hip: F dL/dq with the knee's turn, which the gear adds."""
    hip, knee = np.radians([20.0, 30.0])
    across = np.array([-np.sin(hip), np.cos(hip)])
    tip = np.array([0.06 * np.cos(knee) - 0.03 * np.sin(knee), 0.06 * np.sin(knee) + 0.03 * np.cos(knee)])
    line = 0.4 * np.array([np.cos(hip), np.sin(hip)]) + tip - [-0.05, 0.06]
    arm = (0.4 * across + 1.5 * np.array([-tip[1], tip[0]])) @ line / np.linalg.norm(line)
    return float(np.abs(run(scenes.held_tendon()).drive_force / (100.0 * arm) - 1.0).max())


def _followed(count: int) -> float:
    found = run(scenes.cam_of_points(count))
    known = 0.05 - 0.05 * np.cos(2.0 * np.pi * found.time.values)
    return float(np.abs(found.joint_position.values[:, 0] - known).max() / 0.1)


def _alone() -> float:
    """Return the largest speed of the slides that were given none, as a fraction of the third one's."""
    found = run(scenes.row_of_slides()).velocity
    return float(np.abs(found.drop_sel(body="s3")).max() / np.abs(found.sel(body="s3")).max())


def _worst(case: str, speed: int = -1, kind: str = "error") -> float:
    """Return the largest relative error of frequencies or growth rates of a turning body at one of its speeds."""
    return float(turning.compared(case, turning.speeds(case)[speed])[kind])


def _unequal_bearings() -> float:
    """Return the error of the first four frequencies at 4000 rpm; Friswell et al. (2010), example 5.9.2, printed."""
    body = turning.CASES["8-5.9.1"]()
    scene = turning.two_discs(body, 1e6, 0.8e6)
    found = analyses.frequencies(scene, {"rod": turning.reduced(body)}, silent, moving=True)
    known = np.array([[82.33, 86.86, 239.64, 287.25]])
    return float(np.abs(2.0 * np.pi * found.frequency.values[:, None] / known - 1.0).min(axis=0).max())


def _twist_energy() -> float:
    """Return the error of the elastic energy, as a fraction of its largest value, 6e-3 J."""
    found = turning.twisted(turning.CASES["1-clamped-free"]())
    rows = [row for row in turning.known()["7-torque"]["values"] if row[0] == "elastic energy"]
    energies = [float(found["elastic"].sel(time=t, method="nearest")) - value for _, t, value, _ in rows[:5]]
    return float(np.abs(energies).max() / 6e-3)


def _struck() -> float:
    """Return the error of the end's path as a fraction of its largest deflection, 2.3e-4 m."""
    return float(turning.path_error(turning.spun_up(stiffening=True)).max() / 2.3e-4)


#: turning bodies: case of `families.turning`, index of its speed, limit of the error.  Shapes that are linear in the
#: modes miss these values by 3e-4 (the two-disc rotor) to 0.3
TURNING = {
    "torsion of a fast shaft": ("1-clamped-free", -1, 2e-3),
    "whirl, Euler-Bernoulli shaft": ("2-euler-bernoulli-pins", -2, 1e-3),
    "whirl, Rayleigh shaft": ("2-rayleigh-pins", -2, 1e-3),
    "whirl, Timoshenko shaft": ("2-timoshenko-pins", -2, 1e-3),
    "thick disc as a rigid body": ("3a", -1, 1e-4),
    "thick disc as a section": ("3b", -1, 1e-4),
    "two-disc rotor at 4000 rpm": ("8-5.9.1", -1, 2e-4),
    "blade, pitch 0": ("5-rayleigh-pitch0", -1, 2e-3),
    "blade, pitch 45 degrees": ("5-rayleigh-pitch45", -1, 5e-3),
    "inward blade below its buckling": ("6-rayleigh", -2, 2e-3),
}
FREQUENCIES = "frequencies, second solution"
#: the cases by name
UNBALANCED = "the energy balance does not close"
CASES: dict[str, HardCase] = {
    "unbalanced rotor above its critical speed": HardCase("deflection, closed form", _deflection, 1e-3),
    "oblique rotor": HardCase("frequencies, upright rotor", _as_upright, 1e-7),
    "driven into a stop": HardCase("peak forces, closed form", _peak, 1e-6),
    "multistep across impacts": HardCase(
        "refusal",
        lambda: _ledger(
            lambda: scenes.bounce(integrator="adams-bashforth-moulton", step=1e-3, events="at step ends"),
        ),
        refused=UNBALANCED,
    ),
    "steps longer than an impact": HardCase(
        "refusal",
        lambda: _ledger(lambda: scenes.bounce(integrator="rk4", step=0.05, events="located")),
        refused=UNBALANCED,
    ),
    "1 nm next to 100 m": HardCase("vibration, closed form", _vibration, 1e-8),
    "bushing beyond half a turn": HardCase("spin, closed form", _spin, 1e-7),
    "graze, 1e-7 of the amplitude": HardCase("closings, closed form", partial(_graze_speed, 1e-8, 1e-10), 1e-2),
    "graze at rtol 1e-4": HardCase("closings, closed form", partial(_graze_speed, 1e-3, 1e-4), 1e-2),
    "diverging sampled controller": HardCase(
        "refusal", partial(_ledger, scenes.fast_sampler), refused="the motion diverges"
    ),
    "impacts of 0.1 um": HardCase("closings, as in metres", partial(_as_in_metres, 1e-6), 1e-6),
    "loop of a meshed body": HardCase("loops, per length", _opening, 1e-10),
    "pin in a slot without clearance": HardCase("sliding, closed form", _sliding, 1e-9),
    "output once a period": HardCase("exchanged energy, closed form", _exchange, 0.5),
    "the same with long steps": HardCase(
        "exchanged energy, closed form", partial(_exchange, integrator="exponential"), 0.5
    ),
    "at rest on a stop": HardCase("torque of the stop, closed form", _torque, 1e-6),
    "the same, declared": HardCase("torque of the stop, closed form", partial(_torque, initial_approach_speed=0), 1e-6),
    "held at rest by a drive": HardCase("torque of the drive, closed form", _moment_arm, 1e-9),
    "block without mass in a loop": HardCase("angle, with a block of 1 mg", _as_heavier, 1e-4),
    "spline of 20 000 points from rest to rest": HardCase("displacement, closed form", partial(_followed, 20000), 1e-9),
    "one of five slides is given a velocity": HardCase("speeds of the others", _alone, 1e-12),
    "ball that starts in its plane": HardCase(
        "refusal", lambda: _ledger(lambda: scenes.bounce(-0.05)), refused="starts with a penetration of"
    ),
    **{name: HardCase(FREQUENCIES, partial(_worst, *given[:-1]), given[-1]) for name, given in TURNING.items()},
    "rectangular shaft between its critical speeds": HardCase(
        "growth rates, second solution", partial(_worst, "4-clamped-free", 4, "growth_error"), 1e-3
    ),
    "unequal bearings at 4000 rpm": HardCase("frequencies, printed", _unequal_bearings, 1e-3),
    "twisting a shaft at 2527 rad/s": HardCase("elastic energy, modal series", _twist_energy, 5e-2),
    "spin-up with an impulse": HardCase("path, second solution", _struck, 5e-2),
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
        deviation = case.examine()
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
    takes="4 min",
    page="stability.md",
    cases=lambda: [Case(name) for name in CASES],
    measure=each(lambda case: [examined(case.name)]),
    show=show,
    times=False,
    code=("flexclear.dynamics", "flexclear.structure"),
)
