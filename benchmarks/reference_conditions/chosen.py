"""The cases that the comparison runs."""

from __future__ import annotations

from benchmarks.reference_conditions.design import (
    CLEARANCE_COUNTS,
    CONDITIONS,
    COUNT,
    FAR_COUNTS,
    FINER,
    FULL,
    LARGE_SETS,
    MOST_COMPLETE,
    PLACES,
    RIGID,
    Case,
)
from benchmarks.reference_conditions.statics import whole


def far(places: tuple[int, ...] = tuple(PLACES)) -> list[Case]:
    """Ideal joints: rigid, every condition, the full rod; at the first place in all counts and meshes."""
    found = []
    for place in places:
        found += [Case(place, RIGID), Case(place, FULL)]
        found += [Case(place, c, whole(place, c, COUNT)) for c in CONDITIONS]
        found += [Case(place, c, whole(place, c, 7)) for c in ("free-free", "fixed-fixed")]
    found += [Case(places[0], c, whole(places[0], c, n)) for c in CONDITIONS for n in FAR_COUNTS]
    found += [Case(places[0], "craig-bampton", COUNT, finer=n) for n in FINER]
    return list(dict.fromkeys(found))


def clearance(members: int, places: tuple[int, ...] = tuple(PLACES)) -> list[Case]:
    """Clearance at A1: likewise, as ensembles."""
    found = []
    for place in places:
        found.append((place, RIGID, COUNT))
        sets = [(c, COUNT) for c in CONDITIONS] + [(c, 7) for c in ("free-free", "fixed-fixed")]
        sets += [("craig-bampton", n) for n in MOST_COMPLETE]
        found += [(place, c, whole(place, c, n)) for c, n in sets]
    first = places[0]
    for condition in ("free-free", "craig-bampton"):
        found += [(first, condition, whole(first, condition, n)) for n in CLEARANCE_COUNTS]
    return [Case(*key, clearance=True, members=_share(members, *key[1:])) for key in dict.fromkeys(found)]


def _share(members: int, condition: str, count: int) -> int:
    """Members of an ensemble: fewer where a run is dear; a rigid rod has one run."""
    if condition == RIGID:
        return 0
    # whole counts may lie a little above COUNT
    return members if count < MOST_COMPLETE[0] else max(2, round(LARGE_SETS * members))
