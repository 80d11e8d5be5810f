"""Extrapolated differences find derivatives over whatever length a force changes."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from flexclear.pipeline.core.system.errors import SolverError
from flexclear.pipeline.dynamics.linear.differences import Rounding, derivative

#: what a double resolves, as the callers say it
FINE = Rounding(noise=1e-15, grain=0.0)


@given(rate=st.floats(1e-3, 30.0), phase=st.floats(-3.0, 3.0))
def test_smooth_forces_to_ten_digits(rate: float, phase: float) -> None:
    found, error = derivative(lambda s: np.array([np.sin(rate * s + phase), 3.0 * s]), 1e-2, FINE)
    known = np.array([rate * np.cos(phase), 3.0])
    # noise 1e-15 over steps of 1e-2: some 1e-13 of the larger component
    assert found == pytest.approx(known, abs=1e-10 * max(rate, 3.0))
    assert np.abs(found - known).max() <= 30.0 * error


@given(exponent=st.floats(-9.0, -2.0))
def test_a_contact_that_is_just_closed(exponent: float) -> None:
    """Hertz's force at depths from a nanometre to a centimetre; wider steps leave the contact."""
    depth = 10.0**exponent
    scale = depth**-1.5

    def force(s: float) -> np.ndarray:
        return np.array([scale * max(0.0, depth + s) ** 1.5])

    found, _ = derivative(force, 1e-2, Rounding(noise=1e-15, grain=1e-16 * depth))
    assert found == pytest.approx([1.5 / depth], rel=1e-8)


def test_steps_to_where_there_is_no_force_are_passed_over() -> None:
    def force(s: float) -> np.ndarray:
        if abs(s) > 1e-4:
            raise SolverError("singular")
        return np.array([np.exp(5.0 * s)])

    assert derivative(force, 1e-2, FINE)[0] == pytest.approx([5.0], rel=1e-9)


def test_a_force_that_exists_nowhere_is_told() -> None:
    def force(s: float) -> np.ndarray:
        raise SolverError("singular")

    with pytest.raises(SolverError, match="cannot be evaluated"):
        derivative(force, 1e-2, FINE)


def test_no_force_has_no_derivative_and_no_error() -> None:
    found, error = derivative(lambda s: np.zeros(2), 1e-2, Rounding())
    assert np.array_equal(found, np.zeros(2))
    assert error == 0.0
