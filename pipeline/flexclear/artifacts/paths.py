"""Folders of results."""

from __future__ import annotations

import os
from pathlib import Path

from flexclear.system.version import version

#: folder of the packages `pipeline` and `stages`: `flexclear`, or a checkout when they are imported from there directly
PACKAGES = Path(__file__).absolute().parents[3]
#: folder that holds the package `flexclear`; sources are read below it
TREE = PACKAGES if (PACKAGES / "flexclear" / "__init__.py").is_file() else PACKAGES.parent
#: folder with the scenes and meshes of the project, which are installed with it
DATA = PACKAGES


def results_root() -> Path:
    """Return the folder of all results: FLEXCLEAR_RESULTS; else ``results`` of the source checkout when the current
    folder is inside of it; else ``results`` of the current folder."""
    named = os.environ.get("FLEXCLEAR_RESULTS")
    if named:
        return Path(named).resolve()
    here = Path.cwd()
    inside = (TREE / "pyproject.toml").is_file() and here.resolve().is_relative_to(TREE.resolve())
    return (TREE if inside else here) / "results"


def kernel_root() -> Path:
    """Return the folder of compiled kernels: FLEXCLEAR_KERNELS, or one per user and version in the user's cache.

    Kernels are not below the results, which people send to each other: loading a kernel executes code. A kernel's name
    covers all that the kernel depends on, so that all projects of a user can share one folder.
    """
    named = os.environ.get("FLEXCLEAR_KERNELS")
    return Path(named).resolve() if named else kernel_home() / version().replace(" ", "_") / "kernels"


def kernel_home() -> Path:
    """Return the user's cache folder of this program, which has one folder per version in use."""
    from platformdirs import user_cache_path  # here, since few commands need it

    return user_cache_path("flexclear", appauthor=False)
