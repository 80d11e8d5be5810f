"""Effects of a scene that matter: the change of each quantity without the effect, and its uncertainty.

Scenes with contacts are compared by the means of members with slightly different starts, the same in each variant. A
change is decided where it is twice its uncertainty by chance, or where both together are below a hundredth of the
quantity's size (`artifacts.effect_size`).
"""

from __future__ import annotations

import html
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr

from flexclear.artifacts.effect_size import REAL, Influence, chance, influence, scatter, size
from flexclear.artifacts.points import Point
from flexclear.post.answers.effect_sizes import cell, listed
from flexclear.post.overview.curves import measured, rounded, size_of
from flexclear.post.plotting.table import Table
from flexclear.scene.quantity import Quantity

#: effect of clearance and flexibility together: the scene against the ideal mechanism
IDEAL = "clearance and flexibility"
#: fraction of a quantity's size below which a change need not be resolved
SLIGHT = 0.01
#: accuracies for which the answer names the effects, where the scene requests none
LEVELS = (0.1, 0.01, 0.001)
PERCENTAGES = "Percentages are of each quantity's largest value; of positions and angles, of the largest change."
#: number of members from which on Student's t does not change
MANY = 1000
#: changes above this multiple of the quantity's size are not given in per cent
LARGE = 100.0
#: change that rounding of both runs could cause, as a fraction of the quantity's size
NOTHING = 1e-6


@dataclass(frozen=True)
class Pair:
    """The scene and the scene without an effect, each over so many members (0: one run, without contacts)."""

    full: Point
    without: Point
    members: int


def compared(pair: Pair, quantity: Quantity) -> Influence:
    """Return the change by the effect; nan where a run was refused."""
    if pair.full.refused or pair.without.refused:
        return Influence(np.nan, np.nan)
    return influence(pair.without, pair.full, quantity, pair.members)


def decided(change: Influence, scale: float) -> bool:
    """Return True when further ensemble members cannot change the verdict on a change."""
    if not np.isfinite(change.difference) or change.uncertainty == 0.0:
        return True
    return change.real or change.most <= SLIGHT * scale


def undecided(pair: Pair, chosen: Sequence[Quantity]) -> list[Quantity]:
    """Return the quantities whose verdict further members may change."""
    if pair.full.refused or pair.without.refused:
        return []
    return [q for q in chosen if not decided(compared(pair, q), size(pair.full, q))]


def assemble(
    pairs: Mapping[str, Pair], words: Mapping[str, str], chosen: Sequence[Quantity], units: Sequence[str], undone: str
) -> xr.Dataset:
    """Return changes over (effect, quantity) in the quantities' SI units.

    pairs: by effect, with `IDEAL` where the scene has an ideal counterpart.  words: of the effects; empty for one that
    is not listed.  undone: effects that the budget did not reach, in words.
    """
    names = list(pairs)
    changes = [[compared(pairs[name], q) for q in chosen] for name in names]
    full = next(iter(pairs.values())).full
    scales = [size(full, q) if not full.refused else np.nan for q in chosen]
    differences = np.array([[c.difference for c in row] for row in changes])
    uncertainties = np.array([[c.uncertainty for c in row] for row in changes])
    dims = ("effect", "quantity")
    data = {
        "dropped": (dims, differences, {"long_name": "change without the effect"}),
        "dropped_uncertainty": (dims, uncertainties, {"long_name": "part of the change that may be due to chance"}),
        "decided": (dims, np.array([[decided(c, s) for c, s in zip(row, scales, strict=True)] for row in changes])),
        "size": (("quantity",), np.array(scales), {"long_name": "largest value, or largest change from the start"}),
        "scatter": (
            ("quantity",),
            np.array([0.0 if full.refused else scatter(full, q) for q in chosen]),
            {"long_name": "standard deviation of one run of the scene about the mean of all"},
        ),
        "members": (("effect",), np.array([pairs[name].members for name in names])),
    }
    coordinates = {
        "effect": names,
        "words": ("effect", [words[name] for name in names]),
        "quantity": [q.name for q in chosen],
        "unit": ("quantity", list(units)),
    }
    refused = {name: p.without.refused or p.full.refused for name, p in pairs.items()}
    text = "\n".join(f"without {words[name]}: {why}" for name, why in refused.items() if why and words[name])
    return xr.Dataset(data, coordinates, {"Conventions": "CF-1.11", "refused": text, "undone": undone})


def ideal_sentences(result: xr.Dataset) -> list[str]:
    """Return a sentence for each quantity, as HTML, on its change by clearance and flexibility."""
    if IDEAL not in result["effect"].values:
        return []
    one, sentences = result.sel(effect=IDEAL), []
    for k, name in enumerate(str(q) for q in result["quantity"].values):
        change = Influence(float(one["dropped"][k]), float(one["dropped_uncertainty"][k]))
        if np.isfinite(change.difference):
            unit, members = str(result["unit"].values[k]), int(one["members"])
            text = in_words(change, float(result["size"][k]), unit, members, float(result["scatter"][k]))
            sentences.append(f"<b>{html.escape(name)}</b>: {text}.")
    return sentences


def in_words(
    change: Influence, scale: float, unit: str, members: int = 0, spread: float = 0.0, of: str = "the scene"
) -> str:
    """Return a phrase on the change from the ideal mechanism, whose runs do not scatter, as HTML.

    members: number of runs in the means, 0 for one run each.  spread: standard deviation of a run.  of: owner of the
    scale.
    """

    def percent(value: float) -> str:
        return f" ({rounded(100.0 * value / scale, 2)} % of its {size_of(unit)} in {of})"

    means = f", as means of {members} runs" if members and change.uncertainty > 1e-3 * change.difference else ""
    bound = f"<b class='n'>{measured(change.most, np.nan, unit)}</b>"
    if change.most <= NOTHING * scale:
        return f"does not change: the runs agree within {bound}"
    part = percent(change.difference) if change.difference < LARGE * scale else ""
    if not decided(change, scale) and spread > SLIGHT * scale:
        value = f"<b class='n'>{measured(spread, np.nan, unit)}</b>{part and percent(spread)}"
        return f"is not predictable: {members} runs scatter by {value} about a mean that changes by {bound} at most"
    if not decided(change, scale):
        more = f"; about {needed(change, scale, members)} runs would decide" if members else ""
        return f"changes by {bound} at most{part and percent(change.most)}{means}{more}"
    if change.difference > 0.0:
        slightly = "slightly, " if change.difference < SLIGHT * scale else ""
        value = measured(change.difference, change.uncertainty or np.nan, unit)
        return f"changes {slightly}by up to <b class='n'>{value}</b>{part}{means}"
    return f"changes by less than {bound}{part and percent(change.most)}{means}"


def needed(change: Influence, scale: float, members: int) -> int:
    """Estimate the members that decide a change: chance falls with the root of their number, and by Student's t."""
    enough, fewer = max(SLIGHT * scale, change.difference / REAL), chance(MANY) / chance(members)
    return int(np.ceil(members * (fewer * change.uncertainty / enough) ** 2)) if enough > 0.0 else 2 * members


def sentence(result: xr.Dataset, requested: Mapping[str, float]) -> str:
    """Return one paragraph on the effects that matter.

    requested: accuracies of the scene by quantity, in SI units; without them three levels are answered.
    """
    single = result.sel(effect=[e for e in result["effect"].values if e != IDEAL])
    undone = [f"Not examined within the budget: {result.attrs['undone']}."] if result.attrs["undone"] else []
    if not single.sizes["effect"]:
        return " ".join(undone) or "The scene has no effect that can be removed."
    levels = [(f"errors below {100.0 * level:g} %", level * result["size"].values) for level in LEVELS]
    if requested:
        asked = np.array([requested.get(str(q), np.inf) for q in result["quantity"].values])
        levels = [("the requested accuracy", asked)]
    sentences, named, unchanged = list[str](), list[str](), list[str]()
    for name, limits in levels:
        certain, possible = _called_for(single, limits)
        added = [effect for effect in certain if effect not in named]
        uncertain = [effect for effect in possible if effect not in certain]
        open_ = f" (undecided: {listed(uncertain)})" if uncertain else ""
        if added:
            sentences.append(f"For {name}, {'also ' if named else ''}model {listed(added)}{open_}.")
        elif uncertain:
            sentences.append(f"For {name}, no {'further ' if named else ''}effect is certain to be needed{open_}.")
        else:
            unchanged.append(name)
        named += added
    if unchanged:
        sentences.append(f"For {listed(unchanged)}, no {'further ' if named else ''}effect is needed.")
    sentences += [] if requested else [PERCENTAGES]
    return " ".join(sentences + undone)


def _called_for(single: xr.Dataset, limits: np.ndarray) -> tuple[list[str], list[str]]:
    """Return effects whose change certainly exceeds its limit, and effects whose change may exceed it by chance."""
    change, chance = single["dropped"].values, single["dropped_uncertainty"].values
    certain = np.any((change > limits) & (change >= REAL * chance), axis=1)
    possible = np.any(np.where(np.isnan(change), True, change + chance > limits), axis=1)
    words = [str(w) for w in single["words"].values]
    return [w for w, hit in zip(words, certain, strict=True) if hit], [
        w for w, hit in zip(words, possible & ~certain, strict=True) if hit
    ]


def table(result: xr.Dataset) -> Table:
    """Tabulate the changes without each effect: effects as rows, quantities as columns."""
    rows = []
    for i, words in enumerate(str(w) for w in result["words"].values):
        if not words:
            continue
        cells = [cell(result, "dropped", (i, k), str(unit)) for k, unit in enumerate(result["unit"].values)]
        members = int(result["members"][i])
        rows.append((words, *cells, str(members) if members else "one run"))
    notes = ["Largest change of each quantity without the effect; the number after ± may be due to chance."]
    notes += [f"Refused: {line}" for line in filter(None, result.attrs["refused"].split("\n"))]
    return Table(
        "Effect sizes",
        ("without", *(str(q) for q in result["quantity"].values), "members"),
        tuple(rows),
        tuple(notes),
    )
