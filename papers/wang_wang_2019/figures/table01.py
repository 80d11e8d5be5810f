"""Table 1: physical parameters of the parts, the paper's and those of the scenes."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr

from flexclear.papers.wang_wang_2019.models import IDEAL
from flexclear.papers.wang_wang_2019.published import TABLE1
from flexclear.pipeline.post.plotting.table import Table, files
from flexclear.pipeline.post.single_run.series import parameters

NEEDS = ("sps4/ideal:run",)

#: members of the table and the bodies that they are here; the others belong to the ground
BODIES = {
    "cylinder": "cylinder1",
    "actuated rod": "rod1",
    "constrained rod": "central_rod",
    "socket on moving platform": "socket_A1",
    "ball": "ball_A1",
    "moving platform": "platform",
}
ABSENT = "–"


def make(data: dict[str, xr.Dataset]) -> dict[str, bytes]:
    """table01.csv and table01.md."""
    bodies = parameters(data[f"{IDEAL.scene}:run"])["body"]
    rows = tuple(_row(member, bodies) for member in TABLE1)
    heads = ("member", "body here", "mass, paper (kg)", "mass, ours (kg)", "length, paper (mm)",
             "inertia, paper (kg mm²)", "inertia, ours (kg mm²)")  # fmt: skip
    platform = bodies["platform"]
    side = 1e3 * np.sqrt(6.0 * np.array(platform["inertia"]).max() / platform["mass"])
    notes = (
        "Inertia about the centre of mass: Ixx, Iyy, Izz. The paper's first column is the normal of plate and socket, "
        "which is z here. Members without a body belong to the ground.",
        f"The platform's moments are those of a square plate of side {side:.1f} mm and negligible thickness: the "
        "printed length, 100 mm, is half of its side; 200 mm of the base may be half of one, too.",
    )
    return files("table01", Table("Table 1: physical parameters", heads, rows, notes))


def _row(member: str, bodies: dict[str, Any]) -> tuple[str, ...]:
    printed, name = TABLE1[member], BODIES.get(member)
    ours = bodies[name] if name else None
    mass = f"{ours['mass']:.2f}" if ours else ABSENT
    return (
        member,
        name or ABSENT,
        f"{printed.mass:.2f}" if printed.mass is not None else ABSENT,
        mass,
        f"{printed.length:g}" if printed.length is not None else ABSENT,
        _moments(printed.inertia),
        _moments(1e6 * np.diag(np.array(ours["inertia"]))) if ours else ABSENT,
    )


def _moments(values: Any) -> str:
    return ABSENT if values is None else ", ".join(f"{v:.3f}" for v in values)
