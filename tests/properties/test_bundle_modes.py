"""Modes: the same in every process, oriented and signed, whole clusters only, complete when asked."""

from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp
import xarray as xr

from flexclear.structure.fe import beam
from flexclear.structure.fe.model import Model
from flexclear.structure.fe.recipe import read_recipe
from flexclear.structure.fe.statics import Flexibility, factorise_supported
from flexclear.structure.kinds import kind
from flexclear.structure.kinds.kind import of_mesh
from flexclear.structure.modes import normal, reference
from flexclear.structure.modes.reference import Condition, require_definite_condition
from flexclear.structure.modes.solution import solve
from flexclear.system.errors import InputError, SolverError
from flexclear.system.progress import silent
from tests.processes import printed

ROOT = Path(__file__).parents[2]
WHOLE = [
    ("free-free", 7),
    ("free-free", 8),
    ("free-free", 13),
    ("fixed-fixed", 7),
    ("cantilever", 8),
    ("pinned-pinned", 8),
    ("craig-bampton", 13),
    ("craig-chang", 19),
    ("residual-flexibility", 19),
]
#: conditions that take more than a count; tests/analytic/test_modes_conditions.py
WITH_MORE = {"constrained", "mean-axis"}
#: more elements than the dense limit allows, so that the sparse solver is at work; nodes at 60 mm and 120 mm
MANY = 4 * (normal.DENSE_LIMIT // (4 * beam.N_DOFS) + 1)


def rod(elements: int = 12) -> xr.Dataset:
    return kind.build(read_recipe(ROOT / "meshes" / "actuated_rod.toml") | {"elements": elements})


@pytest.fixture(scope="module")
def paper_rod() -> xr.Dataset:
    return rod()


def test_no_reference_condition_is_left_out() -> None:
    """A condition added to the family has to appear in these tests; "given" bases are those of test_program_files."""
    assert {name for name, _ in WHOLE} | WITH_MORE | {"given"} == set(reference.CONDITIONS)


@pytest.mark.parametrize(
    "condition, count, whole",
    [
        ("free-free", 6, "5 and 7"),
        ("free-free", 12, "11 and 13"),
        ("free-free", 1, "2"),
        ("fixed-fixed", 6, "5 and 7"),
        ("fixed-fixed", 3, "2 and 4"),
        ("craig-bampton", 12, "11 and 13"),
        ("craig-bampton", 7, "6 and 8"),
    ],
)
def test_a_count_that_cuts_a_pair_names_the_whole_counts(
    paper_rod: xr.Dataset, condition: str, count: int, whole: str
) -> None:
    with pytest.raises(InputError, match=rf"{count} modes split a cluster of 2 equal.*\n.*counts? (are|is) {whole}$"):
        solve(paper_rod, condition, count)


@pytest.mark.parametrize("condition, most", [("free-free", 72), ("fixed-fixed", 66), ("craig-bampton", 72)])
def test_complete_bases_have_every_elastic_coordinate(paper_rod: xr.Dataset, condition: str, most: int) -> None:
    modes = solve(paper_rod, condition, None)
    shapes = modes["shape"].values.reshape(-1, most)
    assert modes.sizes["mode"] == most
    assert np.linalg.matrix_rank(shapes / np.linalg.norm(shapes, axis=0)) == most
    with pytest.raises(InputError, match=f"{most + 1} modes are requested, but the mesh has {most}"):
        solve(paper_rod, condition, most + 1)


@pytest.mark.parametrize("count", [1, 5])
def test_craig_bampton_needs_its_constraint_modes(paper_rod: xr.Dataset, count: int) -> None:
    with pytest.raises(InputError, match="6 constraint modes"):
        solve(paper_rod, "craig-bampton", count)


def test_interfaces_must_be_frames_on_different_nodes(paper_rod: xr.Dataset) -> None:
    with pytest.raises(InputError, match=r"no frame called 'topp'\n.*'top'"):
        solve(paper_rod, "craig-bampton", 13, ("bottom", "topp"))
    with pytest.raises(InputError, match="at least one interface"):
        solve(paper_rod, "craig-bampton", 13, ())
    with pytest.raises(InputError, match="same node"):
        solve(paper_rod, "craig-bampton", 13, ("top", "top"))
    with pytest.raises(InputError, match=r"no reference condition is called 'free'\n.*'free-free'"):
        solve(paper_rod, "free", 7)


def test_fixed_fixed_needs_something_between_the_ends() -> None:
    recipe = read_recipe(ROOT / "meshes" / "actuated_rod.toml")
    recipe |= {"elements": 1, "frames": {"top": {"x": 0.24}}, "interfaces": []}
    with pytest.raises(InputError, match="no coordinate between two clamped ends"):
        solve(kind.build(recipe), "fixed-fixed", None)


@pytest.mark.parametrize("condition, count", WHOLE)
def test_equal_pairs_bend_in_y_then_z(paper_rod: xr.Dataset, condition: str, count: int) -> None:
    modes = solve(paper_rod, condition, count)
    bending = np.flatnonzero(modes["kind"].values == "bending")
    shapes = modes["shape"].values
    for first, second in bending.reshape(-1, 2):
        size = np.abs(shapes[:, :, [first, second]]).max()
        # what is left in the other plane is the rotation's rounding
        assert np.abs(shapes[:, [0, 2, 3, 4], first]).max() < 1e-10 * size
        assert np.abs(shapes[:, [0, 1, 3, 5], second]).max() < 1e-10 * size
        # ry = -dw/dx, so the two are one shape in two planes
        np.testing.assert_allclose(shapes[:, 1, first], shapes[:, 2, second], atol=1e-8 * size)
        np.testing.assert_allclose(shapes[:, 5, first], -shapes[:, 4, second], atol=1e-8 * size)


@pytest.mark.parametrize("condition, count", WHOLE)
def test_largest_component_is_positive(paper_rod: xr.Dataset, condition: str, count: int) -> None:
    modes = solve(paper_rod, condition, count)
    for j, word in enumerate(modes["kind"].values):
        part = modes["shape"].values[:, 3 if word == "torsion" else slice(0, 3), j].ravel()
        # ends of an antisymmetric shape are equal up to rounding; then the first of them is positive
        large = part[np.abs(part) >= (1.0 - 1e-6) * np.abs(part).max()]
        assert large[0] > 0.0


SHAPES = """
from pathlib import Path
import hashlib
import numpy as np
from tests.properties.test_bundle_modes import MANY, rod
from flexclear.structure.modes.solution import solve
np.random.seed({seed})
shapes = [solve(rod(n), "free-free", 7)["shape"].values for n in (12, MANY)]
print(hashlib.sha256(b"".join(s.tobytes() for s in shapes)).hexdigest())
"""


def test_every_process_gets_the_same_shapes() -> None:
    """Dense and sparse solver; ARPACK would start from numpy's random state otherwise."""
    assert len({printed(SHAPES.format(seed=seed)) for seed in (1, 2)}) == 1


@pytest.mark.parametrize("condition, count", [("free-free", 7), ("fixed-fixed", 7), ("craig-bampton", 13)])
def test_sparse_and_dense_solver_agree(monkeypatch: pytest.MonkeyPatch, condition: str, count: int) -> None:
    fine = rod(MANY)
    sparse = solve(fine, condition, count)
    monkeypatch.setattr(normal, "DENSE_LIMIT", 10**6)
    dense = solve(fine, condition, count)
    # eps times the ratio of the largest to the lowest eigenvalue is 1e-6 as a bound; a hundredth of it is usual
    np.testing.assert_allclose(sparse["frequency"], dense["frequency"], rtol=1e-7)
    assert list(sparse["kind"].values) == list(dense["kind"].values)
    scale = np.abs(dense["shape"].values).max(axis=(0, 1))
    assert np.all(np.abs(sparse["shape"].values - dense["shape"].values).max(axis=(0, 1)) < 1e-6 * scale)


@pytest.mark.parametrize("held", [True, False])
def test_a_missed_mode_is_noticed(held: bool) -> None:
    """Sylvester's count sees a frequency that an eigensolver left out, of a held as of a free body."""
    model = of_mesh(rod()).assemble(rod())
    rows = model.interfaces[0].motion if held else sp.csr_array((0, model.size))
    values = normal.lowest_modes(model, rows, 8, support_of(model), silent).values
    normal._require_complete_spectrum(model, rows, *gap(values))
    fewer = np.delete(values, 2)
    with pytest.raises(SolverError, match="the eigensolver found"):
        normal._require_complete_spectrum(model, rows, *gap(fewer))


def support_of(model: Model) -> Callable[[], Flexibility]:
    return lambda: factorise_supported(model, lambda fraction: None)


def gap(values: np.ndarray) -> tuple[int, float]:
    found = normal.count_below_gap(values)
    assert found is not None
    return found


def test_rigid_modes_are_separated_by_a_gap() -> None:
    normal.without_rigid(np.array([0.0, 1e-3, 1e-2, 9e7]), 3)
    with pytest.raises(SolverError, match="expected below a gap"):
        normal.without_rigid(np.array([0.0, 1e-3, 1e6, 9e7]), 3)  # a mechanism or a missing rigid mode
    with pytest.raises(SolverError, match="expected below a gap"):
        normal.without_rigid(np.array([0.0, 1e-3, 1e-2, 1.1e-2, 9e7]), 3)


def test_a_body_a_million_times_softer_keeps_its_modes() -> None:
    """No frequency in Hz is built in: the rod of jelly has the same shapes, a thousand times slower."""
    recipe = read_recipe(ROOT / "meshes" / "actuated_rod.toml")
    soft = recipe | {"material": recipe["material"] | {"youngs_modulus": 7.17e4}}
    stiff, slow = (solve(kind.build(r), "free-free", 8) for r in (recipe, soft))
    np.testing.assert_allclose(slow["frequency"] * 1e3, stiff["frequency"], rtol=1e-9)
    np.testing.assert_allclose(slow["shape"], stiff["shape"], atol=1e-7)


def test_craig_bampton_frequencies_fall_to_the_clamped_rod(paper_rod: xr.Dataset) -> None:
    """Rayleigh-Ritz: from above, and monotonic as normal modes are added."""
    exact = solve(paper_rod, "craig-bampton", None, ("bottom",))["frequency"].values
    errors = [solve(paper_rod, "craig-bampton", n)["frequency"].values[:6] / exact[:6] - 1.0 for n in (6, 8, 13, 25)]
    assert np.all(np.diff(errors, axis=0) <= 1e-10)
    assert np.min(errors) > -1e-10
    assert errors[2][:4].max() < 2e-3


def held_by(*rows: list[float]) -> tuple[Any, Condition]:
    """A body of one point with three rotations, of a size of 1 m, and a condition that holds these motions of it."""
    model = SimpleNamespace(position=np.array([[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0]]), rigid=np.eye(6))
    nothing = sp.csr_array((0, 6))
    return model, Condition(sp.csr_array(np.array(rows)), "", np.zeros(0, dtype=int), nothing)


@pytest.mark.parametrize("angle, independent", [(1e-6, True), (1e-12, False)])
def test_held_motions_are_independent_down_to_rounding(angle: float, independent: bool) -> None:
    """Six motions, of which two are at an angle of 1e-6 to each other, hold a body; at 1e-12 they are one."""
    rows = np.eye(6)
    rows[1] = np.cos(angle) * rows[0] + np.sin(angle) * rows[1]
    if independent:
        require_definite_condition(*held_by(*rows.tolist()))
        return
    with pytest.raises(InputError, match="not independent of each other"):
        require_definite_condition(*held_by(*rows.tolist()))


@pytest.mark.parametrize("lever, left", [(1e-6, 0), (1e-12, 1)])
def test_a_short_lever_holds_a_rotation_down_to_rounding(lever: float, left: int) -> None:
    """Held at two places of a body of 1 m that are a micrometre apart, it cannot turn; at 1e-12 m it can."""
    model, condition = held_by(*np.eye(6).tolist())
    model.rigid = np.diag([1.0, 1.0, 1.0, 1.0, 1.0, lever])
    if not left:
        require_definite_condition(model, condition)
        return
    with pytest.raises(InputError, match=f"leave {left} rigid-body motions"):
        require_definite_condition(model, condition)
