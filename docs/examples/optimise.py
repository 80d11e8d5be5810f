"""The stiffness with which the mass of checks/oscillator turns round exactly at the end of the run.

Without an optimiser: sqrt(k/m - (c/2m)^2) T = pi, so k = 80.957 N/m for m = 2 kg, c = 4 N s/m, T = 0.5 s.
"""

from pathlib import Path

from scipy.optimize import brentq

import flexclear as fc

SCENE = Path(__file__).parents[2] / "scenes/checks/oscillator.toml"


def final_velocity(stiffness: float) -> float:
    """Velocity of the mass at the end [m/s]; a value asked for again comes from the cache."""
    found = fc.sweep(
        SCENE, {"load.spring.stiffness": [stiffness]}, ["mass.velocity.final"], set={"time.end": "0.5 s"}, workers=1
    )
    return float(found["mass.velocity.final"].sel(axis="z").item())


def best() -> float:
    """The stiffness [N/m]."""
    return float(brentq(final_velocity, 60.0, 100.0, xtol=1e-6))


if __name__ == "__main__":
    print(f"{best():.4f} N/m")
