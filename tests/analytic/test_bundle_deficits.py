"""What a bundle says that it lacks: shares, bounds and warnings against direct solutions of the full model."""

from pathlib import Path

import numpy as np
import pytest
import scipy.sparse.linalg
import xarray as xr

from flexclear.pipeline.core.artifacts import compliance as core
from flexclear.pipeline.core.artifacts import deficits as words
from flexclear.pipeline.core.artifacts import modal
from flexclear.pipeline.core.system.errors import InputError
from flexclear.pipeline.structure.fe.model import Model
from flexclear.pipeline.structure.fe.recipe import read_recipe
from flexclear.pipeline.structure.kinds import kind
from flexclear.pipeline.structure.kinds.kind import of_mesh
from flexclear.pipeline.structure.modes import bundle, deficits
from flexclear.pipeline.structure.modes.solution import solve
from flexclear.pipeline.structure.modes.statics import support

MESHES = Path(__file__).parents[2] / "meshes"
BASES = [("free-free", 7), ("fixed-fixed", 7), ("craig-bampton", 13), ("cantilever", 8), ("craig-chang", 19)]
#: the rod of ../../meshes/actuated_rod.toml
L, EA, EI = 0.24, 7.17e10 * np.pi * 1e-4, 7.17e10 * np.pi * 1e-8 / 4.0


@pytest.fixture(scope="module")
def rod() -> xr.Dataset:
    return kind.build(read_recipe(MESHES / "actuated_rod.toml"))


@pytest.fixture(scope="module")
def model(rod: xr.Dataset) -> Model:
    return of_mesh(rod).assemble(rod)


def test_full_compliance_is_that_of_a_clamped_rod(rod: xr.Dataset) -> None:
    """Top against bottom: L^3/3EI across, L/EA along z of the frame; one against another is not symmetric in place."""
    found = solve(rod, "free-free", 7)["compliance_full"].sel(frame="top", frame_held="bottom").values
    # Hermite cubics and linear bars are exact for end loads
    np.testing.assert_allclose(found[:3], [L**3 / (3 * EI), L**3 / (3 * EI), L / EA], rtol=1e-9)
    np.testing.assert_allclose(found[3:5], L / EI, rtol=1e-9)
    middle = solve(rod, "free-free", 7)["compliance_full"].sel(frame="at_120mm", frame_held="bottom").values
    np.testing.assert_allclose(middle[2], 0.5 * L / EA, rtol=1e-9)


@pytest.mark.parametrize("condition, count", BASES)
def test_shares_are_those_of_a_direct_static_solution(
    rod: xr.Dataset, model: Model, condition: str, count: int
) -> None:
    """Reduced and full body, one frame clamped by elimination, a unit load on the other."""
    data = solve(rod, condition, count)
    basis = np.hstack([model.rigid, data["vector"].values])
    bottom, top = (model.interfaces[k].motion.toarray() for k in (0, 3))
    load = top[0]  # along the rod: z of the frame
    free = np.arange(6, model.size)
    K = model.stiffness.toarray()
    full = load[free] @ np.linalg.solve(K[np.ix_(free, free)], load[free])
    # combinations of the basis that leave the bottom where it is
    _, size, right = np.linalg.svd(bottom @ basis)
    inside = basis @ right[int(np.sum(size > 1e-9 * size[0])) :].T
    reduced = (inside.T @ load) @ np.linalg.pinv(inside.T @ K @ inside, rcond=1e-13, hermitian=True) @ (inside.T @ load)
    fraction = float(data["compliance_share"].sel(frame="top", frame_held="bottom", direction="z"))
    assert fraction == pytest.approx(reduced / full, abs=1e-6)


@pytest.mark.parametrize("condition, count", BASES)
def test_the_compliance_fractions_of_a_bundle_follow_from_its_own_numbers(
    rod: xr.Dataset, condition: str, count: int
) -> None:
    data = bundle.build(rod, solve(rod, condition, count))
    found = core.fractions(core.of_bundle(data), data["compliance_full"].values)
    np.testing.assert_allclose(found, data["compliance_share"].values, rtol=0.0, atol=1e-9)
    assert np.all(data["compliance_share"].values <= 1.0 + 1e-9)


@pytest.mark.parametrize("condition, count", BASES)
def test_the_error_of_a_harmonic_load_stays_below_its_bound(
    rod: xr.Dataset, model: Model, condition: str, count: int
) -> None:
    """Direct solutions of the full and of the reduced free body at frequencies below the first one."""
    data = solve(rod, condition, count)
    first = data.attrs["first_free_frequency"]
    vectors = data["vector"].values
    hertz = first * np.array([0.1, 0.5, 0.9])
    flexibility = support(model, lambda fraction: None)
    bounds = deficits.bounds(flexibility, vectors, hertz, first)
    basis = np.hstack([model.rigid, vectors])
    for k, frame in enumerate(model.interfaces):
        # frame axes x y z are mesh axes y z x
        loads = frame.motion.toarray()[[1, 2, 0, 4, 5, 3]]
        for n, value in enumerate(hertz):
            D = (model.stiffness - (2 * np.pi * value) ** 2 * model.mass).tocsc()
            full = np.einsum("dn,nd->d", loads, scipy.sparse.linalg.spsolve(D, loads.T))
            reduced = np.einsum("dn,nd->d", loads @ basis, np.linalg.solve(basis.T @ (D @ basis), (loads @ basis).T))
            error = full - reduced
            # the condition of D with a unit diagonal is 4e5 at most: eps times that is 1e-10; a hundred times that
            rounding = 1e-8 * np.abs(full)
            assert np.all(error > -rounding)
            assert np.all(error <= bounds[k, :, n] + rounding)
            if condition == "free-free":
                # exact modes: the bound is off by the factor 1 / (1 - w^2 / w1^2) at most
                assert np.all(error >= (1.0 - (value / first) ** 2) * bounds[k, :, n] - rounding)


def test_the_bound_at_rest_is_the_missing_compliance(rod: xr.Dataset) -> None:
    data = solve(rod, "free-free", 13)
    own = {"frame": xr.DataArray([0, 3], dims="f"), "frame_held": xr.DataArray([0, 3], dims="f")}
    full, fraction = (data[name].isel(own).values for name in ("compliance_full", "compliance_share"))
    bound = data["error_bound"].isel(frame=[0, 3], bound_frequency=0).values
    np.testing.assert_allclose(bound, full * (1.0 - fraction), rtol=1e-6)


def test_resolved_frequencies(rod: xr.Dataset) -> None:
    """Free modes resolve themselves; clamped ends resolve nothing of a free rod, constraint modes some of it."""
    found = {name: solve(rod, name, count).attrs for name, count in BASES}
    assert found["free-free"]["resolved_frequency"] == pytest.approx(8221.007, abs=1e-3)
    assert found["fixed-fixed"]["resolved_frequency"] == 0.0
    assert 4000.0 < found["craig-bampton"]["resolved_frequency"] < 6600.0


def test_effective_mass_of_a_complete_clamped_basis_is_what_can_move(rod: xr.Dataset, model: Model) -> None:
    """Whole body less the share of the clamped node: (r^T M)_f M_ff^-1 (M r)_f, direction by direction."""
    data = solve(rod, "cantilever", None)
    free = np.arange(6, model.size)
    M = model.mass.toarray()
    # rotations are about the middle, which is the centre of mass of a uniform rod
    momentum = (M @ model.rigid)[free]
    expected = np.einsum("nd,nd->d", momentum, np.linalg.solve(M[np.ix_(free, free)], momentum))
    np.testing.assert_allclose(data["effective_mass"].sum("mode").values, expected, rtol=1e-9)


def test_truncation_keeps_every_variable_together(rod: xr.Dataset) -> None:
    """Fewer modes of a larger free basis are the smaller free basis."""
    large, small = (bundle.build(rod, solve(rod, "free-free", n)) for n in (13, 7))
    cut = large.modal.truncate(7)
    assert isinstance(large.modal, modal.Modal)
    assert cut.modal.count == cut.attrs["count"] == 7
    assert set(small.data_vars) - set(cut.data_vars) == {"error_bound"}
    for name in cut.data_vars:
        expected = small[name].values
        scale = np.abs(expected).max() if expected.dtype.kind == "f" else 1.0
        np.testing.assert_allclose(cut[name].values, expected, rtol=0.0, atol=1e-9 * max(scale, 1e-3), err_msg=name)
    with pytest.raises(InputError, match="cut a pair"):
        large.modal.truncate(6)
    with pytest.raises(InputError, match="0 of 13 modes"):
        large.modal.truncate(0)


def test_a_run_is_truncated_too() -> None:
    run = xr.Dataset(
        {"modal_coordinate": (("time", "mode"), np.arange(6.0).reshape(2, 3)), "kinetic": ("time", [1.0, 2.0])}
    )
    np.testing.assert_array_equal(run.modal.truncate(2)["modal_coordinate"].values, [[0.0, 1.0], [3.0, 4.0]])


def test_warnings_name_what_is_missing_where_joints_are(rod: xr.Dataset) -> None:
    found = {name: bundle.build(rod, solve(rod, name, count)) for name, count in BASES}
    (fixed,) = words.warnings(found["fixed-fixed"], ("bottom", "top"), "rod1")
    assert "rod1: its fixed-fixed modes" in fixed
    assert "'bottom'" in fixed
    assert "z 0 %" in fixed
    assert 'interfaces = ["bottom", "top"]' in fixed
    (free,) = words.warnings(found["free-free"], ("bottom", "top"))
    assert "z 0 %" in free
    assert words.warnings(found["craig-bampton"], ("bottom", "top")) == []
    # the same basis with a joint where it has no constraint modes
    assert len(words.warnings(found["craig-bampton"], ("at_120mm", "top"))) == 1


def test_the_table_says_it_all(rod: xr.Dataset) -> None:
    text = words.table(bundle.build(rod, solve(rod, "fixed-fixed", 7)))
    assert "not even the first, 1564.49 Hz" in text
    assert "the body frame rides on the clamped 'start' and 'end'" in text
    row = next(line for line in text.splitlines() if line.split()[:2] == ["top", "bottom"])
    assert row.split()[2:] == ["0"] * 6
