r"""Sum of smooth steps: each a cubic from 0 to its change, constant before and after.

.. math:: h\,(3 s^2 - 2 s^3), \quad s = (t - t_0)/(t_1 - t_0)

Value and rate are continuous; the acceleration jumps at both ends of a step.
Source: Wang & Wang (2019), eqs. (29) and (35).
"""

from __future__ import annotations

from flexclear.dynamics.drives.pieces import Pieces, polynomials
from flexclear.scene.laws import Step
from flexclear.scene.units import quantity


def pieces(law: Step, dimension: str) -> Pieces:
    """Return the pieces between all starts and ends; Wang & Wang (2019), eq. (35)."""
    breaks = sorted({*law.start, *law.end})
    starts = [breaks[0] - 1.0, *breaks]
    changes = [quantity(change, dimension) for change in law.change]
    rows = [_taylor(law, changes, t, t + 0.5 * _width(starts, k)) for k, t in enumerate(starts)]
    return Pieces(polynomials(starts, rows))


def _width(starts: list[float], k: int) -> float:
    return starts[k + 1] - starts[k] if k + 1 < len(starts) else 1.0


def _taylor(law: Step, changes: list[float], t: float, inside: float) -> list[float]:
    """Return the coefficients about t of the polynomial that holds at the time `inside`."""
    c = [0.0] * 4
    for start, end, change in zip(law.start, law.end, changes, strict=True):
        if inside >= end:
            c[0] += change
        elif inside > start:
            T = end - start
            s = (t - start) / T
            c[0] += change * s * s * (3.0 - 2.0 * s)
            c[1] += change * 6.0 * s * (1.0 - s) / T
            c[2] += change * 3.0 * (1.0 - 2.0 * s) / T**2
            c[3] += change * -2.0 / T**3
    return c
