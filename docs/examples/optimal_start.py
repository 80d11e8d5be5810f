"""The start from which a pushed mass on a spring repeats itself at once, without a transient.

Unknown are its place and velocity at the start; wanted are the same ones after one period of the push. Without an
optimiser: the particular solution of m x'' + c x' + k x = F sin(w t), at t = 0 (`steady`).
"""

from pathlib import Path

import numpy as np
from scipy.optimize import root

import flexclear as fc

SCENE = Path(__file__).parents[2] / "scenes/checks/oscillator.toml"
PERIOD, FORCE = 0.5, 3.0  # of the push [s, N]
PUSH = {
    "type": "joint-force",
    "joint": "slide",
    "force": {"type": "harmonic", "amplitude": [FORCE], "frequency": [2.0 * np.pi / PERIOD]},
}
#: place of the scene -> of the unknown start
PLACES = ("body.mass.pose.position.2", "body.mass.velocity.2")


def ends(starts: np.ndarray) -> np.ndarray:
    """Place [m] and velocity [m/s] after a period, of some starts side by side; shape (starts, 2) as of `starts`."""
    scene = fc.edited(fc.load_scene(SCENE), {"load.push": PUSH, "body.mass.velocity": [0, 0, 0], "time.end": PERIOD})
    vary = dict(zip(PLACES, starts.T, strict=True))
    keep = ["mass.position.final", "mass.velocity.final"]
    found = fc.sweep(scene, vary, keep, combine="list", workers=1)
    return np.stack([found[name].sel(axis="z").values for name in keep], axis=1)


def miss(start: np.ndarray, step: float = 1e-4) -> tuple[np.ndarray, np.ndarray]:
    """By how much the motion misses its start after a period, and the derivatives, from one sweep of three points."""
    there = ends(start + np.vstack([np.zeros(2), step * np.eye(2)]))
    return there[0] - start, (there[1:] - there[0]).T / step - np.eye(2)


def best() -> np.ndarray:
    """Place [m] and velocity [m/s] of the start, looked for from rest."""
    found = root(miss, np.array([0.25, 0.0]), jac=True, tol=1e-10)
    if not found.success:
        raise RuntimeError(found.message)
    return np.asarray(found.x)


def steady(m: float = 2.0, c: float = 4.0, k: float = 200.0, free: float = 0.25) -> np.ndarray:
    """The same in closed form."""
    w = 2.0 * np.pi / PERIOD
    size, lag = FORCE / np.hypot(k - m * w**2, c * w), np.arctan2(c * w, k - m * w**2)
    return np.array([free - size * np.sin(lag), size * w * np.cos(lag)])


if __name__ == "__main__":
    place, velocity = best()
    print(f"{1e3 * place:.4f} mm, {1e3 * velocity:.4f} mm/s")
