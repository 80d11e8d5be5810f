r"""Small motions about a steady motion whose equations vary with the angle of the drives, as those of a shaft do that
turns in bearings of unequal stiffness.

The equations :math:`\dot y = A(t)y` have the period of a turn, so their solutions are :math:`e^{\lambda t}p(t)` with
:math:`p(t) = \sum_k p_k e^{ik\Omega t}` (Floquet). The harmonics are an eigenvector of Hill's matrix with blocks
:math:`A_{k-m} - ik\Omega\delta_{km}`, cut off where they are negligible. A solution has a copy for each shift of its
harmonics, with another :math:`\lambda`. All have the same :math:`\lambda + ik\Omega` where k is the harmonic with the
largest displacements of frames in world axes: its imaginary part is the frequency in fixed axes. One copy of each is
taken, by its k. Slow drives need many harmonics.

Source: Genta (2005), Dynamics of Rotating Systems, ch. 6; Xu & Gasch (1995), Archive of Applied Mechanics 65, 178-193.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import gcd

import numpy as np

from flexclear.dynamics.linear.bench import Bench, advance_drives
from flexclear.dynamics.linear.shapes import motions
from flexclear.dynamics.linear.tangent import Tangent, tangent
from flexclear.dynamics.linear.vibrations import (
    ASYMMETRY,
    EPSILON,
    REAL,
    ZERO_EIGENVALUE,
    Equations,
    Vibrations,
    eigenpairs,
    equations,
    frequency_order,
    principal_motions,
    time_invariant_motions,
    vibrations,
)
from flexclear.dynamics.model.driving import prescribed_coordinates
from flexclear.system.errors import SolverError

#: motion of the drives that tests whether the forces stay constant, in radians or fractions of the mechanism's size
PROBE = 0.1
#: first and largest number of angles in a turn
FEWEST_ANGLES, MOST_ANGLES = 8, 128
#: first number of harmonics in each direction, and largest size of Hill's matrix with more
FEWEST_HARMONICS, LARGEST = 2, 2000
#: relative difference of squared amplitudes below which two harmonics are equally large
EQUAL = 1e-6
#: fraction of the squared amplitudes of coordinates that decides where no frame moves
UNSEEN = 1e-24


@dataclass(frozen=True)
class Instant:
    """The equations mass z'' + D z' + K z = 0 at an angle of the drives; mass: exactly 1 where constant."""

    of: Equations
    mass: np.ndarray

    @property
    def acting(self) -> np.ndarray:
        """True for motions with forces, shape (n,)."""
        entries = (self.of.K != 0.0) | (self.of.D != 0.0) | (self.mass != np.eye(len(self.mass)))
        return np.asarray(entries.any(axis=0) | entries.any(axis=1))

    def first_order(self, scale: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return A and its errors as `Equations.first_order` does."""
        A, wrong = self.of.first_order(scale)
        A[len(scale) :] = np.linalg.solve(self.mass, A[len(scale) :])
        return A, wrong


def small_motions(bench: Bench, at: Tangent) -> Vibrations:
    """Compute all small motions about a steady motion; raise SolverError for equations that no turn repeats."""
    if not at.Z.shape[1] or bench.fastest == 0.0:
        return vibrations(bench, at)
    here = equations(bench, at, principal_motions(bench, at))
    first = Instant(here, np.eye(len(here.K)))
    if _differ(first, _equations_after(bench, at, here, PROBE / bench.fastest), here.scale):
        return _floquet(bench, at, first)
    return time_invariant_motions(here)


def _equations_after(bench: Bench, at: Tangent, here: Equations, duration: float) -> Instant:
    """Return the equations along the motions of `here` after the drives have moved for a duration [s]."""
    along = here.motions
    with advance_drives(bench, duration) as later:
        there = tangent(later, at.q)
        heavy = there.mass @ along
        left = along - there.Z @ (there.Z.T @ heavy)
        # sums of these masses are rounded; those of bodies with many modes are of very different sizes
        limit = np.maximum(ASYMMETRY, EPSILON * (np.abs(along).T @ np.abs(there.mass) @ np.abs(along)))
        # largest fraction of a motion's energy outside the motions that loops leave free
        outside = np.abs(np.sum(left * heavy, axis=0))
        if there.Z.shape != at.Z.shape or np.any(outside > limit.diagonal()):
            raise SolverError(
                f"at t = {bench.time:.6g} s: the motions that the closed loops leave free vary with the angle of the "
                "drives; vibrations about such a motion are not available: close the loop by a bushing"
            )
        mass, one = along.T @ heavy, np.eye(along.shape[1])
        return Instant(equations(later, there, along), np.where(np.abs(mass - one) > limit, mass, one))


def _frames_after(bench: Bench, at: Tangent, along: np.ndarray, duration: float) -> np.ndarray:
    """Return displacements of frames, and rotations times the mechanism's size, in world axes per motion, (many, n)."""
    with advance_drives(bench, duration) as later:
        translation, rotation, _ = motions(later, at.q, along)
    moves = np.concatenate([translation, bench.model.length * rotation], axis=1).real
    return moves.reshape(along.shape[1], -1).T


def _differ(one: Instant, other: Instant, scale: np.ndarray) -> bool:
    (A, wrong), (B, _) = one.first_order(scale), other.first_order(scale)
    return not np.all(np.abs(A - B) <= _negligible(A, wrong))


def _negligible(A: np.ndarray, wrong: np.ndarray) -> np.ndarray:
    """Return the size below which changes of A, shape (..., 2n, 2n), are rounding."""
    return np.asarray(ASYMMETRY * np.abs(A).max(axis=-1, keepdims=True) + ZERO_EIGENVALUE * wrong)


def _period(bench: Bench, at: Tangent, first: Instant) -> float:
    """Return the time in which the slowest drive turns once [s]."""
    turns = [p.dimension == "angle" for p in prescribed_coordinates(bench.model.scene)]
    speeds = np.abs(bench.drives[turns, 1])
    period = float(2.0 * np.pi / np.min(speeds[speeds > 0.0], initial=np.inf))
    if not period or _differ(first, _equations_after(bench, at, first.of, period), first.of.scale):
        raise SolverError(
            f"at t = {bench.time:.6g} s: the equations of small motions change with the drives and are not the same "
            "after a turn; hold the drives instead, or drive what turns directly"
        )
    return period


def _equations_over_turn(
    bench: Bench, at: Tangent, here: Equations, period: float
) -> tuple[list[Instant], dict[int, np.ndarray]]:
    """Return the equations at enough angles of a turn, and the harmonics of A that are not negligible."""
    instants, count = list[Instant](), FEWEST_ANGLES
    while count <= MOST_ANGLES:
        known, step = instants, period / count
        instants = [
            known[j // 2] if known and j % 2 == 0 else _equations_after(bench, at, here, step * j) for j in range(count)
        ]
        A, wrong = (np.array(of) for of in zip(*(each.first_order(here.scale) for each in instants), strict=True))
        limit = _negligible(A, wrong).max(axis=0)
        harmonics = {k: part for k, part in _harmonics(A).items() if k == 0 or not np.all(np.abs(part) <= limit)}
        if max(map(abs, harmonics)) <= count // 4:
            return instants, harmonics
        count *= 2
    raise SolverError(
        f"at t = {bench.time:.6g} s: {MOST_ANGLES} angles do not resolve how the equations of small motions change in "
        "a turn of the drives; a bushing in which a shaft turns may resist its displacement, not its rotation"
    )


def _harmonics(samples: np.ndarray) -> dict[int, np.ndarray]:
    """Return the Fourier coefficients of samples in a period, by their order."""
    orders = np.fft.fftfreq(len(samples), 1.0 / len(samples))
    return {round(k): part for k, part in zip(orders, np.fft.fft(samples, axis=0) / len(samples), strict=True)}


def _floquet(bench: Bench, at: Tangent, first: Instant) -> Vibrations:
    """Return the small motions with frequencies in fixed axes."""
    here, n = first.of, len(first.mass)
    period = _period(bench, at, first)
    instants, harmonics = _equations_over_turn(bench, at, here, period)
    moving, base = np.any([each.acting for each in instants], axis=0), gcd(*harmonics) or 1
    kept, scale = np.ix_(np.tile(moving, 2), np.tile(moving, 2)), here.scale[moving]
    blocks = {k // base: part[kept] for k, part in harmonics.items()}
    wrong = first.first_order(here.scale)[1][kept]
    angles = max(FEWEST_ANGLES, 4 * round(bench.fastest * period / (2.0 * np.pi)))
    frames = [_frames_after(bench, at, here.motions[:, moving], j * period / angles) for j in range(angles)]
    seen = _harmonics(np.array(frames) / scale)
    reach = FEWEST_HARMONICS
    while True:
        value, shape, error, edge = _exponents(blocks, wrong, seen, reach, base, 2.0 * np.pi / period)
        # fraction of the squared amplitudes in the outermost harmonics that is negligible
        if edge <= 1e-12 and len(value) == len(wrong):
            break
        reach *= 2
        if (2 * reach + 1) * len(wrong) > LARGEST:
            raise SolverError(
                f"at t = {bench.time:.6g} s: {reach // 2} harmonics do not resolve small motions whose equations vary "
                f"with the drives: a fraction of {edge:.2g} is in the last; choose fewer modes or a higher speed"
            )
    real, lasting = (np.abs(part) <= np.maximum(REAL * np.abs(value), error) for part in (value.imag, value.real))
    value = np.where(real, value.real, np.where(lasting, 1j * value.imag, value))
    once = (value.imag > 0.0) | real
    still = int(n - moving.sum())
    value, error = (np.concatenate([np.zeros(still), of[once]]) for of in (value, error))
    whole = np.zeros((n, len(value)), dtype=complex)
    whole[~moving, :still] = np.eye(still)
    whole[moving, still:] = shape[:, once] / scale[:, None]
    order = frequency_order(value)
    whole = whole[:, order] / np.linalg.norm(whole[:, order], axis=0)
    return Vibrations(value[order], here.motions @ whole, still, error[order], fixed=True)


def _exponents(
    blocks: dict[int, np.ndarray], wrong: np.ndarray, seen: dict[int, np.ndarray], reach: int, base: int, speed: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
    """Return lambda of each solution in fixed axes, its scaled displacements at the start, and errors of lambda.

    blocks: harmonics of A, in multiples of `base` turns.  wrong: errors of A.  seen: harmonics of the displacements of
    frames per scaled motion.  reach: harmonics of Hill's matrix in each direction.  speed: of turning [rad/s].
    The last result is the largest fraction of a solution in its outermost harmonics.
    """
    size, orders = len(wrong), np.arange(-reach, reach + 1)
    hill = sum(np.kron(np.eye(len(orders), k=-k), block) for k, block in blocks.items())
    hill = hill - np.diag(np.repeat(1j * speed * base * orders, size))
    value, vectors, error = eigenpairs(hill, np.kron(np.eye(len(orders)), wrong))
    harmonics = vectors.reshape(len(orders), size, -1)
    shapes = harmonics[:, : size // 2]
    most = base * reach + max(seen) + 1
    moved = np.zeros((2 * most + 1, len(seen[0]), len(value)), dtype=complex)
    own = np.zeros((2 * most + 1, len(value)))
    for k, part in zip(base * orders, shapes, strict=True):
        own[most + k] = np.sum(np.abs(part) ** 2, axis=0)
        for p, displaced in seen.items():
            moved[most + k + p] += displaced @ part
    amplitude = np.sum(np.abs(moved) ** 2, axis=1) + UNSEEN * own
    # of equally large ones the highest, so that shifted copies of a solution agree
    large = amplitude >= (1.0 - EQUAL) * amplitude.max(axis=0)
    dominant = most - np.argmax(large[::-1], axis=0)
    chosen = (dominant >= 0) & (dominant < base)
    squares = np.sum(np.abs(harmonics) ** 2, axis=1)
    edge = float(np.max(((squares[0] + squares[-1]) / squares.sum(axis=0))[chosen], initial=0.0))
    return (value + 1j * speed * dominant)[chosen], shapes.sum(axis=0)[:, chosen], error[chosen], edge
