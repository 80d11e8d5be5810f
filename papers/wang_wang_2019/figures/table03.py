"""Table 3: the spherical joint with clearance, the paper's and that of the scenes."""

from __future__ import annotations

import numpy as np
import xarray as xr

from flexclear.papers.wang_wang_2019.models import CSJ, JOINT
from flexclear.papers.wang_wang_2019.published import TABLE3
from flexclear.pipeline.post.plotting.table import Table, files
from flexclear.pipeline.post.single_run.series import parameters

NEEDS = ("sps4/csj:run",)


def make(data: dict[str, xr.Dataset]) -> dict[str, bytes]:
    """table03.csv and table03.md."""
    joint = parameters(data[f"{CSJ.scene}:run"])["joint"][JOINT]
    socket, ball = joint["socket_material"], joint["ball_material"]
    rows = (
        (
            "socket radius (mm)",
            f"{1e3 * TABLE3['socket_radius']:g}",
            f"{1e3 * (joint['ball_radius'] + joint['clearance']):g}",
        ),
        ("ball radius (mm)", f"{1e3 * TABLE3['ball_radius']:g}", f"{1e3 * joint['ball_radius']:g}"),
        ("clearance (mm)", "0.5, as follows", f"{1e3 * joint['clearance']:g}"),
        ("Poisson's ratio, socket and ball", f"{TABLE3['poisson']:g}", f"{socket['poisson']:g}, {ball['poisson']:g}"),
        (
            "Young's modulus (GPa), socket and ball",
            f"{1e-9 * TABLE3['youngs_modulus']:g}",
            f"{1e-9 * socket['youngs_modulus']:g}, {1e-9 * ball['youngs_modulus']:g}",
        ),
        ("density (kg/m³)", f"{TABLE3['density']:g}", "not used: masses are those of Table 1"),
        ("coefficient of restitution", "not printed", f"{joint['normal']['restitution']:g}, assumed"),
    )
    notes = (_stiffness(joint),)
    return files("table03", Table("Table 3: the joint with clearance", ("parameter", "paper", "ours"), rows, notes))


def _stiffness(joint: dict) -> str:
    """K of eq. (26), by its formula."""
    sigma = [
        (1.0 - m["poisson"] ** 2) / (np.pi * m["youngs_modulus"])
        for m in (joint["socket_material"], joint["ball_material"])
    ]
    R, r = joint["ball_radius"] + joint["clearance"], joint["ball_radius"]
    K = 4.0 / (3.0 * np.pi * sum(sigma)) * np.sqrt(R * r / (R - r))
    return f"Stiffness by eq. (26): K = {K:.4g} N/m^1.5."
