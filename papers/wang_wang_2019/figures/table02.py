"""Table 2: material of the flexible actuated rod, the paper's and that of its mesh."""

from __future__ import annotations

import numpy as np
import xarray as xr

from flexclear.papers.wang_wang_2019.published import TABLE2
from flexclear.pipeline.post.plotting.table import Table, files

NEEDS = ("sps4/far_cb:mesh/rod1",)

WORDS = {
    "density": ("density (kg/m³)", "{:.0f}"),
    "poisson": ("Poisson's ratio", "{:.2f}"),
    "youngs_modulus": ("Young's modulus (Pa)", "{:.3g}"),
    "radius": ("radius (m)", "{:.3f}"),
    "length": ("length (m)", "{:.3f}"),
}


def make(data: dict[str, xr.Dataset]) -> dict[str, bytes]:
    """table02.csv and table02.md: read off the mesh that the modes are made of."""
    mesh = data[NEEDS[0]]
    young, shear = (float(np.ravel(mesh[name].values)[0]) for name in ("youngs_modulus", "shear_modulus"))
    ours = {
        "density": float(np.ravel(mesh.density.values)[0]),
        "poisson": young / (2.0 * shear) - 1.0,
        "youngs_modulus": young,
        "radius": float(np.sqrt(np.ravel(mesh.area.values)[0] / np.pi)),
        "length": float(np.ptp(mesh.abscissa.values)),
    }
    rows = tuple((words, form.format(TABLE2[name]), form.format(ours[name])) for name, (words, form) in WORDS.items())
    notes = (
        f"{mesh.sizes['cell']} beam elements, as in the paper. The mass that follows is "
        f"{ours['density'] * np.pi * ours['radius'] ** 2 * ours['length']:.4f} kg (Table 1: 0.21 kg).",
    )
    return files("table02", Table("Table 2: the flexible rod", ("parameter", "paper", "ours"), rows, notes))
