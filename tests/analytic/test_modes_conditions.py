"""Reference conditions, and what a bundle says that it lacks, against theory and direct solutions of the full model."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import scipy.sparse as sp
import scipy.sparse.linalg
import xarray as xr

from flexclear.artifacts import compliance
from flexclear.structure.fe.model import Model
from flexclear.structure.fe.recipe import read_recipe
from flexclear.structure.fe.statics import Flexibility, factorise_supported
from flexclear.structure.kinds import kind
from flexclear.structure.kinds.kind import of_mesh
from flexclear.structure.modes import bundle, deficits, normal
from flexclear.structure.modes.basis import ModeRequest
from flexclear.structure.modes.solution import solve
from flexclear.system.errors import InputError

MESHES = Path(__file__).parents[2] / "meshes"
#: the rod of ../../meshes/actuated_rod.toml
L, E, RHO, A, I = 0.24, 7.17e10, 2740.0, np.pi * 1e-4, np.pi * 1e-8 / 4.0
G = E / 2.66
#: six conditions each, nothing truncated
COMPLETE: dict[str, dict[str, object]] = {
    "free-free": {},
    "cantilever": {},
    "pinned-pinned": {},
    "constrained": {"held": ("bottom.x", "bottom.y", "bottom.rz", "at_60mm.z", "top.x", "top.y")},
    "craig-bampton": {"interfaces": ("bottom", "at_60mm", "top")},
    "craig-chang": {},
    "residual-flexibility": {},
    "mean-axis": {"of": "craig-bampton"},
}


@pytest.fixture(scope="module")
def rod() -> xr.Dataset:
    return kind.build(read_recipe(MESHES / "actuated_rod.toml"))


@pytest.fixture(scope="module")
def body(rod: xr.Dataset) -> Flexibility:
    return factorise_supported(of_mesh(rod).assemble(rod), lambda fraction: None)


@pytest.mark.parametrize("condition", COMPLETE)
def test_complete_sets_span_the_same_space(rod: xr.Dataset, body: Flexibility, condition: str) -> None:
    """Each has every elastic coordinate, all static compliance, and with rigid motion the free body's frequencies."""
    vectors = solve(rod, condition, None, **COMPLETE[condition])["vector"].values  # type: ignore[arg-type]
    model = body.model
    assert vectors.shape == (78, 72)
    together = np.hstack([model.rigid, vectors])
    assert np.linalg.matrix_rank(together / np.linalg.norm(together, axis=0)) == 78
    fraction = deficits.of_basis(body, model.interfaces, vectors) / deficits.full_compliance(body, model.interfaces)
    # the eigenvalues of the basis span 1e9; what is left of rounding in a static answer is about its root
    np.testing.assert_allclose(fraction, 1.0, rtol=0.0, atol=1e-7)
    values, _ = normal.rediagonalise(model.stiffness, model.mass, body.remove_momentum(vectors))
    full = normal.dense_eigenpairs(model.stiffness, model.mass, 78)[0][6:]
    # eps times the ratio of the largest to the lowest eigenvalue is 1e-7 as a bound
    np.testing.assert_allclose(values, full, rtol=2e-7)


def test_mean_axes_take_all_momentum_out_of_any_basis(rod: xr.Dataset, body: Flexibility) -> None:
    found = solve(rod, "mean-axis", 13, of="craig-bampton")
    momentum = body.momentum.T @ found["vector"].values
    # sqrt(m) is the largest momentum that a shape of unit modal mass could have
    assert np.abs(momentum).max() < 1e-12 * np.sqrt(0.2066)
    held = solve(rod, "craig-bampton", 13)["vector"].values
    assert np.abs(body.momentum.T @ held).max() > 0.1 * np.sqrt(0.2066)
    assert "craig-bampton" in found.attrs["rigid_motion"]


def test_attachment_modes_have_the_free_rods_answer_to_an_end_load(rod: xr.Dataset, body: Flexibility) -> None:
    """A force on the end of a free rod, balanced by its inertia, moves that end by F L / 3 E A from the mean."""
    whole = deficits.full_compliance(body, body.model.interfaces)
    axial = whole[3, 3, 2]  # frame `top` against nothing, z of the frame runs along the rod
    # 12 linear elements: constant strain where the true one is linear loses 1 / 4 n^2 of the energy
    assert axial == pytest.approx(L / (3.0 * E * A) * (1.0 - 0.25 / 144), rel=1e-9)
    for condition in ("craig-chang", "residual-flexibility"):
        found = solve(rod, condition, 19)["vector"].values
        fraction = deficits.of_basis(body, body.model.interfaces, found) / whole
        # both frames are loaded: all their compliance is there, held or free
        np.testing.assert_allclose(fraction[np.ix_([0, 3], [0, 3])], 1.0, rtol=0.0, atol=1e-9)


def test_both_attachment_bases_are_one_space(rod: xr.Dataset) -> None:
    chang, rubin = (solve(rod, name, 25)["frequency"].values for name in ("craig-chang", "residual-flexibility"))
    np.testing.assert_allclose(chang, rubin, rtol=1e-7)


def means(model: Model) -> sp.csr_array:
    """Six functionals that mix degrees of freedom: the mean motion of both ends."""
    return sp.csr_array(0.5 * (model.interfaces[0].motion + model.interfaces[3].motion))


@pytest.mark.parametrize("rows", [means, lambda model: model.interfaces[0].motion])
def test_dense_and_sparse_solvers_agree_on_held_functionals(
    monkeypatch: pytest.MonkeyPatch, body: Flexibility, rows: Callable[[Model], sp.csr_array]
) -> None:
    from flexclear.structure.modes import normal
    from flexclear.system.progress import silent

    held = rows(body.model)
    dense = normal.lowest_modes(body.model, held, 8, lambda: body, silent)
    monkeypatch.setattr(normal, "DENSE_LIMIT", 10)
    sparse = normal.lowest_modes(body.model, held, 8, lambda: body, silent)
    # eigenvalues span 1.2e6: the lowest is known to eps times that, 2.6e-10; ten times that
    np.testing.assert_allclose(sparse.values, dense.values, rtol=3e-9)
    for found in (dense, sparse):
        # what is held moves by rounding only, next to motions of 1 / sqrt(m) = 2
        assert np.abs(held @ found.shapes).max() < 1e-9


@pytest.mark.parametrize(
    "requested, count",
    [(ModeRequest(up_to=8000.0), 5), (ModeRequest(up_to=8500.0), 7), (ModeRequest(up_to=11000.0), 8)],
)
def test_modes_up_to_a_frequency(rod: xr.Dataset, requested: ModeRequest, count: int) -> None:
    """The free rod has two bending pairs, torsion, a third pair at 8221 Hz, axial at 10.7 kHz."""
    found = solve(rod, "free-free", requested=requested)
    assert found.sizes["mode"] == count
    assert found["frequency"].values[-1] <= requested.up_to  # type: ignore[operator]


def test_modes_up_to_a_share_of_the_compliance(rod: xr.Dataset, body: Flexibility) -> None:
    ends = (body.model.interfaces[0], body.model.interfaces[3])
    found = solve(rod, "free-free", requested=ModeRequest(compliance=0.9))
    n = found.sizes["mode"]
    assert deficits.least_fraction(body, ends, found["vector"].values)[0] >= 0.9
    # the next smaller whole basis would not do
    assert deficits.least_fraction(body, ends, found["vector"].values[:, : n - 2])[0] < 0.9
    assert solve(rod, "craig-bampton", requested=ModeRequest(compliance=1.0 - 1e-9)).sizes["mode"] == 6


def test_modes_up_to_a_share_of_the_mass(rod: xr.Dataset) -> None:
    """Of a clamped rod the first axial mode carries 8 / pi^2 = 0.81 of the mass, so 0.8 needs it and 0.85 more."""
    first, more = (solve(rod, "cantilever", requested=ModeRequest(mass=fraction)) for fraction in (0.8, 0.85))
    axial = [int(np.sum(found["kind"].values == "axial")) for found in (first, more)]
    assert axial == [1, 2]


def test_a_mechanism_is_distinguished_from_a_body(body: Flexibility) -> None:
    """A hinge: the stiffness of a chain whose middle node is cut in two that share their place only."""
    middle = body.model.position[:, 0] < 0.11
    cut = sp.diags_array(middle.astype(float)) @ body.model.stiffness @ sp.diags_array(middle.astype(float))
    rest = sp.diags_array((~middle).astype(float)) @ body.model.stiffness @ sp.diags_array((~middle).astype(float))
    with pytest.raises(InputError, match="than its six rigid ones"):
        factorise_supported(
            replace(body.model, stiffness=sp.csr_array(_free(cut, body, middle) + _free(rest, body, ~middle))), _quiet
        )


def _free(part: sp.csr_array, body: Flexibility, own: np.ndarray) -> sp.csr_array:
    """A part's stiffness made free of supports: rigid motions of its own taken out."""
    R = body.model.rigid * own[:, None]
    P = np.eye(body.model.size) - R @ np.linalg.pinv(R)
    return sp.csr_array(P.T @ part.toarray() @ P)


def _quiet(fraction: float) -> None:
    """No progress."""


@pytest.mark.parametrize(
    "condition, options, message",
    [
        (
            "fixed-fixed",
            {"requested": ModeRequest(compliance=0.5)},
            r"0 of the compliance .* 'bottom'.*\n.*craig-bampton",
        ),
        ("free-free", {"requested": ModeRequest(mass=0.5)}, r"of the mass moves with the basis\n.*count or up_to"),
        ("free-free", {"requested": ModeRequest(up_to=100.0)}, r"no mode .* 100 Hz; the first is at 1564"),
        ("constrained", {"held": ("top.x", "top.y", "top.z")}, r"leave 3 rigid-body motions of the body free"),
        ("constrained", {"held": ("top.x",) * 6}, r"not independent"),
        ("constrained", {"held": ()}, "no motion is held"),
        ("constrained", {"held": ("topp.x",)}, r"no frame called 'topp'\n.*'top'"),
        ("constrained", {"held": ("top.w",)}, "has no valid direction"),
        ("pinned-pinned", {"interfaces": ("top",)}, "two interfaces"),
        ("pinned-pinned", {"interfaces": ("top", "top")}, "coincide"),
        ("cantilever", {"interfaces": ()}, "clamped at an interface"),
        ("craig-chang", {"interfaces": ()}, "need an interface"),
        ("craig-chang", {"count": 11}, r"12 .*modes"),
        ("mean-axis", {}, "shapes of another condition; none is given"),
        ("mean-axis", {"of": "craig"}, r"no reference condition is called 'craig'"),
    ],
)
def test_what_cannot_be_meant_is_refused(
    rod: xr.Dataset, condition: str, options: dict[str, object], message: str
) -> None:
    with pytest.raises(InputError, match=message):
        solve(rod, condition, **({"count": 8} if "requested" not in options else {}) | options)  # type: ignore[arg-type]


# What a bundle lacks: shares, bounds and warnings --------------------------------------------------------------------

BASES = [("free-free", 7), ("fixed-fixed", 7), ("craig-bampton", 13), ("cantilever", 8), ("craig-chang", 19)]


def test_full_compliance_is_that_of_a_clamped_rod(rod: xr.Dataset) -> None:
    """Top against bottom: L^3/3EI across, L/EA along z of the frame; one against another is not symmetric in place."""
    found = solve(rod, "free-free", 7)["compliance_full"].sel(frame="top", frame_held="bottom").values
    # Hermite cubics and linear bars are exact for end loads
    np.testing.assert_allclose(found[:3], [L**3 / (3 * E * I), L**3 / (3 * E * I), L / (E * A)], rtol=1e-9)
    np.testing.assert_allclose(found[3:5], L / (E * I), rtol=1e-9)
    middle = solve(rod, "free-free", 7)["compliance_full"].sel(frame="at_120mm", frame_held="bottom").values
    np.testing.assert_allclose(middle[2], 0.5 * L / (E * A), rtol=1e-9)


@pytest.mark.parametrize("condition, count", BASES)
def test_shares_are_those_of_a_direct_static_solution(
    rod: xr.Dataset, body: Flexibility, condition: str, count: int
) -> None:
    """Reduced and full body, one frame clamped by elimination, a unit load on the other."""
    data = solve(rod, condition, count)
    basis = np.hstack([body.model.rigid, data["vector"].values])
    bottom, top = (body.model.interfaces[k].motion.toarray() for k in (0, 3))
    load = top[0]  # along the rod: z of the frame
    free = np.arange(6, body.model.size)
    K = body.model.stiffness.toarray()
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
    found = compliance.fractions(compliance.of_bundle(data), data["compliance_full"].values)
    np.testing.assert_allclose(found, data["compliance_share"].values, rtol=0.0, atol=1e-9)
    assert np.all(data["compliance_share"].values <= 1.0 + 1e-9)


@pytest.mark.parametrize("condition, count", BASES)
def test_the_error_of_a_harmonic_load_stays_below_its_bound(
    rod: xr.Dataset, body: Flexibility, condition: str, count: int
) -> None:
    """Direct solutions of the full and of the reduced free body at frequencies below the first one."""
    data = solve(rod, condition, count)
    first = data.attrs["first_free_frequency"]
    vectors = data["vector"].values
    hertz = first * np.array([0.1, 0.5, 0.9])
    bounds = deficits.error_bounds(body, vectors, hertz, first)
    basis = np.hstack([body.model.rigid, vectors])
    for k, frame in enumerate(body.model.interfaces):
        # frame axes x y z are mesh axes y z x
        loads = frame.motion.toarray()[[1, 2, 0, 4, 5, 3]]
        for n, value in enumerate(hertz):
            D = (body.model.stiffness - (2 * np.pi * value) ** 2 * body.model.mass).tocsc()
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


def test_effective_mass_of_a_complete_clamped_basis_is_what_can_move(rod: xr.Dataset, body: Flexibility) -> None:
    """Whole body less the share of the clamped node: (r^T M)_f M_ff^-1 (M r)_f, direction by direction."""
    data = solve(rod, "cantilever", None)
    free = np.arange(6, body.model.size)
    M = body.model.mass.toarray()
    # rotations are about the middle, which is the centre of mass of a uniform rod
    momentum = (M @ body.model.rigid)[free]
    expected = np.einsum("nd,nd->d", momentum, np.linalg.solve(M[np.ix_(free, free)], momentum))
    np.testing.assert_allclose(data["effective_mass"].sum("mode").values, expected, rtol=1e-9)


def test_warnings_name_what_is_missing_where_joints_are(rod: xr.Dataset) -> None:
    found = {name: bundle.build(rod, solve(rod, name, count)) for name, count in BASES}
    (fixed,) = compliance.warnings(found["fixed-fixed"], ("bottom", "top"), "rod1")
    assert "rod1: its fixed-fixed modes" in fixed
    assert "'bottom'" in fixed
    assert "z 0 %" in fixed
    assert 'interfaces = ["bottom", "top"]' in fixed
    (free,) = compliance.warnings(found["free-free"], ("bottom", "top"))
    assert "z 0 %" in free
    assert compliance.warnings(found["craig-bampton"], ("bottom", "top")) == []
    # the same basis with a joint where it has no constraint modes
    assert len(compliance.warnings(found["craig-bampton"], ("at_120mm", "top"))) == 1


def test_the_table_says_it_all(rod: xr.Dataset) -> None:
    text = compliance.table(bundle.build(rod, solve(rod, "fixed-fixed", 7)))
    assert "none; the first is at 1564.49 Hz" in text
    assert "the body frame moves with the clamped 'start' and 'end'" in text
    row = next(line for line in text.splitlines() if line.split()[:2] == ["top", "bottom"])
    assert row.split()[2:] == ["0"] * 6
