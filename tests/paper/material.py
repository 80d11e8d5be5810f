"""Made-up artifacts for all figures and tables, under the references that these ask for."""

from functools import cache

import numpy as np
import xarray as xr

from flexclear.post.single_run.series import derive
from flexclear.structure.modes.solution import solve
from tests.analytic.beam_models import build
from tests.paper import synthetic

#: deviations of the made-up runs from the made-up ideal one: wobble of z [m]
WOBBLE = {"far_free": 1e-7, "far_fixed": 2e-7, "far_cb": 3e-7}
#: what a tighter tolerance changes in the made-up velocities [m/s], and a finer mesh in the frequencies [Hz]
TIGHTENING, REFINING = 3e-6, 0.25
FIXED_CIRCLE = (1577.003, 1577.003, 4316.202, 4316.202, 6553.024, 8370.848, 8370.848)
FIXED_SQUARE = (1576.805, 1576.805, 4314.206, 4314.206, 6403.648, 8362.726, 8362.726)
FREE_CIRCLE = (1564.488, 1564.488, 4259.460, 4259.460, 6553.024, 8221.007, 8221.007)
FREE_SQUARE = (1563.712, 1563.712, 4254.919, 4254.919, 6403.648, 8206.455, 8206.455)


@cache
def everything() -> dict[str, xr.Dataset]:
    """Every artifact that a figure or table needs, by reference."""
    data = {"sps4:timing": synthetic.timing()}
    _put(data, synthetic.run("sps4/ideal"))
    _put(data, synthetic.run("sps4/csj", clearance=True, noise=1e-4))
    _put(data, synthetic.run("sps4/variants/first"))
    _put(data, synthetic.run("sps4/variants/first_csj", clearance=True, noise=2e-5))
    for name, noise in WOBBLE.items():
        _put(data, synthetic.run(f"sps4/{name}", noise=noise, modes=7))
    for k, name in enumerate(("free", "fixed", "cb")):
        run = synthetic.run(f"sps4/far_csj_{name}", clearance=True, noise=1e-4 * (1 + 0.2 * k), modes=7)
        _put(data, run, synthetic.ensemble(run))
    sections = {
        "fixed_square": FIXED_SQUARE,
        "fixed_circle": FIXED_CIRCLE,
        "free_square": FREE_SQUARE,
        "free_circle": FREE_CIRCLE,
    }
    for name, frequency in sections.items():
        made = solve(build(), "fixed-fixed" if "fixed" in name else "free-free", 7)
        for kind, finer in (("modes", 0.0), ("fine-modes", REFINING)):
            data[f"sps4/frequencies/{name}:{kind}/rod"] = made.assign(frequency=("mode", np.array(frequency) - finer))
        data[f"sps4/frequencies/{name}:bundle/rod"] = synthetic.bundle(7, frequency=np.array(frequency))
    data["sps4/far_cb:mesh/rod1"] = build()
    return data


def _put(data: dict[str, xr.Dataset], run: xr.Dataset, ensemble: xr.Dataset | None = None) -> None:
    scene = run.attrs["scene"]
    data[f"{scene}:run"], data[f"{scene}:post"] = run, derive(run, ensemble)
    data[f"{scene}:tight"] = run.assign(velocity=run.velocity + TIGHTENING * (run.time > 0.0))
    if ensemble is not None:
        data[f"{scene}:ensemble"] = ensemble
