"""The table of impacts of one run, from its located contact events."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from flexclear.pipeline.core.artifacts.quantities import IMPACT

if TYPE_CHECKING:
    import xarray as xr

    from flexclear.pipeline.core.artifacts.labelled import LabelledArrays


def impacts(run: xr.Dataset | LabelledArrays) -> dict[str, tuple[tuple[str, ...], np.ndarray]]:
    """Variables ``impact_*`` of the post artifact; empty for a run without contacts.

    Listed and counted are the closings with an approach speed above IMPACT; the separation speed is
    that of the next opening of the same contact.  Of one that the run's end cuts short, separation
    speed, duration, impulse and losses are NaN.
    """
    if "event_time" not in run or "contact" not in run.sizes:
        return {}
    contact, names = run["event_contact"].values, [str(name) for name in run["contact"].values]
    speed = run["event_approach_speed"].values
    closings, openings = of_kind(run, "closing"), of_kind(run, "opening")
    strong = np.flatnonzero(closings & (speed > IMPACT))
    opens = np.array([_next_opening(int(i), contact, openings) for i in strong], dtype=int)
    ended, begun = opens >= 0, run["event_time"].values[strong]
    return {
        "impact_time": (("impact",), begun),
        "impact_contact": (("impact",), contact[strong]),
        "impact_approach_speed": (("impact",), speed[strong]),
        "impact_separation_speed": (("impact",), np.where(ended, speed[opens], np.nan)),
        "impact_peak_force": (("impact",), run["event_peak_force"].values[strong]),
        "impact_duration": (("impact",), np.where(ended, run["event_time"].values[opens] - begun, np.nan)),
        "impact_count": (
            ("contact",),
            np.array([np.count_nonzero(contact[strong] == name) for name in names], dtype=np.int64),
        ),
        **_books(run, contact[strong], begun, np.where(ended, run["event_time"].values[opens], np.nan)),
    }


#: what the run's ledger books of contacts, by the name that an impact's fraction of it has
BOOKS = {
    "impact_impulse": "contact_impulse",
    "impact_damping_loss": "contact_damping_loss",
    "impact_friction_loss": "contact_friction_loss",
}


def _books(
    run: xr.Dataset | LabelledArrays, contact: np.ndarray, begun: np.ndarray, ended: np.ndarray
) -> dict[str, tuple[tuple[str, ...], np.ndarray]]:
    """Impulse and losses of each impact, NaN where it has not ended; there are rows at all events."""
    time, booked = run["time"].values, dict[str, tuple[tuple[str, ...], np.ndarray]]()
    for name, book in BOOKS.items():
        if book in run:
            values, fractions = run[book].values, np.full(len(contact), np.nan)
            names = list(run["contact"].values)
            for i, c in enumerate(names.index(name) for name in contact):
                fractions[i] = np.interp(ended[i], time, values[:, c]) - np.interp(begun[i], time, values[:, c])
            booked[name] = (("impact",), fractions)
    return booked


def of_kind(run: xr.Dataset | LabelledArrays, name: str) -> np.ndarray:
    """True for the events of a kind, e.g. those that close a gap, shape (event,)."""
    return np.asarray(run["event_kind"].values == name, dtype=bool)


def _next_opening(i: int, contact: np.ndarray, openings: np.ndarray) -> int:
    """Index of the first opening of the same contact after event i, or -1."""
    later = np.flatnonzero((contact[i + 1 :] == contact[i]) & openings[i + 1 :])
    return int(i + 1 + later[0]) if later.size else -1
