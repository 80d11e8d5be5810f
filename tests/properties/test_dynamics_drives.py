"""Every drive law is what its formula says, and smooth where it must be."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.core.registry import lookup
from pipeline.core.scene.parts import Constant, Step
from pipeline.dynamics import drives
from tests.analytic.mechanism_runs import run

#: eq. (35): 60 mm out and back
STROKE = Step(type="step", start=(0.0, 0.09), end=(0.09, 0.18), change=(0.06, -0.06))
#: drive law -> instances; overlapping steps, gaps and a step of no change among them
LAWS: dict[str, tuple[Any, ...]] = {
    "constant": (Constant(type="constant", value=0.012), Constant(type="constant")),
    "step": (
        STROKE,
        Step(type="step", start=(0.2, 0.0, 0.25), end=(0.3, 0.5, 0.26), change=(0.1, -0.2, 0.05)),
        Step(type="step", start=(0.1, 0.7), end=(0.4, 0.8), change=(0.0, 1.0)),
    ),
}


def pieces(law: Any) -> np.ndarray:
    return lookup(drives.__name__, law.type, where="test")(law)


def value(law: Any, t: float, order: int = 0, side: str = "right") -> float:
    """A derivative of the law at t, from the piece that holds right (or left) of it."""
    table = pieces(law)
    k = max(int(np.searchsorted(table[:, 0], t, side=side)) - 1, 0)  # type: ignore[call-overload]
    return float(np.polynomial.Polynomial(table[k, 1:]).deriv(order)(t - table[k, 0]))


def adams_step(t: float, t0: float, h0: float, t1: float, h1: float) -> float:
    """Wang & Wang (2019), eq. (29)."""
    s = min(max((t - t0) / (t1 - t0), 0.0), 1.0)
    return h0 + (h1 - h0) * s * s * (3.0 - 2.0 * s)


def scale(law: Any, order: int) -> float:
    """Size of what is summed in a derivative of the law."""
    if law.type == "constant":
        return 1.0
    parts = zip(law.start, law.end, law.change, strict=True)
    return 1e-3 + sum(6.0 * abs(h) / (b - a) ** order for a, b, h in parts)


every_law = pytest.mark.parametrize("law", [law for laws in LAWS.values() for law in laws], ids=lambda law: law.type)
spans = st.tuples(st.floats(0.0, 1.0), st.floats(0.01, 1.0), st.floats(-0.1, 0.1))


def test_every_drive_law_is_tried_here() -> None:
    assert set(LAWS) == set(drives.NAMES)


@every_law
def test_value_and_rate_do_not_jump_between_pieces(law: Any) -> None:
    for t in pieces(law)[:, 0]:
        for order in (0, 1):
            left, right = (value(law, t, order, side) for side in ("left", "right"))
            # rounding of (t - start) / (end - start)
            assert left == pytest.approx(right, abs=1e-13 * scale(law, order))


@every_law
def test_pieces_start_in_order(law: Any) -> None:
    table = pieces(law)
    assert table.shape[1] == 7
    assert np.all(np.diff(table[:, 0]) > 0.0)


def test_a_constant_drive_holds_its_value() -> None:
    for law in LAWS["constant"]:
        assert [value(law, t) for t in (-1.0, 0.0, 3.0)] == [law.value] * 3
        assert [value(law, t, order) for t in (-1.0, 3.0) for order in (1, 2)] == [0.0] * 4


@given(steps=st.lists(spans, min_size=1, max_size=4), t=st.floats(-0.5, 2.5))
def test_a_step_drive_is_the_sum_of_eq_29(steps: list[tuple[float, float, float]], t: float) -> None:
    start, end, change = ([f(s) for s in steps] for f in (lambda s: s[0], lambda s: s[0] + s[1], lambda s: s[2]))
    law = Step(type="step", start=tuple(start), end=tuple(end), change=tuple(change))
    known = sum(adams_step(t, a, 0.0, b, h) for a, b, h in zip(start, end, change, strict=True))
    # (t - start) / (end - start) of steps of 0.01 s at 1 s: 100 roundings' worth, times slopes of 1.5
    assert value(law, t) == pytest.approx(known, abs=1e-13)


def test_the_papers_stroke_is_flat_at_its_ends_and_60_mm_high() -> None:
    # values of order 0.06 m, slopes of order 1 m/s, in rounding
    assert [value(STROKE, t) for t in (-0.1, 0.0, 0.045, 0.09, 0.135, 0.18, 1.0)] == pytest.approx(
        [0.0, 0.0, 0.03, 0.06, 0.03, 0.0, 0.0], abs=1e-16
    )
    assert [value(STROKE, t, 1) for t in (-0.1, 0.0, 0.045, 0.09, 0.18)] == pytest.approx(
        [0.0, 0.0, 1.5 * 0.06 / 0.09, 0.0, 0.0], abs=1e-14
    )


def test_the_papers_stroke_jumps_in_acceleration_at_its_ends_and_in_jerk_at_its_middle() -> None:
    """6 h / T^2 = 44.44 m/s^2 of eq. (35); 12 h / T^3 = 987.65 m/s^3."""
    jump, jerk = 6.0 * 0.06 / 0.09**2, 12.0 * 0.06 / 0.09**3
    sides = {t: [value(STROKE, t, 2, side) for side in ("left", "right")] for t in (0.0, 0.09, 0.18)}
    # rounding of s = 1 in 6 h (1 - 2 s) / T^2
    assert sides[0.0] == pytest.approx([0.0, jump], abs=1e-12)
    assert sides[0.09] == pytest.approx([-jump, -jump], abs=1e-12)
    assert sides[0.18] == pytest.approx([jump, 0.0], abs=1e-12)
    assert [value(STROKE, 0.09, 3, side) for side in ("left", "right")] == pytest.approx([-jerk, jerk], rel=1e-13)


def test_a_run_is_driven_by_eq_35() -> None:
    dataset = run("sps4/ideal")
    found = dataset.drive_position.transpose("time", "drive").to_pandas()
    stroke = [adams_step(t, 0.0, 0.0, 0.09, 0.06) + adams_step(t, 0.09, 0.0, 0.18, -0.06) for t in found.index]
    for name in ("P1", "P2"):
        # rounding of 60 mm and of t
        assert found[name].to_numpy() == pytest.approx(np.array(stroke), abs=1e-15)
    assert np.abs(found[["P3", "P4"]].to_numpy()).max() == 0.0
