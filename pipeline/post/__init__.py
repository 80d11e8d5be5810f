"""From datasets to maps, tables, pictures and the report. Reads artifacts, imports no other tower."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import xarray as xr

    from flexclear.pipeline.core.artifacts.labelled import LabelledArrays

__all__ = ["derive", "derived"]


def derive(run: xr.Dataset, ensemble: xr.Dataset | None = None) -> xr.Dataset:
    """Series and tables of a run, and of its ensemble (`pipeline.post.single_run.series.derive`).

    Imported when it is called: a command that only asks what is fresh needs no xarray.
    """
    from flexclear.pipeline.post.single_run.series import derive as series

    return series(run, ensemble)


def derived(run: LabelledArrays, ensemble: LabelledArrays | None = None) -> LabelledArrays:
    """The same of arrays, without xarray."""
    from flexclear.pipeline.post.single_run.series import derived as series

    return series(run, ensemble)
