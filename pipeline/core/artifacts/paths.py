"""Folders of results."""

from __future__ import annotations

import os
from pathlib import Path

from flexclear.pipeline.core.system.version import version

#: folder that holds the packages `pipeline` and `stages`: `flexclear`, or, where links are not followed, a checkout
PACKAGES = Path(__file__).absolute().parents[3]
#: folder that holds the package `flexclear`; sources are read below it
TREE = PACKAGES if (PACKAGES / "flexclear" / "__init__.py").is_file() else PACKAGES.parent
#: folder with the scenes and meshes of the project, which are installed with it
DATA = PACKAGES


def results_root() -> Path:
    """Folder of all results: FLEXCLEAR_RESULTS; else ``results`` of the source checkout, where the command is called
    from inside of one's own, else of the current folder."""
    named = os.environ.get("FLEXCLEAR_RESULTS")
    if named:
        return Path(named).resolve()
    here = Path.cwd()
    inside = (TREE / "pyproject.toml").is_file() and here.resolve().is_relative_to(TREE.resolve())
    return (TREE if inside else here) / "results"


def kernel_root() -> Path:
    """The folder of compiled kernels: FLEXCLEAR_KERNELS, or one per user and version in the user's cache folder.

    Not below the results, which people send to each other: to load a kernel is to run code. The names of kernels say
    all that they depend on, so that every project of a user may share one folder.
    """
    named = os.environ.get("FLEXCLEAR_KERNELS")
    return Path(named).resolve() if named else kernel_home() / version().replace(" ", "_") / "kernels"


def kernel_home() -> Path:
    """The user's cache folder of this program, with a folder for each version that has been used."""
    from platformdirs import user_cache_path  # here, since few commands ask for it

    return user_cache_path("flexclear", appauthor=False)
