r"""Vibrations over the speed of a drive: a Campbell diagram whose branches follow the mode shapes.

A vibration of frequency nu in axes that turn at Omega has the frequency Omega + nu in fixed axes where it whirls with
them, Omega - nu where it whirls against them: a backward whirl where that is negative. With the displacements
(x, y) across the axis of turning, in complex numbers, the first has the part x + i y alone, the second x - i y.
Where the equations vary with the drive (`floquet`), nu is in fixed axes already and whirls are ellipses: unbalance
drives those against the turning, too.

Source: Genta (2005), Dynamics of Rotating Systems, sec. 2.4 and 4.5.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import xarray as xr
from scipy.optimize import linear_sum_assignment

from flexclear.artifacts.labelled import Labelled
from flexclear.artifacts.schema import CAMPBELL, conform
from flexclear.dynamics.linear.bench import Bench, drive_number, hold, observe, set_drives, state
from flexclear.dynamics.linear.dataset import equilibrium
from flexclear.dynamics.linear.equilibrium import Equilibrium, steady_near
from flexclear.dynamics.linear.shapes import motions
from flexclear.dynamics.linear.vibrations import Vibrations
from flexclear.dynamics.record.dataset import attributes, subject
from flexclear.scene.schema import Scene
from flexclear.system.errors import InputError, SolverError
from flexclear.system.progress import Progress

#: fraction of a vibration's displacements, or of its energy, that classifies the vibration
DECISIVE = 0.8
WHIRLS = ("backward", "", "forward")


@dataclass(frozen=True)
class Point:
    """Vibrations at one speed.

    omega: speed of the turning axes of each vibration [rad/s].  sense: +1, -1 for whirls with or against them, half
    where the displacements only lean that way; 0 for no whirl.  heavy: mass times shapes, shape (nv, n).
    parts: body with most of the energy of each.  frames: origins of all frames [m], shape (frame, 3).
    """

    small: Vibrations
    omega: np.ndarray
    sense: np.ndarray
    heavy: np.ndarray
    parts: list[str]
    frames: np.ndarray

    def whirls(self, k: int) -> np.ndarray:
        """Return possible frequencies of vibration k in fixed axes, the likelier first, backward negative [rad/s]; none
        without whirl."""
        nu, sign = abs(self.small.value[k].imag), np.sign(self.sense[k])
        omega = 0.0 if self.small.fixed else self.omega[k]
        return omega + nu * np.array([sign, -sign][: 1 if abs(self.sense[k]) == 1.0 else 2] if sign else [])


@dataclass
class Branch:
    """Vibrations of one kind. places: index of the speed, point, and index of the vibration; whirls: their frequencies
    in fixed axes, NaN where none."""

    places: list[tuple[int, Point, int]]
    whirls: list[float]

    @property
    def expected(self) -> float:
        """Whirl frequency at the next speed, by linear extrapolation."""
        last = self.whirls[-2:]
        return float(last[-1] if len(last) < 2 or np.isnan(last[0]) else 2.0 * last[1] - last[0])

    @property
    def lowest(self) -> float:
        """Whirl frequency at the lowest speed, or the frequency of the vibration there."""
        _, point, k = self.places[-1]
        return self.whirls[-1] if np.isfinite(self.whirls[-1]) else abs(point.small.value[k].imag)


def campbell(
    scene: Scene,
    bundles: Mapping[str, Labelled],
    progress: Progress,
    speeds: Sequence[float],
    drive: str | None = None,
    time: float | None = None,
    drives: Mapping[str, float] | None = None,
) -> xr.Dataset:
    """Return vibrations about steady motion over the speed of a drive [rad/s or m/s] (schema CAMPBELL).

    drive: its name; the only moving one when None.  time, drives: see `dynamics.analyses.equilibrium`.
    Speeds without steady motion, such as critical ones, have NaN.  Raises InputError; SolverError when all have.
    """
    bench, start = hold(scene, bundles, progress, time, drives, True)
    which = _drive(bench, drive)
    axis = _axis(bench, start, which)
    points: list[Point | None] = []
    failures: list[SolverError] = []
    q = start
    for k, speed in enumerate(speeds):
        progress(k / len(speeds), f"Computing the vibrations at {speed:.6g}")
        values = bench.drives.copy()
        values[which, 1] = bench.model.drive_signs[which] * speed
        here = replace(bench, drives=values)
        set_drives(here, values)
        try:
            rest, small = steady_near(here, q)
        except SolverError as error:
            failures.append(error)
            points.append(None)
            continue
        q = rest.at.q
        points.append(_point(here, rest, small, axis))
    if len(failures) == sum(1 for speed in speeds if speed != 0.0) > 0 or not any(points):
        raise failures[0]
    return _dataset(bench, which, np.array(speeds), points)


def _drive(bench: Bench, name: str | None) -> int:
    names, moving = list(bench.model.drives), np.flatnonzero(bench.drives[:, 1])
    if name is not None:
        return drive_number(bench.model, name)
    if len(names) == 1 or len(moving) == 1:
        return 0 if len(names) == 1 else int(moving[0])
    raise InputError(
        "speeds",
        f"{len(moving)} of the scene's {len(names)} drives move; choose the drive whose speed varies",
        f"name it by drive (--drive): {', '.join(names)}" if names else "drive a joint",
    )


def _axis(bench: Bench, q: np.ndarray, which: int) -> np.ndarray:
    """Return the unit vector about which the drive turns the mechanism, shape (3,); zero for a translation."""
    drives = np.stack([bench.drives[:, 0], np.zeros(len(bench.drives))], axis=1)
    drives[which, 1] = bench.model.drive_signs[which]
    set_drives(bench, drives)
    omega = observe(bench, state(bench, q)[None, :]).links["omega"][0]
    set_drives(bench, bench.drives)
    fastest = omega[np.argmax(np.linalg.norm(omega, axis=1))]
    size = float(np.linalg.norm(fastest))
    return np.asarray(fastest / size if size > 0.0 else fastest)


def _point(bench: Bench, rest: Equilibrium, small: Vibrations, axis: np.ndarray) -> Point:
    """Classify the vibrations at one speed."""
    seen = observe(bench, state(bench, rest.at.q)[None, :])
    turning = seen.links["omega"][0] @ axis
    model, heavy = bench.model, rest.at.mass @ small.shape
    energy = np.abs(np.real(small.shape.conj() * heavy))
    # coordinates of a link turn with its inboard link, coordinates of its deformation with the link itself
    own = np.full(len(heavy), turning[np.argmax(np.abs(turning))] if small.fixed else 0.0)
    for i, link in enumerate(() if small.fixed else model.links[1:], start=1):
        assert link.inboard is not None
        if not link.drives:
            own[list(model.numbering.coordinates[i])] = turning[link.inboard.link]
        if link.flexible:
            own[list(model.numbering.modal_coordinates[i])] = turning[i]
    omega = np.array([own[int(np.argmax(e))] for e in energy.T])
    same = np.array([e[np.isclose(own, w)].sum() / e.sum() for e, w in zip(energy.T, omega, strict=True)])
    translation, rotation, fractions = motions(bench, rest.at.q, small.shape)
    sense = _sense(np.concatenate([translation, model.length * rotation], axis=1), axis)
    sense[same < DECISIVE] = 0.0
    parts = list(fractions)
    heaviest = np.argmax(np.stack([fractions[name] for name in parts], axis=1), axis=1)
    frames = equilibrium(bench, rest, True).frame_position.values
    return Point(small, omega, sense, heavy, [parts[k] for k in heaviest], frames)


def _sense(moved: np.ndarray, axis: np.ndarray) -> np.ndarray:
    """Return the sense of whirl of each vibration; moved: complex displacements and rotations, shape (n, frame, 3)."""
    if not np.any(axis):
        return np.zeros(len(moved))
    across = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    x, z = across / np.linalg.norm(across), axis
    right, up = moved @ x, moved @ np.cross(z, x)
    forward, backward, along = (
        np.sum(np.abs(v) ** 2, axis=1) for v in (right + 1j * up, right - 1j * up, np.sqrt(2.0) * (moved @ z))
    )
    whole = np.maximum(forward + backward + along, np.finfo(float).tiny)
    sense = np.where(forward >= backward, 1.0, -1.0)
    sense[np.maximum(forward, backward) <= DECISIVE * whole] *= 0.5
    return np.where(along > (1.0 - DECISIVE) * whole, 0.0, sense)


def _follow_branches(points: Sequence[Point | None]) -> list[Branch]:
    """Return the branches of all vibrations, from the last speed down: there whirls are separated most."""
    branches: list[Branch] = []
    for s, point in reversed(list(enumerate(points))):
        if point is None:
            continue
        n = len(point.small.value)
        cost = np.array([[_misfit(branch, point, k)[0] for k in range(n)] for branch in branches])
        taken = set[int]()
        for row, chosen in zip(*linear_sum_assignment(cost.reshape(len(branches), n)), strict=True):
            branches[row].whirls.append(_misfit(branches[row], point, int(chosen))[1])
            branches[row].places.append((s, point, int(chosen)))
            taken.add(int(chosen))
        for k in range(n):
            if k in taken:
                continue
            whirls = point.whirls(k)
            known = len(whirls) == 1 or (len(whirls) > 0 and point.small.fixed)
            branches.append(Branch([(s, point, k)], [float(whirls[0]) if known else np.nan]))
    return sorted(branches, key=lambda b: (abs(b.lowest), b.whirls[-1]))


def _misfit(branch: Branch, point: Point, k: int) -> tuple[float, float]:
    """Return how badly vibration k continues a branch, by shape and frequency, and its whirl frequency."""
    _, before, other = branch.places[-1]
    w, heavy = before.small.shape[:, other], point.heavy[:, k]
    unlike = 1.0 - min(1.0, max(abs(np.vdot(w, heavy)), abs(np.dot(w, heavy))))
    whirls = point.whirls(k)
    if np.isnan(branch.whirls[-1]) or not len(whirls):
        nu, last = abs(point.small.value[k].imag), abs(before.small.value[other].imag)
        kinds = 0.0 if np.isnan(branch.whirls[-1]) and not len(whirls) else 0.5
        return unlike + kinds + abs(nu - last) / max(nu + last, 1e-300), np.nan
    expected = branch.expected
    off = np.abs(whirls - expected) / np.maximum(np.abs(whirls) + abs(expected), 1e-300)
    return unlike + float(off.min()), float(whirls[np.argmin(off)])


def _dataset(bench: Bench, which: int, speeds: np.ndarray, points: Sequence[Point | None]) -> xr.Dataset:
    branches = _follow_branches(points)
    shape = len(speeds), len(branches)
    frequency, whirl, decay, over = (np.full(shape, np.nan) for _ in range(4))
    dominant, kind, critical = [], [], np.full(len(branches), np.nan)
    for b, branch in enumerate(branches):
        names = []
        for (s, point, k), omega in zip(branch.places, branch.whirls, strict=True):
            value = point.small.value[k]
            frequency[s, b], decay[s, b] = abs(value.imag) / (2.0 * np.pi), 0.0 - value.real
            whirl[s, b] = omega / (2.0 * np.pi)
            over[s, b] = (abs(omega) if point.small.fixed else omega) - point.omega[k]
            names.append(point.parts[k])
        dominant.append(max(sorted(set(names)), key=names.count))
        ahead = np.nansum(np.sign(whirl[:, b]))
        kind.append(WHIRLS[1 + int(np.sign(ahead))])
        critical[b] = _critical_speed(speeds, over[:, b])
    frames = list(bench.model.mechanism.frames)
    nothing = np.full((len(frames), 3), np.nan)
    data = {
        "frequency": (("speed", "branch"), frequency),
        "whirl_frequency": (("speed", "branch"), whirl),
        "decay_rate": (("speed", "branch"), decay),
        "growth": (("speed",), np.array([np.nan if p is None else p.small.growth for p in points])),
        "whirl": (("branch",), np.array(kind, dtype=str)),
        "dominant": (("branch",), np.array(dominant, dtype=str)),
        "critical_speed": (("branch",), critical),
        "frame_position": (("speed", "frame", "axis"), np.array([nothing if p is None else p.frames for p in points])),
    }
    diagram = xr.Dataset(data, {"speed": speeds, "branch": np.arange(1, len(branches) + 1), "frame": frames})
    title = f"Campbell diagram of {subject(bench.scene)}"
    return conform(diagram, CAMPBELL, title=title, **attributes(bench.scene), drive=bench.model.drives[which])


def _critical_speed(speeds: np.ndarray, over: np.ndarray) -> float:
    """Return the lowest speed at which a whirl is synchronous with the turning axes, interpolated; NaN if none."""
    known = np.isfinite(over) & (speeds != 0.0)
    x, y = speeds[known], over[known]
    for k in np.flatnonzero(np.sign(y[:-1]) * np.sign(y[1:]) < 0.0):
        return float(x[k] - y[k] * (x[k + 1] - x[k]) / (y[k + 1] - y[k]))
    return float("nan")
