"""Effects of a scene that matter, in words and as a table."""

from __future__ import annotations

import html
from collections.abc import Mapping

import numpy as np
import xarray as xr

from flexclear.artifacts.effect_size import REAL, Influence, chance
from flexclear.post.answers.effect_sizes import (
    IDEAL,
    NOT_COMPARABLE,
    REFUSED,
    SLIGHT,
    cell,
    format_difference,
    is_decided,
    join_names,
)
from flexclear.post.overview.curves import format_to_digits, in_unit, size_of
from flexclear.post.plotting.table import Table

MEANING_NOT_COMPARABLE = (
    "Not comparable: the quantity exists only with the effect, or the runs differ in their number of impacts."
)
MEANING_OF_PAIRS = (
    "Added alone: change when the effect is added to the bare scene (friction: to the one with its clearance). "
    "Interaction: strongest change by the effect and another one together minus the sum of their single changes."
)
PERCENTAGES = "Percentages are of each quantity's largest value; of positions and angles, of the largest change."
#: number of members from which on Student's t does not change
MANY = 1000
#: changes above this multiple of the quantity's size are not given in per cent
LARGE = 100.0
#: change that rounding of both runs could cause, as a fraction of the quantity's size
NOTHING = 1e-6


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
    last += [f"{REFUSED}, {line}." for line in result.attrs["refused"].split("\n") if line]
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
    certain, possible = _needed_effects(single, limits)
    needs = f"model {join_names(certain)}" if certain else "no effect is certain to be needed"
    needs = needs if certain or possible or result.attrs["refused"] else "no effect is needed"
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
    more = [enough for enough, _ in (_members_cell(single, i) for i in range(len(words))) if enough]
    said = f"undecided for {join_names(left)}" if left else "decided for each effect"
    text = f"Up to the horizon, t = {until}, all runs of a variant are one motion, and its change is {said}"
    if not beyond:
        return f"{text}; means of {members} runs decide it over the whole run as well."
    return (
        f"{text}; over the whole run means of {members} runs leave it open for {join_names(beyond)}, "
        f"which some {' to '.join(dict.fromkeys(map(str, (min(more), max(more)))))} runs would decide."
    )


def _needed_effects(single: xr.Dataset, limits: np.ndarray) -> tuple[list[str], list[str]]:
    """Return effects whose change certainly exceeds its limit, up to the horizon or beyond it, and effects whose change
    may exceed it by chance; none of those whose variant was refused."""
    change, chance = single["dropped"].values, single["dropped_uncertainty"].values
    early, doubt = single["early"].values, single["early_uncertainty"].values
    certain = np.any((change > limits) & (change >= REAL * chance), axis=1)
    certain |= np.any((early > limits) & (early >= REAL * doubt), axis=1)
    possible = np.any(change + chance > limits, axis=1)
    words = [str(w) for w in single["words"].values]
    return [w for w, hit in zip(words, certain, strict=True) if hit], [
        w for w, hit in zip(words, possible & ~certain, strict=True) if hit
    ]


def _members_cell(result: xr.Dataset, i: int) -> tuple[int, str]:
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
    """Tabulate the changes by each effect: effects as rows, quantities as columns."""
    rows, quantities, pairs = list[tuple[str, ...]](), range(result.sizes["quantity"]), "interaction" in result
    for i, words in enumerate(str(w) for w in result["words"].values):
        if not words:
            continue
        cells = {
            kind: [cell(result, kind, (i, k)) for k in quantities]
            for kind in ("dropped", "early", "added")
            if kind in result
        }
        members, until = int(result["members"][i]), float(result["horizon"][i])
        if np.isfinite(until):
            rows.append((f"{words}, up to {in_unit(until, 's')}", *cells["early"], "one motion"))
            rows.append((f"{words}, whole run", *cells["dropped"], _members_cell(result, i)[1]))
        else:
            rows.append((words, *cells["dropped"], str(members) if members else "one run"))
        if "added" in cells and result["effect"][i] != IDEAL:
            rows.append((f"{words}, added alone", *cells["added"], ""))
        if pairs and result["effect"][i] != IDEAL:
            rows.append((f"{words}, interaction", *(_strongest(result, i, k) for k in quantities), ""))
    notes = ["Largest change of each quantity without the effect. The number after ± or < may be due to chance."]
    if np.isfinite(result["horizon"].values).any():
        notes.append("Up to the horizon, all runs of a variant are one motion: ± or < is due to starts and time steps.")
    notes += [MEANING_OF_PAIRS] if "added" in result else []
    notes += [f"{REFUSED}, {line}" for line in result.attrs["refused"].split("\n") if line]
    notes += [MEANING_NOT_COMPARABLE] if any(NOT_COMPARABLE in row for row in rows) else []
    notes += filter(None, [result.attrs.get("staying")])
    return Table(
        "Effect sizes",
        ("without", *(str(q) for q in result["quantity"].values), "members"),
        tuple(rows),
        tuple(notes),
    )


def _strongest(result: xr.Dataset, i: int, k: int) -> str:
    """Return a cell with the strongest interaction of an effect in a quantity, and the other effect's name."""
    sizes = result["interaction"].values[i, :, k]
    if not np.isfinite(sizes).any():
        return "–"
    j = int(np.nanargmax(np.where(np.isfinite(sizes), sizes, np.nan)))
    return f"{cell(result, 'interaction', (i, j, k))}, with {result['words'].values[j]}"
