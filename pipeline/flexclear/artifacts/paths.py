"""Folders of sources, of shipped data and of results."""

from __future__ import annotations

import os
from pathlib import Path

from flexclear.system.version import version

#: folder of the package `flexclear`, and the folder that holds it: `pipeline` of a checkout, or where it is installed
PACKAGE = Path(__file__).absolute().parents[1]
TREE = PACKAGE.parent
#: whether this is a checkout; an installed package has its data inside and no project around it
_CHECKOUT = (TREE.parent / "pyproject.toml").is_file()
#: folder of the project: of a checkout, else the one that holds the package
PROJECT = TREE.parent if _CHECKOUT else TREE
#: folder with the `scenes` and `meshes` of the project
DATA = PROJECT if _CHECKOUT else PACKAGE


def results_root() -> Path:
    """Return the folder of all results: FLEXCLEAR_RESULTS; else ``results`` of the source checkout when the current
    folder is inside of it; else ``results`` of the current folder."""
    named = os.environ.get("FLEXCLEAR_RESULTS")
    if named:
        return Path(named).resolve()
    here = Path.cwd()
    inside = _CHECKOUT and here.resolve().is_relative_to(PROJECT.resolve())
    return (PROJECT if inside else here) / "results"


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
