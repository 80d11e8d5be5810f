"""Table 5: natural frequencies of the rod under free-free reference conditions."""

from __future__ import annotations

import xarray as xr

from flexclear.papers.wang_wang_2019.plotting.frequency_table import table
from flexclear.papers.wang_wang_2019.published import RIGID_MODES, TABLE5_ANSYS, TABLE5_NORMAL_MODE
from flexclear.pipeline.post.plotting.table import files

NEEDS = (
    "sps4/frequencies/free_square:modes/rod",
    "sps4/frequencies/free_circle:modes/rod",
    "sps4/frequencies/free_square:fine-modes/rod",
    "sps4/frequencies/free_circle:fine-modes/rod",
)


def make(data: dict[str, xr.Dataset]) -> dict[str, bytes]:
    """table05.csv and table05.md."""
    title = "Table 5: frequencies of the rod, free-free reference conditions"
    return files("table05", table(title, [data[n] for n in NEEDS], TABLE5_ANSYS, TABLE5_NORMAL_MODE, rigid=RIGID_MODES))
