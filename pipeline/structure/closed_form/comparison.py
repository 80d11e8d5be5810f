"""Closed-form frequencies next to those of a mesh, mode by mode, where the rod and its ends have any."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr

from flexclear.pipeline.structure.closed_form import frequencies
from flexclear.pipeline.structure.closed_form.frequencies import Span

#: of bending, torsion and extension, each two words with a hyphen
Ends = tuple[str, str, str]
#: variables of a mesh that no closed form here covers
BEYOND = ("area_profile", "product_moment", "inertia_product", "lump_node")
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
    shear_coefficient: np.ndarray | None  #: along x, y, z


def columns(
    mesh: xr.Dataset, reference: str, families: Sequence[str], interfaces: Sequence[str] = ()
) -> dict[str, np.ndarray]:
    """Exact frequencies [Hz] by theory, each of shape (mode,); empty where no closed form applies.

    families: of the retained modes in ascending order, without gaps within a family.
    interfaces: frames that the reference condition holds, in its order.
    """
    rod, ends = uniform(mesh), _ends(mesh, reference, interfaces)
    if rod is None or ends is None:
        return {}
    tables = {"exact_euler_bernoulli": _table(rod, ends, families, rotary=False, shear=False)}
    if mesh.attrs["theory"] == "euler-bernoulli":
        return tables  # such a mesh says nothing of the rotary inertia
    tables["exact_rayleigh"] = _table(rod, ends, families, rotary=True, shear=False)
    if rod.shear_coefficient is not None:
        tables["exact_timoshenko"] = _table(rod, ends, families, rotary=True, shear=True)
    return tables


def _ends(mesh: xr.Dataset, reference: str, interfaces: Sequence[str]) -> Ends | None:
    """Ends of bending, torsion and extension; None for conditions that are not on the rod's two ends."""
    if reference in ("free-free", "fixed-fixed"):
        return (reference,) * 3
    last = mesh.sizes["node"] - 1
    held = [int(mesh["frame_node"].sel(frame=name)) for name in interfaces]
    if reference == "cantilever" and held and held[0] in (0, last):
        return ("fixed-free",) * 3
    # the first pin holds the axial motion and the twist too
    if reference == "pinned-pinned" and sorted(held[:2]) == [0, last]:
        return "pinned-pinned", "fixed-free", "fixed-free"
    return None


def uniform(mesh: xr.Dataset) -> Uniform | None:
    """The rod's constants; None when they change along it, it carries masses, or its planes of bending are coupled."""
    columns = [mesh[name].values for name in (*CONSTANTS, "second_moment", "inertia_moment")]
    varies = any(np.ptp(values, axis=0).any() for values in columns)
    if varies or any(name in mesh for name in BEYOND):
        return None
    x = mesh["abscissa"].values
    area, E, G, rho = (float(mesh[name].values[0]) for name in CONSTANTS)
    second, rotary = mesh["second_moment"].values[0], mesh["inertia_moment"].values[0]
    kappa = mesh["shear_coefficient"].values[0] if "shear_coefficient" in mesh else None
    return Uniform(float(np.ptp(x)), area, E, G, rho, second, rotary, kappa)


def _table(rod: Uniform, ends: Ends, families: Sequence[str], *, rotary: bool, shear: bool) -> np.ndarray:
    result = np.empty(len(families))
    for name in set(families):
        places = [k for k, family in enumerate(families) if family == name]
        result[places] = _series(rod, ends, name, len(places), rotary=rotary, shear=shear)
    return result


def _series(rod: Uniform, ends: Ends, family: str, count: int, *, rotary: bool, shear: bool) -> np.ndarray:
    bending, torsion, extension = ends
    if family == "axial":
        return frequencies.rod(math.sqrt(rod.youngs_modulus / rod.density), rod.length, extension, count)
    if family == "torsion":
        speed = math.sqrt(rod.shear_modulus * rod.second[0] / (rod.density * rod.rotary[0]))
        return frequencies.rod(speed, rod.length, torsion, count)
    # deflection in y bends about z, and the other way round
    axis, across = (2, 1) if family == "bending_y" else (1, 2)
    kappa = float(rod.shear_coefficient[across]) if shear and rod.shear_coefficient is not None else math.inf
    span = Span(
        length=rod.length,
        bending=rod.youngs_modulus * float(rod.second[axis]),
        line_mass=rod.density * rod.area,
        rotary=rod.density * float(rod.rotary[axis]) if rotary else 0.0,
        shear=kappa * rod.shear_modulus * rod.area,
    )
    return frequencies.bending(span, bending, count)
