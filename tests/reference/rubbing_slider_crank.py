"""A slider-crank with friction in all of its joints, in the plane in maximal coordinates, with SciPy only.

Each of three bodies has x, y of its reference point and an angle; joints are constraints with multipliers. Friction is
found by repeating the linear solution with the reactions of the one before until they stand, damped by nothing: the
coefficients are small enough for that. Integrations end where friction bends, so that the motion is known to 1e-12.
"""

from dataclasses import dataclass
from functools import cache

import numpy as np

from tests.reference.contact_solutions import modified_coulomb
from tests.reference.kinks import from_kink_to_kink

G = 9.81
LAWS = {"static": 0.2, "dynamic": 0.15, "v_static": 5e-3, "v_dynamic": 1.5e-2}


@dataclass(frozen=True)
class Sizes:
    """Lengths [m]; bodies: mass [kg], inertia about the centre [kg m^2], distance of the centre [m]."""

    crank: float = 0.1
    rod: float = 0.3
    guide: float = 0.04

    @property
    def bodies(self) -> dict[str, tuple[float, float, float]]:
        """By name."""
        return {"crank": (0.5, 1e-3, 0.05), "rod": (0.8, 6e-3, 0.15), "slider": (1.0, 1e-3, 0.01)}

    @property
    def radii(self) -> dict[str, float]:
        """Of the pins [m]."""
        return {"O": 0.012, "A": 0.010, "B": 0.008}


SIZES = Sizes()


@dataclass(frozen=True)
class Known:
    """Crank angle, speed of the slider, loads of the bearings O, A, B, P (4, time), energy lost at the end."""

    angle: np.ndarray
    speed: np.ndarray
    loads: np.ndarray
    lost: float


def coefficient(speed: float) -> float:
    """Of friction, signed like the speed."""
    return float(np.copysign(modified_coulomb(abs(speed), **LAWS), speed))


@dataclass(frozen=True)
class Crank:
    """Start: angle of the crank [rad] and its rate [rad/s]."""

    phi: float = 0.7
    omega: float = 20.0

    def places(self) -> dict[str, tuple[float, float, float]]:
        """x, y [m] and angle [rad] of the bodies' reference points at the start."""
        x, y = SIZES.crank * np.cos(self.phi), SIZES.crank * np.sin(self.phi)
        angle = np.arcsin(-y / SIZES.rod)
        found = {"crank": (0.0, 0.0, self.phi), "rod": (x, y, angle)}
        found["slider"] = (x + SIZES.rod * np.cos(angle), 0.0, 0.0)
        return {name: (float(a), float(b), float(c)) for name, (a, b, c) in found.items()}

    def run(self, times: np.ndarray) -> Known:
        """The motion at these times."""
        y = np.array(list(self.places().values())).ravel()
        J, _ = _constraints(y, np.zeros(9))
        # the speeds that the crank's rate leaves: eight constraints and that rate
        rate = np.zeros(9)
        rate[2] = 1.0
        v = np.linalg.solve(np.vstack([J, rate]), np.array([0.0] * 8 + [self.omega]))

        def rates(_: float, state: np.ndarray) -> np.ndarray:
            a, _, _, power = _solve(state[:9], state[9:18])
            return np.concatenate([state[9:18], a, [power]])

        looser = {"rtol": 3e-13, "atol": 1e-15, "max_step": 1e-3}
        state = from_kink_to_kink(rates, _bends, np.array([*y, *v, 0.0]), times, **looser)
        loads = np.array([_solve(s[:9], s[9:18])[2] for s in state.T]).T
        return Known(state[2], state[15], loads, float(state[18, -1]))


def _bends(state: np.ndarray) -> np.ndarray:
    """Zero where friction has a kink: sliding speeds where its law bends, and forces at the ends of the guide."""
    v = state[9:18]
    slips = [SIZES.radii["O"] * v[2], SIZES.radii["A"] * (v[5] - v[2]), SIZES.radii["B"] * (v[8] - v[5]), v[6]]
    force = _solve(state[:9], v)[1]
    ends = [0.5 * force[6] + side * force[7] / SIZES.guide for side in (-1.0, 1.0)]
    levels = [s * LAWS[name] for name in ("v_static", "v_dynamic") for s in (-1.0, 1.0)]
    return np.array([*(slip - level for slip in slips for level in levels), *ends])


@cache
def released() -> Known:
    """The motion of `checks/rubbing_slider_crank` at its 21 recorded times."""
    return Crank().run(np.linspace(0.0, 0.12, 21))


def _mass(q: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Mass matrix for reference points next to the centres, and forces: weight and centrifugal terms."""
    M, f = np.zeros((9, 9)), np.zeros(9)
    for k, (mass, inertia, centre) in enumerate(SIZES.bodies.values()):
        c, s = centre * np.cos(q[3 * k + 2]), centre * np.sin(q[3 * k + 2])
        M[3 * k : 3 * k + 3, 3 * k : 3 * k + 3] = [
            [mass, 0.0, -mass * s],
            [0.0, mass, mass * c],
            [-mass * s, mass * c, inertia + mass * centre**2],
        ]
        square = v[3 * k + 2] ** 2
        f[3 * k : 3 * k + 3] = [mass * square * c, mass * square * s - mass * G, -mass * G * c]
    return M, f


def _constraints(q: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Jacobian (8, 9) and gamma with J a = gamma; multipliers are forces on crank, rod and slider (at O, A, B), then on
    the slider across the guide and its moment.
    """
    J, gamma = np.zeros((8, 9)), np.zeros(8)
    J[0, 0] = J[1, 1] = 1.0
    for row, (first, second, length) in zip((2, 4), ((0, 1, SIZES.crank), (1, 2, SIZES.rod)), strict=True):
        c, s = length * np.cos(q[3 * first + 2]), length * np.sin(q[3 * first + 2])
        J[row, 3 * second] = J[row + 1, 3 * second + 1] = 1.0
        J[row, 3 * first], J[row, 3 * first + 2] = -1.0, s
        J[row + 1, 3 * first + 1], J[row + 1, 3 * first + 2] = -1.0, -c
        square = v[3 * first + 2] ** 2
        gamma[row], gamma[row + 1] = -c * square, -s * square
    J[6, 7] = J[7, 8] = 1.0
    return J, gamma


def _solve(q: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
    """Accelerations, multipliers, loads of the bearings and power lost."""
    M, f = _mass(q, v)
    J, gamma = _constraints(q, v)
    K = np.block([[M, -J.T], [J, np.zeros((8, 8))]])
    turning = {"O": v[2], "A": v[5] - v[2], "B": v[8] - v[5]}
    radii = SIZES.radii
    mu = {name: coefficient(radii[name] * rate) * radii[name] for name, rate in turning.items()}
    push, loads = coefficient(v[6]), np.zeros(4)
    for _ in range(200):
        Q = f.copy()
        for k, name in enumerate("OAB"):
            torque = mu[name] * loads[k]
            Q[3 * k + 2] -= torque
            if k:
                Q[3 * k - 1] += torque
        Q[6] -= push * loads[3]
        solution = np.linalg.solve(K, np.concatenate([Q, gamma]))
        force = solution[9:]
        ends = abs(0.5 * force[6] - force[7] / SIZES.guide) + abs(0.5 * force[6] + force[7] / SIZES.guide)
        new = np.array([*(np.hypot(*force[2 * k : 2 * k + 2]) for k in range(3)), ends])
        if np.max(np.abs(new - loads)) <= 1e-13 * np.max(new):
            break
        loads = new
    else:
        raise AssertionError("friction and reactions do not come to rest")
    rates = [*(mu[name] * turning[name] for name in "OAB"), push * v[6]]
    return solution[:9], force, loads, float(np.dot(rates, loads))
