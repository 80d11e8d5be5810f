"""Table 4: natural frequencies of the rod under fixed-fixed reference conditions."""

from __future__ import annotations

import xarray as xr

from flexclear.papers.wang_wang_2019.plotting.frequency_table import table
from flexclear.papers.wang_wang_2019.published import TABLE4_ANSYS, TABLE4_NORMAL_MODE
from flexclear.pipeline.post.plotting.table import files

NEEDS = (
    "sps4/frequencies/fixed_square:modes/rod",
    "sps4/frequencies/fixed_circle:modes/rod",
    "sps4/frequencies/fixed_square:fine-modes/rod",
    "sps4/frequencies/fixed_circle:fine-modes/rod",
)


def make(data: dict[str, xr.Dataset]) -> dict[str, bytes]:
    """table04.csv and table04.md."""
    title = "Table 4: frequencies of the rod, fixed-fixed reference conditions"
    return files("table04", table(title, [data[n] for n in NEEDS], TABLE4_ANSYS, TABLE4_NORMAL_MODE, rigid=0))
