"""Artifacts -> the files of one figure or table of the paper."""

from __future__ import annotations

import json
from collections.abc import Mapping
from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import xarray as xr

    from flexclear.pipeline.core.system.progress import Progress

FIGURES = "flexclear.papers.wang_wang_2019.figures"


def run(params: Mapping[str, Any], inputs: Mapping[str, xr.Dataset], progress: Progress) -> dict[str, Any]:
    """Files of one figure or table by name; inputs are the artifacts by reference."""
    figure = import_module(f"{FIGURES}.{params['figure']}")
    return dict(figure.make(dict(inputs)))


def index(params: Mapping[str, Any], inputs: Mapping[str, xr.Dataset], progress: Progress) -> dict[str, Any]:
    """``index.json``: for each name what it needs.

    An artifact of its own, because asking the modules themselves takes the import of matplotlib.
    """
    entries = {}
    for name in params["names"]:
        figure = import_module(f"{FIGURES}.{name}")
        entries[name] = {"needs": list(figure.NEEDS)}
    return {"index.json": json.dumps(entries, indent=1).encode()}
