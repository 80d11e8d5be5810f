"""Campbell diagrams: how the vibrations of an overhung rotor and of a turning blade change with their speed.

    python docs/examples/campbell.py [FIGURE.png]

Both are scenes of flexclear whose drive turns at a steady speed, one of them with geometric stiffening. The vibrations
are computed in the axes that turn with the scene; those of the rotor are drawn in fixed axes, in which it whirls.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import flexclear as fc

#: speeds [rad/s] of the rotor; of the blade in units of sqrt(E I / (rho A)) / L^2
ROTOR_SPEEDS, BLADE_SPEEDS = np.linspace(0.0, 300.0, 13), np.linspace(0.0, 12.0, 9)
#: that unit for meshes/checks/slender_beam.toml [rad/s]
UNIT = np.sqrt(200e9 / 7850.0) * 1e-3
#: stiffness of the light shaft's end (deflection, slope); mass and inertias of its disc
STIFFNESS = 200e9 * np.pi * 0.01**4 / 4.0 / 0.5**3 * np.array([[12.0, -3.0], [-3.0, 1.0]])
MASS, ACROSS, ALONG = 10.0, 0.1, 0.2


def vibrations(scene: str, speed: float) -> np.ndarray:
    """Angular frequencies about steady turning [rad/s], in the axes that turn."""
    changed = fc.load_scene(scene, override={"drive.axle.law.coefficients": [0.0, float(speed)]})
    return 2.0 * np.pi * fc.frequencies(changed, moving=True).frequency.values


def whirls(speed: float) -> np.ndarray:
    """The rotor's four whirls in fixed axes, backward ones negative, by closed form; ascending [rad/s].

    Genta (2005), Dynamics of Rotating Systems, sec. 2.6: the disc's gyroscopic moment beside the shaft's stiffness.
    """
    M, G = np.diag([MASS, ACROSS]), np.diag([0.0, ALONG * speed])
    below = np.hstack([-np.linalg.solve(M, STIFFNESS), 1j * np.linalg.solve(M, G)])
    return np.sort(np.linalg.eigvals(np.vstack([np.eye(2, 4, 2), below])).imag)


def found_whirls(speed: float) -> np.ndarray:
    """The four whirls among the vibrations that flexclear finds, in fixed axes; ascending [rad/s].

    A vibration at w in turning axes is one at Omega + w or at Omega - w in fixed ones; which of both it is, its closed
    form tells by being near.
    """
    candidates = (speed + np.outer([1.0, -1.0], vibrations("scenes/checks/overhung_rotor.toml", speed))).ravel()
    return np.array([candidates[np.argmin(np.abs(candidates - known))] for known in whirls(speed)])


def figure(rotor_speeds: Sequence[float], blade_speeds: Sequence[float]) -> plt.Figure:
    """Both diagrams side by side."""
    drawn, (left, right) = plt.subplots(1, 2, figsize=(10.0, 4.2), layout="constrained")
    found = np.array([found_whirls(speed) for speed in rotor_speeds])
    fine = np.linspace(rotor_speeds[0], rotor_speeds[-1], 200)
    left.plot(fine, np.abs([whirls(speed) for speed in fine]), color="#9a9a9a", lw=1.0)
    left.plot(rotor_speeds, np.abs(found), "o", ms=4, color="#1f6f8b")
    left.plot(fine, fine, "--", lw=0.8, color="#c05a2b")
    left.set_title("Overhung rotor: the disc parts its whirls")
    left.set_xlabel("speed (rad/s)")
    left.set_ylabel("whirl in fixed axes (rad/s); line: closed form")
    scene = "scenes/checks/rotating_beam.toml"
    blade = np.array([vibrations(scene, speed * UNIT)[:5] for speed in blade_speeds]) / UNIT
    right.plot(blade_speeds, blade, "o-", ms=4, color="#1f6f8b", lw=1.0)
    right.plot(blade_speeds, blade_speeds, "--", lw=0.8, color="#c05a2b")
    right.set_title("Turning blade: the centrifugal force stiffens it")
    right.set_xlabel("speed / (sqrt(E I / (rho A)) / L²)")
    right.set_ylabel("frequency in the same unit")
    right.set_ylim(bottom=0.0)
    return drawn


if __name__ == "__main__":
    target = Path(sys.argv[1] if len(sys.argv) > 1 else "campbell.png")
    figure(ROTOR_SPEEDS, BLADE_SPEEDS).savefig(target, dpi=120)
    print(f"written: {target}")
