"""The table of impacts of one run, from its located contact events."""

from __future__ import annotations

import numpy as np
import xarray as xr

from pipeline.core.quantities import IMPACT


def impacts(run: xr.Dataset) -> dict[str, tuple[tuple[str, ...], np.ndarray]]:
    """Variables ``impact_*`` of the post artifact; empty for a run without contacts.

    Listed are the closings with an approach speed above IMPACT whose contact ended inside the
    run; the separation speed is that of the next opening of the same contact.  `impact_count` also
    counts a last one that has not ended.
    """
    if "event_time" not in run or "contact" not in run.sizes:
        return {}
    contact = run.event_contact.values.astype(int)
    speed = run.event_approach_speed.values
    closings, openings = of_kind(run, "closing"), of_kind(run, "opening")
    strong = np.flatnonzero(closings & (speed > IMPACT))
    opens = np.array([_next_opening(int(i), contact, openings) for i in strong], dtype=int)
    kept, opens = strong[opens >= 0], opens[opens >= 0]
    peak = run.event_peak_force.values[kept]
    return {
        "impact_time": (("impact",), run.event_time.values[kept]),
        "impact_contact": (("impact",), contact[kept]),
        "impact_approach_speed": (("impact",), speed[kept]),
        "impact_separation_speed": (("impact",), speed[opens]),
        "impact_peak_force": (("impact",), peak),
        "impact_duration": (("impact",), run.event_time.values[opens] - run.event_time.values[kept]),
        "impact_count": (("contact",), np.bincount(contact[strong], minlength=run.sizes["contact"])),
    }


def of_kind(run: xr.Dataset, name: str) -> np.ndarray:
    """True for the events of a kind, e.g. those that close a gap, shape (event,)."""
    kind = run.event_kind.values
    if kind.dtype.kind in "US" or kind.dtype == object:
        return np.array([str(k) == name for k in kind], dtype=bool)
    meanings = str(run.event_kind.attrs.get("flag_meanings", "opening closing")).split()
    values = np.atleast_1d(run.event_kind.attrs.get("flag_values", np.arange(len(meanings))))
    return np.asarray(kind == values[meanings.index(name)])


def _next_opening(i: int, contact: np.ndarray, openings: np.ndarray) -> int:
    """Index of the first opening of the same contact after event i, or -1."""
    later = np.flatnonzero((contact[i + 1 :] == contact[i]) & openings[i + 1 :])
    return int(i + 1 + later[0]) if later.size else -1
