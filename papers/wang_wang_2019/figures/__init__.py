"""The paper's figures and tables. To add one: a module here with NEEDS and make, and a line below.

``NEEDS``: references of the artifacts it reads, ``<scene>:<artifact>[/<body>]``.
They are listed in an index (`papers.wang_wang_2019.figure_stage`), since asking the modules takes the import of the
plotting libraries. ``make(data)``: artifacts by reference -> file contents by file name.
"""

from __future__ import annotations

from importlib import import_module

from flexclear.pipeline.core.scene.citations import docstring
from flexclear.pipeline.core.scene.registry import lookup, module_of

KIND = "figure or table"
NAMES = {
    "fig01": "fig01:make",
    "fig03": "fig03:make",
    "fig04": "fig04:make",
    "fig05": "fig05:make",
    "fig06": "fig06:make",
    "fig08": "fig08:make",
    "fig09": "fig09:make",
    "fig10": "fig10:make",
    "fig11": "fig11:make",
    "fig12": "fig12:make",
    "fig13": "fig13:make",
    "fig14": "fig14:make",
    "fig15": "fig15:make",
    "fig16": "fig16:make",
    "fig17": "fig17:make",
    "table01": "table01:make",
    "table02": "table02:make",
    "table03": "table03:make",
    "table04": "table04:make",
    "table05": "table05:make",
    "table06": "table06:make",
    "table07": "table07:make",
    "table08": "table08:make",
    "table09": "table09:make",
    "table10": "table10:make",
    "table_verdicts": "table_verdicts:make",
}


def needs(name: str) -> tuple[str, ...]:
    """References of the artifacts that `name` cannot be made without."""
    return tuple(import_module(_module(name)).NEEDS)


def title(name: str) -> str:
    """First line of the module's docstring: what the figure or table shows."""
    return (docstring(import_module(_module(name))) or name).strip().splitlines()[0].rstrip(".")


def _module(name: str) -> str:
    lookup(__name__, name, where="figures")
    return module_of(__name__, name)
