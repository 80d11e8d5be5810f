"""Next to stage 5: sections of a periodic motion -> what motion it is, and a figure."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import xarray as xr

    from flexclear.pipeline.core.system.progress import Progress


def run(params: Mapping[str, Any], inputs: Mapping[str, xr.Dataset], progress: Progress) -> dict[str, Any]:
    """Verdict (schema VERDICT) and its figure; the input is ``sections``, and `params` names their scene."""
    from flexclear.pipeline.post.sections import section_figure
    from flexclear.pipeline.post.sections.verdict import derive

    sections = inputs["sections"].assign_attrs(scene=params["scene"])
    judged = derive(sections)
    return {"nc": judged, **section_figure.make(sections, judged)}
