r"""From rest to a constant speed, with continuous acceleration and jerk: a cycloidal ramp of the speed.

.. math:: \dot x = \frac{\omega}{T}\Bigl(t - \frac{T}{2\pi}\sin\frac{2\pi t}{T}\Bigr), \quad 0 \le t \le T

The law is followed by quintics that share its value, rate and acceleration at their ends; they leave it by less than
2e-14 of the whole way.

Source: Kane, Ryan & Banerjee (1987), J. Guidance, Control, and Dynamics 10, 139-151.
"""

from __future__ import annotations

import numpy as np

from pipeline.core.scene.parts import SpinUp

#: quintics over the ramp: their error is (1/PIECES)^6 (2 pi)^4 / 46080 of speed times duration
PIECES = 128


def pieces(law: SpinUp) -> np.ndarray:
    """Rest, the ramp, constant speed; shape (PIECES + 2, 7): start time, coefficients of rising order."""
    time = law.start + law.duration * np.arange(PIECES + 1) / PIECES
    x, v, a = _ramp(law, time - law.start)
    h = law.duration / PIECES
    # quintic Hermite: what is missing of the second-order Taylor polynomial at the far end
    d0 = (x[1:] - x[:-1] - h * v[:-1] - 0.5 * h**2 * a[:-1]) / h**3
    d1 = (v[1:] - v[:-1] - h * a[:-1]) / h**2
    d2 = (a[1:] - a[:-1]) / h
    cubic, quartic, quintic = (
        10 * d0 - 4 * d1 + 0.5 * d2,
        (-15 * d0 + 7 * d1 - d2) / h,
        (6 * d0 - 3 * d1 + 0.5 * d2) / h**2,
    )
    ramp = np.stack([time[:-1], x[:-1], v[:-1], 0.5 * a[:-1], cubic, quartic, quintic], axis=1)
    rest = [law.start - 1.0, *[0.0] * 6]
    after = [time[-1], x[-1], law.speed, *[0.0] * 4]
    return np.vstack([rest, ramp, after])


def _ramp(law: SpinUp, t: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Coordinate, speed and acceleration at times since the start of the ramp."""
    T, turn = law.duration, 2.0 * np.pi / law.duration
    # 1 - cos as a product: no digits are lost near the start
    x = law.speed / T * (0.5 * t**2 - 2.0 * np.sin(0.5 * turn * t) ** 2 / turn**2)
    return x, law.speed / T * (t - np.sin(turn * t) / turn), law.speed / T * (1.0 - np.cos(turn * t))
