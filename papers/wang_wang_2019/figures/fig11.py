"""Figure 11: flexible actuated rod (FAR) against the ideal model, six panels."""

from __future__ import annotations

import numpy as np
import xarray as xr

from flexclear.papers.wang_wang_2019.models import FAR, FAR_CB, FAR_FIXED, FAR_FREE, IDEAL, motion, references
from flexclear.papers.wang_wang_2019.plotting.panels import DISPLACEMENT, deviation, six_panels
from flexclear.pipeline.post.plotting import style

NEEDS = references((IDEAL, *FAR), "run", "post")


def make(data: dict[str, xr.Dataset]) -> dict[str, bytes]:
    """fig11.png and fig11.svg."""
    with style.style():
        ideal, others = motion(IDEAL, data), [motion(model, data) for model in FAR]
        figure, labelled = six_panels(ideal, others, impacts=False)
        moved = {m.model.scene: 1e3 * np.abs(deviation(DISPLACEMENT, m, ideal)[1]).max() for m in others}
        style.heading(
            figure,
            f"Figure 11: a flexible rod moves the platform by {moved[FAR_CB.scene]:.2g} µm at most; free-free modes "
            f"find {moved[FAR_FREE.scene]:.1g} µm of it, fixed-fixed modes {_little(moved[FAR_FIXED.scene])}",
            "slim panels (added): difference from the ideal model; "
            "the added mode set is drawn as the band that it fills",
        )
        style.shared_legend(figure, labelled, 4)
        return style.files("fig11", figure)


def _little(micrometres: float) -> str:
    """A size, or that there is none next to rounding."""
    return f"{micrometres:.1g} µm" if micrometres > 1e-6 else "nothing"
