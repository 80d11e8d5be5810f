"""Figure 13: flexible rod and clearance (FAR-CSJ), CSJ and ideal models, six panels."""

from __future__ import annotations

import xarray as xr

from flexclear.papers.wang_wang_2019.models import CSJ, FAR_CSJ, IDEAL, JOINT, PLATFORM, motion, references
from flexclear.papers.wang_wang_2019.plotting.panels import six_panels
from flexclear.pipeline.post.plotting import style

NEEDS = references((IDEAL, CSJ, *FAR_CSJ), "run", "post")


def make(data: dict[str, xr.Dataset]) -> dict[str, bytes]:
    """fig13.png and fig13.svg; single runs are pale beyond their horizon, ensembles drawn as bands."""
    models = (CSJ, *FAR_CSJ)
    with style.style():
        motions, posts = [motion(m, data) for m in models], [data[f"{m.scene}:post"] for m in models]
        clearance = 1e3 * float(posts[0].clearance.sel(contact=JOINT))
        figure, labelled = six_panels(motion(IDEAL, data), motions, posts, impacts=True, clearance=clearance)
        style.heading(
            figure,
            "Figure 13: the mode set decides how far a flexible rod softens the impacts",
            f"largest acceleration in m/s², of ensembles the mean: {_peaks(posts)}. "
            "Beyond its horizon a single run is pale, bands are the middle 90 % of "
            "the ensembles (the added set's run is drawn as the band that it fills); "
            "dots: largest force of each impact",
        )
        style.shared_legend(figure, labelled, 3)
        return style.files("fig13", figure)


def _peaks(posts: list[xr.Dataset]) -> str:
    """Largest vertical acceleration of the platform per model [m/s^2]."""
    rigid, *flexible = posts
    texts = [f"{float(rigid.peak_acceleration.sel(body=PLATFORM, axis='z')):.0f} (CSJ)"]
    for model, post in zip(FAR_CSJ, flexible, strict=True):
        mean = float(post.peak_acceleration_mean.sel(ensemble_body=PLATFORM, axis="z"))
        texts.append(f"{mean:.0f} ({model.label.removeprefix('FAR-CSJ, ').split(' ')[0]})")
    return ", ".join(texts)
