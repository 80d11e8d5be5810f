"""Table 6: parameters of the simulation, the paper's and those of the scenes."""

from __future__ import annotations

import xarray as xr

from flexclear.papers.wang_wang_2019.models import CSJ, JOINT
from flexclear.papers.wang_wang_2019.published import TABLE6
from flexclear.pipeline.post.plotting.table import Table, files
from flexclear.pipeline.post.single_run.series import parameters

NEEDS = ("sps4/csj:run",)


def make(data: dict[str, xr.Dataset]) -> dict[str, bytes]:
    """table06.csv and table06.md."""
    run = data[f"{CSJ.scene}:run"]
    given = parameters(run)
    joint, solver = given["joint"][JOINT], given.get("solver", {})
    friction = joint["friction"]
    steps = run.attrs.get("steps", 0)
    chosen = f"chosen by the tolerance: {steps} steps in the CSJ run" if steps else "chosen by the tolerance"
    rows = (
        ("time span (s)", f"{TABLE6['time_span']:g}", f"{float(run.time[-1] - run.time[0]):g}"),
        ("time step (s)", f"{TABLE6['time_step']:g}", chosen),
        ("integration tolerance", f"{TABLE6['tolerance']:g} mm", f"{solver.get('rtol', 1e-10):g}, relative"),
        ("power exponent", f"{TABLE6['exponent']:g}", f"{joint['normal'].get('exponent', 1.5):g}"),
        ("static friction coefficient", f"{TABLE6['static']:g}", f"{friction['static']:g}"),
        ("slip friction coefficient", f"{TABLE6['dynamic']:g}", f"{friction['dynamic']:g}"),
        ("critical velocity of static friction (mm/s)", f"{TABLE6['v_static']:g}", f"{1e3 * friction['v_static']:g}"),
        (
            "critical velocity of dynamic friction (mm/s)",
            f"{TABLE6['v_dynamic']:g}",
            f"{1e3 * friction['v_dynamic']:g}",
        ),
    )
    notes = (
        "The step is printed as '0.0 0 0 01s', most likely 1e-5 s. Runs at that step and at that tolerance stand in "
        "Table 10.",
    )
    return files("table06", Table("Table 6: parameters of the simulation", ("parameter", "paper", "ours"), rows, notes))
