"""The paper's figures and tables. To add one: a `Figure` in a module here, and a line below."""

from __future__ import annotations

import json
from collections.abc import Mapping
from importlib import import_module
from typing import TYPE_CHECKING, Any

from papers.comparison import Figure

if TYPE_CHECKING:
    import xarray as xr

    from flexclear.applications import Progress

NAMES = {
    "fig01": "structure:mechanism",
    "fig03": "structure:FIG03",
    "fig04": "structure:FIG04",
    "fig05": "joint:kinematics",
    "fig06": "joint:friction_law",
    "fig08": "panels:tilt",
    "fig09": "panels:response",
    "fig10": "structure:steps",
    "fig11": "panels:FIG11",
    "fig12": "panels:FIG12",
    "fig13": "panels:FIG13",
    "fig14": "phase:FIG14",
    "fig15": "phase:FIG15",
    "fig16": "phase:FIG16",
    "fig17": "joint:trajectory",
    "table01": "given:parts",
    "table02": "given:material",
    "table03": "given:joint_with_clearance",
    "table04": "given:TABLE04",
    "table05": "given:TABLE05",
    "table06": "given:simulation",
    "table07": "errors:of_rods",
    "table08": "errors:of_clearance",
    "table09": "errors:of_all",
    "table10": "table10:costs",
    "table_verdicts": "table_verdicts:verdicts",
}


def figure(name: str) -> Figure:
    """Return the figure or table of a name; imports its module now, and with it the plotting libraries."""
    module, _, attribute = NAMES[name].partition(":")
    found: Figure = getattr(import_module(f"{__name__}.{module}"), attribute)
    return found


def draw(params: Mapping[str, Any], inputs: Mapping[str, xr.Dataset], progress: Progress) -> dict[str, Any]:
    """Stage: draw ``<name>.png`` and ``.svg`` of a figure, or ``.csv`` and ``.md`` of a table; inputs by reference."""
    from flexclear.publishing import files, style

    with style.set_style():
        return dict(files(params["figure"], figure(params["figure"]).make(dict(inputs))))


def index(params: Mapping[str, Any], inputs: Mapping[str, xr.Dataset], progress: Progress) -> dict[str, Any]:
    """Stage: write ``index.json``, for each name the artifacts that it needs and the files that it opens.

    The index is an artifact, because the modules themselves import matplotlib, which takes time.
    """
    listed = {name: figure(name) for name in params["names"]}
    entries = {name: {"needs": one.needs, "files": one.files} for name, one in listed.items()}
    return {"index.json": json.dumps(entries, indent=1).encode()}
