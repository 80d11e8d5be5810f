"""Checks of a body that another program assembled: its rigid-body properties and first frequencies, next to those that
the program states."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import scipy.sparse as sp
import xarray as xr

from flexclear.structure.fe.model import Model, rigid_motion_force
from flexclear.structure.fe.statics import Flexibility
from flexclear.structure.modes import normal
from flexclear.system.errors import InputError
from flexclear.system.progress import Progress

WHERE = "mesh recipe [shape]"
#: largest relative difference from a frequency or mass of a listing of the same model
SAME = 0.01
#: a listed frequency is one of a rigid motion below this fraction of the first elastic one
RIGID = 1e-2


def measure(mesh: xr.Dataset, flexibility: Flexibility, progress: Progress) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return frequencies (schema DEFICITS) and a text on the matrices as an attribute; nothing for other bodies.

    Raises InputError where a listing of the program has other frequencies or another mass.
    """
    if mesh.attrs.get("body_kind") != "matrices":
        return {}, {}
    model = flexibility.model
    none = sp.csr_array((0, model.size))
    # 10: number of frequencies of the free body that are compared
    count = min(10, model.size - 6)
    free = normal.eigenvalues_to_hz(normal.lowest_modes(model, none, count, lambda: flexibility, progress).values)[
        :count
    ]
    data = {"free_frequency": (("free_mode",), free)}
    mass, centre, inertia = rigid_properties(model)
    stated = float(mesh["listed_mass"]) if "listed_mass" in mesh else float(mesh.get("body_mass", np.nan))
    if "listed_frequency" in mesh:
        listed = _elastic_frequencies(mesh["listed_frequency"].values, free)[:count]
        data["listed_frequency"] = (("listed",), listed)
        _require_same("frequency 1 of the free body", free[0], listed[0], "Hz")
    if np.isfinite(stated):
        _require_same("the mass", mass, stated, "kg")
    six = inertia[[0, 1, 2, 1, 0, 0], [0, 1, 2, 2, 2, 1]]
    lines = (
        f"matrices: symmetric to {mesh.attrs['asymmetry']:.1g}, both positive definite but for six rigid motions, "
        f"which strain to {rigid_motion_force(model.stiffness, model.rigid).max():.1g} of the largest term",
        f"mass {mass:.7g} kg" + (f" ({stated:.7g} kg in the program's file)" if np.isfinite(stated) else ""),
        f"centre of mass {_number_list(centre)} m",
        f"inertia about it, xx yy zz yz xz xy {_number_list(six)} kg m^2",
    )
    return data, {"imported": "\n".join(lines)}


def require_definite(mesh: xr.Dataset, flexibility: Callable[[], Flexibility]) -> None:
    """Raise InputError for a stiffness matrix from another program with less than positive energy in elastic motion."""
    if mesh.attrs.get("body_kind") != "matrices":
        return
    try:
        flexibility()
    except InputError:
        problem = "the stiffness matrix has motions of no or negative energy besides the six rigid ones"
        raise InputError(
            WHERE, problem, "write the stiffness of the whole unloaded body; parts must share faces"
        ) from None


def rigid_properties(model: Model) -> tuple[float, np.ndarray, np.ndarray]:
    """Return mass [kg], centre [m] and inertia about it [kg m^2] that the mass matrix has in rigid motion."""
    inner = model.rigid.T @ (model.mass @ model.rigid)
    mass = float(np.trace(inner[:3, :3])) / 3.0
    # translation and rotation about the middle couple by m c~ with the lever c of the centre of mass
    coupled = inner[3:, :3] / mass
    lever = (
        np.array([coupled[2, 1] - coupled[1, 2], coupled[0, 2] - coupled[2, 0], coupled[1, 0] - coupled[0, 1]]) / 2.0
    )
    inertia = inner[3:, 3:] - mass * (lever @ lever * np.eye(3) - np.outer(lever, lever))
    return mass, model.position.mean(axis=0) + lever, inertia


def _elastic_frequencies(listed: np.ndarray, free: np.ndarray) -> np.ndarray:
    """Return the listed frequencies without those of rigid motions; raise InputError unless some are left."""
    elastic = listed[6:]
    if len(elastic) == 0 or np.any(listed[:6] > RIGID * elastic[0]):
        problem = f"the listing has {len(listed)} frequencies and not six of rigid motions before others"
        raise InputError(WHERE, problem, "list at least seven frequencies of the free body")
    return elastic


def _require_same(what: str, found: float, stated: float, unit: str) -> None:
    if abs(found - stated) > SAME * abs(stated):
        problem = f"{what} is {found:.6g} {unit} by the matrices and {stated:.6g} {unit} by the program's file"
        raise InputError(WHERE, problem, "check `units`, and that all files are of one model")


def _number_list(values: np.ndarray) -> str:
    rounding = 1e-12 * np.abs(values).max()
    return " ".join(f"{value if abs(value) > rounding else 0.0:.6g}" for value in values)
