"""Recorded forces and integral parts of controllers, for the run dataset."""

from __future__ import annotations

from flexclear.artifacts.coordinates import motion
from flexclear.dynamics import memory as m
from flexclear.dynamics.equations.observation import Observed, Series
from flexclear.dynamics.loads.sampled_pid import INTEGRAL
from flexclear.dynamics.model.model import Model
from flexclear.dynamics.record.loads import along_coordinates, turning_loads
from flexclear.scene.loads import Pid, SampledPid


def controller_series(model: Model, seen: Observed) -> Series:
    """Return each controller's force along its coordinate, and its integral part [N or N m]."""
    rows, first = model.rows_of(Pid, SampledPid), model.ny - model.arrays.size(m.N_INTERNAL)
    places = [
        first + int(row["internal0"]) + (INTEGRAL if isinstance(model.scene.load[name], SampledPid) else 0)
        for name, row in rows.items()
    ]
    dims = ("time", "controller")
    forces = along_coordinates(model, seen, list(rows))
    return {"controller_force": (dims, forces), "controller_integral": (dims, seen.state[:, places])}, {
        "controller": list(rows),
        "controller_motion": ("controller", [motion(turns) for turns in turning_loads(model, list(rows))]),
    }
