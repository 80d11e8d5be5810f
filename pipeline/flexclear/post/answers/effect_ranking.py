"""Effects of a scene that matter: the change of each quantity without the effect, and its uncertainty.

Scenes with contacts are compared by the means of members with slightly different starts, the same in each variant. A
change is decided where it is twice its uncertainty by chance, or where both together are below a hundredth of the
quantity's size (`artifacts.effect_size`). Up to the horizon the members are one motion, and a change is uncertain by
the error of the time integration only.
"""

from __future__ import annotations

import html
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr

from flexclear.artifacts.effect_size import (
    REAL,
    Influence,
    chance,
    early_changes,
    influence_of_removal,
    over_run,
    reference_size,
)
from flexclear.artifacts.points import Point
from flexclear.post.answers.effect_sizes import (
    MEANING_NOT_COMPARABLE,
    NOT_COMPARABLE,
    cell,
    format_difference,
    join_names,
    with_early_changes,
)
from flexclear.post.overview.curves import format_to_digits, in_unit, size_of
from flexclear.post.plotting.table import Table
from flexclear.scene.quantity import Quantity

#: effect of clearance and flexibility together: the scene against the ideal mechanism
IDEAL = "clearance and flexibility"
#: fraction of a quantity's size below which a change need not be resolved; the answer names effects above it where the
#: scene requests no accuracy
SLIGHT = 0.01
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


def influence_of(pair: Pair, quantity: Quantity) -> Influence:
    """Return the change by the effect; nan where a run was refused."""
    return influence_of_removal(pair.without, pair.full, quantity, pair.members)


def is_decided(change: Influence, scale: float) -> bool:
    """Return True when further ensemble members cannot change the verdict on a change."""
    if not np.isfinite(change.difference) or change.uncertainty == 0.0:
        return True
    return change.real or change.most <= SLIGHT * scale


def undecided_quantities(pair: Pair, chosen: Sequence[Quantity]) -> list[Quantity]:
    """Return the quantities whose verdict beyond the horizon further members may change."""
    if pair.full.refused or pair.without.refused:
        return []
    return [q for q in chosen if not is_decided(influence_of(pair, q), reference_size(pair.full, q))]


def assemble(
    pairs: Mapping[str, Pair],
    words: Mapping[str, str],
    chosen: Sequence[Quantity],
    units: Sequence[str],
    undone: str,
    times: Sequence[float] = (),
    error: Callable[[Quantity, float], float] = lambda quantity, until: 0.0,
) -> xr.Dataset:
    """Return changes over (effect, quantity) in the quantities' SI units.

    pairs: by effect, with `IDEAL` where the scene has an ideal counterpart.  words: of the effects; empty for one that
    is not listed.  undone: effects that the budget did not reach, in words.  times: of the outputs [s].  error: of the
    time integration of a run in a quantity up to a time [s].
    """
    names = list(pairs)
    begun = [early_changes(p.without, p.full, chosen, p.members, times, error) for p in pairs.values()]
    changes = [
        [over_run(influence_of(pair, q), early, q) for q, early in zip(chosen, row, strict=True)]
        for pair, (_, row) in zip(pairs.values(), begun, strict=True)
    ]
    full = next(iter(pairs.values())).full
    scales = [reference_size(full, q) if not full.refused else np.nan for q in chosen]
    differences = np.array([[c.difference for c in row] for row in changes])
    uncertainties = np.array([[c.uncertainty for c in row] for row in changes])
    dims = ("effect", "quantity")
    data = {
        "dropped": (dims, differences, {"long_name": "change without the effect"}),
        "dropped_uncertainty": (dims, uncertainties, {"long_name": "part of the change that may be due to chance"}),
        "decided": (dims, np.array([[is_decided(c, s) for c, s in zip(row, scales, strict=True)] for row in changes])),
        "size": (("quantity",), np.array(scales), {"long_name": "largest value, or largest change from the start"}),
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
    result = xr.Dataset(data, coordinates, {"Conventions": "CF-1.11", "refused": text, "undone": undone})
    return with_early_changes(result, begun)


def ideal_sentences(result: xr.Dataset) -> list[str]:
    """Return a sentence for each quantity, as HTML, on its change by clearance and flexibility."""
    if IDEAL not in result["effect"].values:
        return []
    one, sentences = result.sel(effect=IDEAL), []
    until, kinds = float(one["horizon"]), ("early", "dropped")
    for k, name in enumerate(str(q) for q in result["quantity"].values):
        early, whole = (Influence(float(one[kind][k]), float(one[f"{kind}_uncertainty"][k])) for kind in kinds)
        if np.isfinite(whole.difference):
            unit, scale = str(result["unit"].values[k]), float(result["size"][k])
            text = change_in_words(whole, scale, unit)
            if np.isfinite(until):
                first = change_in_words(early, scale, unit)
                text = f"up to t = {in_unit(until, 's')} it {first}; over the whole run it {text}"
            sentences.append(f"<b>{html.escape(name)}</b>: {text}.")
    return sentences


def change_in_words(change: Influence, scale: float, unit: str) -> str:
    """Return a phrase on the change from the ideal mechanism, as HTML. scale: of the quantity."""
    if change.most <= NOTHING * scale:
        return f"does not change: the runs agree within <b class='n'>{in_unit(change.most, unit)}</b>"
    largest = change.difference if change.real else change.most
    value = format_difference(change.difference, change.uncertainty, unit)
    part = f" ({format_to_digits(100.0 * largest / scale, 2)} % of its {size_of(unit)})"
    return (
        f"changes by {'less than' if value.startswith('<') else 'up to'} <b class='n'>{value.removeprefix('< ')}</b>"
        f"{part if largest < LARGE * scale else ''}"
    )


def members_to_decide(change: Influence, scale: float, members: int) -> int:
    """Estimate the members that decide a change: chance falls with the root of their number, and by Student's t."""
    enough, fewer = max(SLIGHT * scale, change.difference / REAL), chance(MANY) / chance(members)
    return int(np.ceil(members * (fewer * change.uncertainty / enough) ** 2)) if enough > 0.0 else 2 * members


def sentence(result: xr.Dataset, requested: Mapping[str, float]) -> str:
    """Return one paragraph on the effects that matter.

    requested: accuracies of the scene by quantity, in SI units; without them the answer is for SLIGHT.
    """
    single = result.sel(effect=[e for e in result["effect"].values if e != IDEAL])
    last = [f"Not examined within the budget: {result.attrs['undone']}."] if result.attrs["undone"] else []
    last += filter(None, [result.attrs.get("staying", "")])
    if not single.sizes["effect"]:
        return " ".join(last) or "The scene has no effect that can be removed."
    name, limits = f"errors below {100.0 * SLIGHT:g} %", SLIGHT * result["size"].values
    if requested:
        name, limits = (
            "the requested accuracy",
            np.array([requested.get(str(q), np.inf) for q in result["quantity"].values]),
        )
    reached = single["horizon"].values[np.isfinite(single["horizon"].values)]
    certain, possible = _effects_above_limits(single, limits)
    needs = f"model {join_names(certain)}" if certain else "no effect is certain to be needed"
    needs = needs if certain or possible else "no effect is needed"
    beyond = " beyond the horizon" if reached.size else ""
    sentences = [f"For {name}, {needs}{f' (undecided{beyond}: {join_names(possible)})' if possible else ''}."]
    sentences += [_early_and_whole_sentence(single, reached)] if reached.size else []
    sentences += [] if requested else [PERCENTAGES]
    return " ".join(sentences + last)


def _early_and_whole_sentence(single: xr.Dataset, reached: np.ndarray) -> str:
    """Return a sentence on the answer's two parts: up to the horizons [s] and over the whole run."""
    words = [str(w) for w in single["words"].values]
    changes = [
        [Influence(*pair) for pair in zip(*row, strict=True)]
        for row in zip(single["early"].values, single["early_uncertainty"].values, strict=True)
    ]
    scales = single["size"].values
    left = [w for w, row in zip(words, changes, strict=True) if not all(map(is_decided, row, scales))]
    beyond = [w for w, sure in zip(words, single["decided"].values, strict=True) if not sure.all()]
    members = int(single["members"].max())
    until = " to ".join(dict.fromkeys(in_unit(time, "s") for time in (reached.min(), reached.max())))
    more = [enough for enough, _ in (_deciding_members(single, i) for i in range(len(words))) if enough]
    said = f"undecided for {join_names(left)}" if left else "decided for each effect"
    text = f"Up to the horizon, t = {until}, all runs of a variant are one motion, and its change is {said}"
    if not beyond:
        return f"{text}; means of {members} runs decide it over the whole run as well."
    return (
        f"{text}; over the whole run means of {members} runs leave it open for {join_names(beyond)}, "
        f"which some {' to '.join(dict.fromkeys(map(str, (min(more), max(more)))))} runs would decide."
    )


def _effects_above_limits(single: xr.Dataset, limits: np.ndarray) -> tuple[list[str], list[str]]:
    """Return effects whose change certainly exceeds its limit, up to the horizon or beyond it, and effects whose change
    may exceed it by chance."""
    change, chance = single["dropped"].values, single["dropped_uncertainty"].values
    early, doubt = single["early"].values, single["early_uncertainty"].values
    certain = np.any((change > limits) & (change >= REAL * chance), axis=1)
    certain |= np.any((early > limits) & (early >= REAL * doubt), axis=1)
    possible = np.any(np.where(np.isnan(change), True, change + chance > limits), axis=1)
    words = [str(w) for w in single["words"].values]
    return [w for w, hit in zip(words, certain, strict=True) if hit], [
        w for w, hit in zip(words, possible & ~certain, strict=True) if hit
    ]


def _deciding_members(result: xr.Dataset, i: int) -> tuple[int, str]:
    """Return how many members would decide what is undecided of an effect, 0 for none, and a cell of a table on it."""
    members = int(result["members"][i])
    changes = [
        (Influence(float(result["dropped"][i, k]), float(result["dropped_uncertainty"][i, k])), float(scale))
        for k, scale in enumerate(result["size"].values)
    ]
    more = [members_to_decide(change, scale, members) for change, scale in changes if not is_decided(change, scale)]
    enough = round_up(max(more)) if more else 0
    return enough, f"{members}; some {enough} would decide" if more else str(members)


def round_up(runs: int) -> int:
    """Return a number of runs with one digit that is not zero."""
    digit: int = 10 ** (len(str(runs)) - 1)
    return -(-runs // digit) * digit


def table(result: xr.Dataset) -> Table:
    """Tabulate the changes without each effect: effects as rows, quantities as columns."""
    rows = []
    for i, words in enumerate(str(w) for w in result["words"].values):
        if not words:
            continue
        units = [str(unit) for unit in result["unit"].values]
        cells = [cell(result, "dropped", (i, k), unit) for k, unit in enumerate(units)]
        members, until = int(result["members"][i]), float(result["horizon"][i])
        if np.isfinite(until):
            early = [cell(result, "early", (i, k), unit) for k, unit in enumerate(units)]
            rows.append((f"{words}, up to {in_unit(until, 's')}", *early, "one motion"))
            rows.append((f"{words}, whole run", *cells, _deciding_members(result, i)[1]))
        else:
            rows.append((words, *cells, str(members) if members else "one run"))
    notes = ["Largest change of each quantity without the effect. The number after ± or < may be due to chance."]
    if np.isfinite(result["horizon"].values).any():
        notes.append("Up to the horizon, all runs of a variant are one motion: ± or < is due to starts and time steps.")
    notes += [f"Refused: {line}" for line in filter(None, result.attrs["refused"].split("\n"))]
    notes += [MEANING_NOT_COMPARABLE] if any(NOT_COMPARABLE in row for row in rows) else []
    return Table(
        "Effect sizes",
        ("without", *(str(q) for q in result["quantity"].values), "members"),
        tuple(rows),
        tuple(notes),
    )
