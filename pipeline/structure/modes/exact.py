"""Closed-form frequencies beside those of a mesh, mode by mode, where the rod and its ends have any."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import cast

import numpy as np
import xarray as xr

from pipeline.structure.modes import closed_form
from pipeline.structure.modes.closed_form import Span

CONSTANTS = ("area", "youngs_modulus", "shear_modulus", "density")


@dataclass(frozen=True)
class Uniform:
    """The constants of a rod that is the same all along; second moments are (torsion or polar, y, z) [m^4]."""

    length: float
    area: float
    youngs_modulus: float
    shear_modulus: float
    density: float
    second: np.ndarray
    rotary: np.ndarray
    shear_coefficient: float | None


def columns(mesh: xr.Dataset, reference: str, families: list[str]) -> dict[str, np.ndarray]:
    """Exact frequencies [Hz] by theory, each of shape (mode,); empty where no closed form applies.

    families: of the kept modes in ascending order, without gaps within a family.
    """
    rod = uniform(mesh)
    if rod is None or reference not in ("free-free", "fixed-fixed"):
        return {}
    ends = cast(closed_form.Ends, reference)
    found = {"exact_euler_bernoulli": _table(rod, ends, families, rotary=False, shear=None)}
    found["exact_rayleigh"] = _table(rod, ends, families, rotary=True, shear=None)
    if rod.shear_coefficient is not None:
        found["exact_timoshenko"] = _table(rod, ends, families, rotary=True, shear=rod.shear_coefficient)
    return found


def uniform(mesh: xr.Dataset) -> Uniform | None:
    """The rod's constants, or None when they change along it."""
    varying = [
        *(mesh[name].values for name in CONSTANTS),
        *mesh["second_moment"].values.T,
        *mesh["inertia_moment"].values.T,
    ]
    if any(np.ptp(values) > 0.0 for values in varying):
        return None
    x = mesh["node_position"].values[:, 0]
    area, E, G, rho = (float(mesh[name].values[0]) for name in CONSTANTS)
    second, rotary = mesh["second_moment"].values[0], mesh["inertia_moment"].values[0]
    kappa = mesh.attrs.get("shear_coefficient")
    return Uniform(float(np.ptp(x)), area, E, G, rho, second, rotary, None if kappa is None else float(kappa))


def _table(
    rod: Uniform, ends: closed_form.Ends, families: list[str], *, rotary: bool, shear: float | None
) -> np.ndarray:
    result = np.empty(len(families))
    for name in set(families):
        places = [k for k, found in enumerate(families) if found == name]
        result[places] = _series(rod, ends, name, len(places), rotary=rotary, shear=shear)
    return result


def _series(
    rod: Uniform, ends: closed_form.Ends, family: str, count: int, *, rotary: bool, shear: float | None
) -> np.ndarray:
    if family == "axial":
        return closed_form.rod(math.sqrt(rod.youngs_modulus / rod.density), rod.length, count)
    if family == "torsion":
        speed = math.sqrt(rod.shear_modulus * rod.second[0] / (rod.density * rod.rotary[0]))
        return closed_form.rod(speed, rod.length, count)
    # deflection in y bends about z, and the other way round
    axis = 2 if family == "bending_y" else 1
    span = Span(
        length=rod.length,
        bending=rod.youngs_modulus * float(rod.second[axis]),
        line_mass=rod.density * rod.area,
        rotary=rod.density * float(rod.rotary[axis]) if rotary else 0.0,
        shear=math.inf if shear is None else shear * rod.shear_modulus * rod.area,
    )
    return closed_form.bending(span, ends, count)
