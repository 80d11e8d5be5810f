"""Where results are kept."""

from __future__ import annotations

import os
from pathlib import Path

CHECKOUT = Path(__file__).resolve().parents[3]


def results_root() -> Path:
    """Folder of all results: FLEXCLEAR_RESULTS; else ``results`` of the source checkout, wherever the
    command is called from; else, where the package was installed without one, of the current folder."""
    named = os.environ.get("FLEXCLEAR_RESULTS")
    if named:
        return Path(named).resolve()
    return (CHECKOUT if (CHECKOUT / "pyproject.toml").is_file() else Path.cwd()) / "results"


def kernel_root() -> Path:
    """The folder of compiled kernels: FLEXCLEAR_KERNELS, or ``cache/kernels`` of the results.

    Their names say all that they depend on, so that several result folders may share one.
    """
    return Path(os.environ.get("FLEXCLEAR_KERNELS") or results_root() / "cache" / "kernels").resolve()
