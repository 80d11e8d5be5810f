"""All that the report shows -> its page, and the same as Markdown for the documentation."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from flexclear.pipeline.core.workflow.fingerprint import TREE

if TYPE_CHECKING:
    import xarray as xr

    from flexclear.pipeline.core.system.progress import Progress


def run(params: Mapping[str, Any], inputs: Mapping[str, xr.Dataset], progress: Progress) -> dict[str, Any]:
    """``index.html`` and ``paper.md``, out of the results folder.

    params: the folder, the run of each scene below it, where its values come from, the scene whose film and pictures
    are shown, and the digest of everything that is shown, so that the page is written again when any of it changes.
    """
    from flexclear.papers.wang_wang_2019 import report

    results = Path(params["results"])
    by_scene = report.run_attributes({scene: results / path for scene, path in params["runs"].items()})
    attributes = {scene: {**attributes_of, **params["origins"][scene]} for scene, attributes_of in by_scene.items()}
    content = report.collect(results, attributes, params["rendered"], TREE)
    return {"index.html": report.page(content), "paper.md": report.paper_markdown(content).encode()}
