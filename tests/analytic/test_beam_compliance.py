"""Static compliance of the reduced rod at its joints: what each basis can and cannot give."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

from flexclear.pipeline.structure.kinds import kind
from flexclear.pipeline.structure.modes import bundle
from flexclear.pipeline.structure.modes.solution import solve
from tests.analytic.beam_models import RECIPE
from tests.analytic.beam_solutions import PAPER_ROD, cantilever_compliance


def compliance(data: xr.Dataset, frame: str) -> np.ndarray:
    """Displacement and rotation per force and moment at a frame, shape (6, 6), body frame held."""
    place = data.sel(frame=frame)
    shapes = np.concatenate([place["frame_translation_shape"].values, place["frame_rotation_shape"].values])
    return shapes @ np.linalg.solve(data["modal_stiffness"].values, shapes.T)


#: relative error of a compliance from modes: the eigenvalues of all of them span 1.2e6, and the softest is known to eps
#: times that, 2.6e-10; forty times that
SOLVED = 1e-8


def reduced(reference: str, count: int | None, interfaces: tuple[str, ...] = ("bottom", "top")) -> xr.Dataset:
    rod = kind.build(RECIPE)
    return bundle.build(rod, solve(rod, reference, count, interfaces))


def relative(found: np.ndarray) -> np.ndarray:
    exact = cantilever_compliance(PAPER_ROD)
    return np.abs(found - exact) / np.sqrt(np.outer(exact.diagonal(), exact.diagonal()))


@pytest.mark.parametrize("count", [6, 8, 13, None])
def test_craig_bampton_has_the_exact_compliance_with_any_number_of_normal_modes(count: int | None) -> None:
    """L/EA, L^3/3EI, L/GJ, L/EI and their coupling; Hermite cubics are exact for end loads."""
    assert relative(compliance(reduced("craig-bampton", count), "top")).max() < SOLVED


def test_a_cantilever_basis_reaches_the_exact_compliance_from_below() -> None:
    """One interface, normal modes only: each adds compliance, all of them together give all of it."""
    exact = cantilever_compliance(PAPER_ROD).diagonal()
    fractions = [
        compliance(reduced("craig-bampton", count, ("bottom",)), "top").diagonal() / exact
        for count in (4, 5, 7, 8, None)
    ]
    assert np.all(np.diff(fractions, axis=0) >= -SOLVED)
    assert fractions[0][0] == pytest.approx(0.0, abs=1e-12)  # four bending modes: not a micrometre along the axis
    np.testing.assert_allclose(fractions[-1], 1.0, rtol=SOLVED)


def test_fixed_fixed_modes_leave_both_ends_rigid() -> None:
    data = reduced("fixed-fixed", None)
    for frame in ("bottom", "top"):
        assert np.array_equal(compliance(data, frame), np.zeros((6, 6)))


def test_craig_bampton_body_frame_follows_its_first_interface() -> None:
    for first, second in (("bottom", "top"), ("top", "bottom")):
        data = reduced("craig-bampton", 13, (first, second))
        assert not data["frame_translation_shape"].sel(frame=first).values.any()
        assert not data["frame_rotation_shape"].sel(frame=first).values.any()
        assert np.abs(data["frame_translation_shape"].sel(frame=second).values).max() > 0.1
