"""Matrices whose mass is lumped at nodes that turn: invariants are those of the mass points that nodes stand for."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.io
import scipy.sparse as sp
import xarray as xr

from flexclear.pipeline.core.system.errors import InputError
from flexclear.pipeline.structure.kinds import kind
from flexclear.pipeline.structure.kinds.kind import of_mesh
from flexclear.pipeline.structure.modes import bundle
from flexclear.pipeline.structure.modes.solution import solve
from tests.analytic.beam_models import RECIPE
from tests.analytic.solid_models import build

NODES = 13
COMPONENTS = ("UX", "UY", "UZ", "RX", "RY", "RZ")
TABLE = {
    "interfaces": ["bottom", "top"],
    "shape": {
        "type": "matrices",
        "units": "m-kg-s",
        "stiffness": "k.mtx",
        "mass": "m.mtx",
        "unknowns": "u.csv",
    },
    "frames": {"bottom": {"node": 1}, "top": {"node": NODES}},
}


def points() -> tuple[np.ndarray, np.ndarray]:
    """Six mass points about a centre next to each node: masses (nodes, 6) and places from the node (nodes, 6, 3)."""
    random = np.random.default_rng(20190702)
    mass = np.repeat(random.uniform(0.01, 0.03, (NODES, 1)) / 6.0, 6, axis=1)
    axes = np.linalg.qr(random.normal(size=(NODES, 3, 3)))[0] * random.uniform(0.002, 0.01, (NODES, 1, 3))
    spokes = np.concatenate([axes, -axes], axis=2).transpose(0, 2, 1)
    return mass, 0.004 * random.normal(size=(NODES, 1, 3)) + spokes


def moved(r: np.ndarray) -> np.ndarray:
    """Motion of points at r from a node by the node's six unknowns, shape (..., 3, 6)."""
    x, y, z = np.moveaxis(r, -1, 0)
    zero = np.zeros_like(x)
    turn = np.stack([[zero, z, -y], [-z, zero, x], [y, -x, zero]])  # theta x r
    return np.concatenate([np.broadcast_to(np.eye(3), (*x.shape, 3, 3)), np.moveaxis(turn, (0, 1), (-2, -1))], axis=-1)


@pytest.fixture(scope="module")
def body(tmp_path_factory: pytest.TempPathFactory) -> xr.Dataset:
    """A rod's stiffness with these masses, through files."""
    folder = tmp_path_factory.mktemp("lumped")
    mass, r = points()
    motion = moved(r)
    write(folder, sp.block_diag(list(np.einsum("np,npki,npkj->nij", mass, motion, motion))))
    return build(TABLE, folder)


def write(folder: Path, mass: Any) -> None:
    rod = kind.build(RECIPE | {"elements": NODES - 1})
    model = of_mesh(rod).assemble(rod)
    scipy.io.mmwrite(folder / "k.mtx", sp.coo_array(model.stiffness), symmetry="symmetric", precision=17)
    scipy.io.mmwrite(folder / "m.mtx", sp.coo_array(mass), symmetry="general", precision=17)
    rows = [f"{n + 1},{x!r},0,0,{c}" for n, x in enumerate(place()[:, 0].tolist()) for c in COMPONENTS]
    (folder / "u.csv").write_text("\n".join(["node,x,y,z,component", *rows]))


def place() -> np.ndarray:
    """Nodes of the rod [m], shape (nodes, 3)."""
    return np.linspace(0.0, 0.24, NODES)[:, None] * [1.0, 0.0, 0.0]


def test_invariants_are_those_of_the_points(body: xr.Dataset) -> None:
    modes = solve(body, "craig-bampton", 14)
    data = bundle.build(body, modes)
    mass, r = points()
    m, X = mass.ravel(), (place()[:, None, :] + r).reshape(-1, 3)
    S = np.einsum("npki,nij->npkj", moved(r), modes["vector"].values.reshape(NODES, 6, -1)).reshape(len(m), 3, -1)
    expected = {
        "mass": m.sum(),
        "first_moment": m @ X,
        "second_moment": np.einsum("p,pk,pl->kl", m, X, X),
        "modal_first_moment": np.einsum("p,pkj->kj", m, S),
        "position_mode_moment": np.einsum("p,pk,plj->klj", m, X, S),
        "mode_mode_moment": np.einsum("p,pki,plj->klij", m, S, S, optimize=True),
    }
    for name, values in expected.items():
        # what is left of an offset in a matrix of 17 digits: 1e-16 of a mass next to 1e-3 of it
        np.testing.assert_allclose(data[name].values, values, rtol=0.0, atol=1e-12 * np.abs(values).max(), err_msg=name)
    np.testing.assert_allclose(data["modal_mass"].values, np.eye(14), atol=1e-11)


def test_a_consistent_mass_of_nodes_that_turn_is_refused(tmp_path: Path) -> None:
    rod = kind.build(RECIPE | {"elements": NODES - 1})
    write(tmp_path, of_mesh(rod).assemble(rod).mass)
    given = build(TABLE, tmp_path)
    with pytest.raises(InputError, match=r"not lumped at the nodes.*\n.*lump the mass"):
        of_mesh(given).assemble(given)
