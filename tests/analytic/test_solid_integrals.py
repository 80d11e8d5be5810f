"""Invariants of a solid bundle against brute-force quadrature over its curved cells, and its energy against a cloud."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

from flexclear.pipeline.structure.fe.solid.elements import shape_functions
from flexclear.pipeline.structure.modes import bundle
from flexclear.pipeline.structure.modes.solution import solve
from tests.analytic.clouds import Cloud, same_energy, same_integrals
from tests.analytic.solid_models import build, gauss, rod


@pytest.fixture(scope="module", params=["rigid", "mean"])
def body(request: pytest.FixtureRequest) -> tuple[xr.Dataset, Cloud]:
    """A thick rod of few cells: five points per direction integrate the mass of 27-node cells exactly."""
    recipe = rod("hex27", (3, 1, 1), request.param)
    recipe["shape"] |= {"length": 0.04}
    mesh = build(recipe)
    modes = solve(mesh, "craig-bampton", 12)
    return bundle.build(mesh, modes), cloud(mesh, displacements(mesh, modes))


def displacements(mesh: xr.Dataset, modes: xr.Dataset) -> np.ndarray:
    """Of all nodes, shape (nodes, 3, n): free nodes in their order, then six numbers of each rigid frame."""
    x, vectors = mesh["node_position"].values, modes["vector"].values
    rigid = np.flatnonzero(mesh["frame_tie"].values == "rigid")
    tied = {int(k): mesh["tie_node"].values[mesh["tie_frame"].values == k] for k in rigid}
    free = np.setdiff1d(np.arange(len(x)), np.concatenate([np.empty(0, dtype=int), *tied.values()]))
    u = np.zeros((len(x), 3, vectors.shape[1]))
    u[free] = vectors[: 3 * free.size].reshape(-1, 3, vectors.shape[1])
    for n, (k, nodes) in enumerate(tied.items()):
        frame = vectors[3 * free.size + 6 * n :][:6]
        r = x[nodes] - mesh["frame_position"].values[k]
        u[nodes] = frame[:3] + np.cross(frame[3:].T[None], r[:, None]).transpose(0, 2, 1)
    return u


def cloud(mesh: xr.Dataset, u: np.ndarray) -> Cloud:
    points, weight = gauss(6)
    value, gradient = shape_functions("hex27", points)
    x, cells = mesh["node_position"].values, mesh["cell_node"].values
    J = np.einsum("cai,qaj->cqij", x[cells], gradient)
    mass = 2740.0 * np.linalg.det(J) * weight
    place = np.einsum("cai,qa->icq", x[cells], value)
    shape = np.einsum("cain,qa->icqn", u[cells], value, optimize=True)
    return Cloud(mass.ravel(), place.reshape(3, -1), shape.reshape(3, mass.size, -1))


def test_integrals_are_those_of_the_volume(body: tuple[xr.Dataset, Cloud]) -> None:
    same_integrals(*body, 0.04)


def test_kinetic_energy_of_any_motion_is_that_of_the_volume(body: tuple[xr.Dataset, Cloud]) -> None:
    same_energy(*body)


def test_frames_move_as_their_nodes_do(body: tuple[xr.Dataset, Cloud]) -> None:
    """Forces on a frame do the work of tractions with the same resultant: mean of the face by area."""
    data, _ = body
    top = data.sel(frame="top")
    np.testing.assert_allclose(top["frame_position"].values, [0.04, 0.0, 0.0], atol=1e-12)
    face = np.abs(data["node_position"].values[:, 0] - 0.04) < 1e-9
    moved = data["shape_translation"].values[face]
    low, high = moved.min(axis=0), moved.max(axis=0)
    # the frame's motion lies among those of the face; constraint modes move it by much more than rounding
    inside = top["frame_translation_shape"].values
    assert np.all((inside >= low - 1e-9) & (inside <= high + 1e-9))
    assert np.abs(inside).max() > 1.0
