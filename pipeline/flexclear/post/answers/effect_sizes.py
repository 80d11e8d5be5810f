"""Effect sizes of each effect on each quantity, by removal, on request added and in pairs as well: dataset, chart.

Variants are named by the effects that they lack. The full scene lacks none, the bare one lacks all.

Scenes with contacts are compared by the means of members with slightly different starts, the same in each variant. A
change is decided where it is twice its uncertainty by chance, or where both together are below a hundredth of the
quantity's size (`artifacts.effect_size`). Up to the horizon the members are one motion, and a change is uncertain by
the error of the time integration only.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations, product

import numpy as np
import xarray as xr

from flexclear.artifacts.effect_size import (
    Influence,
    early_changes,
    influence,
    influence_of_removal,
    over_run,
    reference_size,
)
from flexclear.artifacts.points import Point
from flexclear.post.overview.curves import format_with_error, in_unit
from flexclear.scene.quantity import Quantity
from flexclear.scene.variants import Effect

Names = frozenset[str]
#: substitute for a variant that did not run
UNKNOWN = Point({}, {}, {}, 0, "not run")
#: effect of clearance and flexibility together: the scene against the ideal mechanism
IDEAL = "clearance and flexibility"
#: fraction of a quantity's size below which a change need not be resolved; the answer names effects above it where the
#: scene requests no accuracy
SLIGHT = 0.01
#: ratio of an axis's limits below which it has ticks between the powers of ten
FEW = 30.0
#: labels of the chart's bars
LEGEND = {"dropped": "removed", "added": "added alone", "early": "removed, up to the horizon"}
#: words for an infinite effect size, and their meaning
NOT_COMPARABLE = "not comparable"
#: beginning of a sentence on a variant without values
REFUSED = "Refused by the solver, also at a tighter tolerance"
#: variables of the dataset, and their meaning
MEANINGS = {
    "dropped": "change of the quantity when the effect is removed from the full scene",
    "early": "that change up to the horizon",
    "added": "change when the effect is added to the bare scene (friction: with its clearance)",
    "dropped_pair": "change when both effects are removed from the full scene",
    "added_pair": "change when both effects are added to the bare scene",
    "interaction": "change by both effects together in the bare scene minus the sum of their single changes",
}


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


def variants(effects: Sequence[Effect]) -> list[Names]:
    """Return the necessary variants, each once: full, bare, and each effect and pair removed and added."""
    every = frozenset(effect.name for effect in effects)
    chosen = [frozenset(pair) for n in (0, 1, 2) for pair in combinations(every, n)]
    sets = [with_dependents(effects, gone) for few in chosen for gone in (few, every - with_owners(effects, few))]
    return list(dict.fromkeys(sorted(sets, key=lambda names: (len(names), sorted(names)))))


def with_dependents(effects: Sequence[Effect], gone: Names) -> Names:
    """Return the removed effects with those that exist only within them."""
    return gone | {effect.name for effect in effects if effect.within in gone}


def with_owners(effects: Sequence[Effect], present: Names) -> Names:
    """Return the effects with those within which they exist."""
    return present | {effect.within for effect in effects if effect.name in present and effect.within}


def assemble(
    pairs: Mapping[str, Pair],
    words: Mapping[str, str],
    chosen: Sequence[Quantity],
    units: Sequence[str],
    undone: str,
    times: Sequence[float] = (),
    error: Callable[[Quantity, float], float] = lambda quantity, until: 0.0,
) -> xr.Dataset:
    """Return changes over (effect, quantity) in the quantities' SI units, each with an `_uncertainty`.

    pairs: by effect, with `IDEAL` where the scene has an ideal counterpart.  words: of the effects; empty for one that
    is not listed.  undone: effects that the budget did not reach, in words.  times: of the outputs [s].  error: of the
    time integration of a run in a quantity up to a time [s].  nan where a variant was refused; infinite where the
    quantity goes with the effect.
    """
    dims = ("effect", "quantity")
    begun = [early_changes(p.without, p.full, chosen, p.members, times, error) for p in pairs.values()]
    early = [row for _, row in begun]
    changes = [
        [over_run(influence_of(pair, q), one, q) for q, one in zip(chosen, row, strict=True)]
        for pair, row in zip(pairs.values(), early, strict=True)
    ]
    full = next(iter(pairs.values())).full
    scales = [reference_size(full, q) if not full.refused else np.nan for q in chosen]
    horizon = "time up to which the members of both variants are one motion each; nan: they always are"
    data = {
        "decided": (dims, np.array([[is_decided(c, s) for c, s in zip(row, scales, strict=True)] for row in changes])),
        "size": (("quantity",), np.array(scales), {"long_name": "largest value, or largest change from the start"}),
        "members": (("effect",), np.array([pair.members for pair in pairs.values()])),
        "horizon": (("effect",), [until for until, _ in begun], {"units": "s", "long_name": horizon}),
    }
    for kind, rows in (("dropped", changes), ("early", early)):
        sizes = [[(c.difference, c.uncertainty) for c in row] for row in rows]
        data |= _variables(kind, dims, np.reshape(sizes, (len(pairs), len(chosen), 2)))
    coordinates = {
        "effect": list(pairs),
        "words": ("effect", [words[name] for name in pairs]),
        "quantity": [q.name for q in chosen],
        "unit": ("quantity", list(units)),
    }
    refused = {"with all effects": full.refused}
    refused |= {f"without {words[name]}": pair.without.refused for name, pair in pairs.items() if words[name]}
    attributes = {"Conventions": "CF-1.11", "refused": _reasons(refused), "undone": undone}
    return xr.Dataset(data, coordinates, attributes)


def _reasons(refused: Mapping[str, str]) -> str:
    """Return a line for each variant, in words, that the solver refused, from the reasons."""
    return "\n".join(f"{variant}: {' '.join(why.split())}" for variant, why in refused.items() if why)


def _variables(kind: str, dims: Sequence[str], sizes: np.ndarray) -> dict[str, tuple]:
    """Return the variable of a kind of effect size, and that of its uncertainty. sizes: both, in the last dimension."""
    chance = {"long_name": f"{MEANINGS[kind]}: part that may be due to chance or to errors of the time integration"}
    return {
        kind: (dims, sizes[..., 0], {"long_name": MEANINGS[kind]}),
        f"{kind}_uncertainty": (dims, sizes[..., 1], chance),
    }


def with_pairs(
    result: xr.Dataset,
    effects: Sequence[Effect],
    chosen: Sequence[Quantity],
    points: Mapping[Names, Point],
    members: int,
) -> xr.Dataset:
    """Return the effect sizes with those of effects that are added, over (effect, quantity), and of pairs over
    (effect, other, quantity).

    points: by the effects that a variant lacks.
    """
    every, names = frozenset(effect.name for effect in effects), result["effect"].values.tolist()
    shape = (len(names), len(names), len(chosen), 2)
    added, data = np.full((len(names), *shape[2:]), np.nan), dict[str, np.ndarray]()
    for one, other in product(effects, repeat=2):
        pair = frozenset({one.name, other.name})
        # an effect within another one is added on top of that one
        ground = every - (with_owners(effects, pair) - pair)
        bare, gained = points.get(ground, UNKNOWN), points[every - with_owners(effects, pair)]
        lost = points[with_dependents(effects, pair)]
        single = [points.get(ground - with_owners(effects, frozenset({e.name})), UNKNOWN) for e in (one, other)]
        i, j = names.index(one.name), names.index(other.name)
        for k, quantity in enumerate(chosen):
            found = {"added_pair": influence_of_removal(gained, bare, quantity, members)}
            if i == j:
                added[i, k] = found["added_pair"].difference, found["added_pair"].uncertainty
                continue
            found["dropped_pair"] = influence_of_removal(lost, points[frozenset()], quantity, members)
            if one.within != other.name and other.within != one.name:
                found["interaction"] = _interaction(gained, single, bare, quantity, members)
            for kind, value in found.items():
                sizes = data.setdefault(kind, np.full(shape, np.nan))
                sizes[i, j, k] = value.difference, value.uncertainty
    variables = _variables("added", ("effect", "quantity"), added)
    for kind, sizes in data.items():
        variables |= _variables(kind, ("effect", "other", "quantity"), sizes)
    words = dict(zip(names, result["words"].values.tolist(), strict=True))
    refused = {
        f"without {join_names([words[name] for name in names if name in gone])}": point.refused
        for gone, point in points.items()
        if len(gone) > 1
    }
    why = "\n".join(filter(None, (result.attrs["refused"], _reasons(refused))))
    return result.assign(variables).assign_coords(other=names).assign_attrs(refused=why)


def _interaction(both: Point, single: Sequence[Point], bare: Point, quantity: Quantity, members: int) -> Influence:
    """Return the size of both - one - other + bare, for quantities whose values can be added."""
    points = (both, *single, bare)
    names = [name for name in both.values if name.rpartition(".")[0] == quantity.name]
    if any(p.refused for p in points) or quantity.kind in ("orientation", "impact_times"):
        return Influence(np.nan, np.nan)
    if not names or any(name not in p.values for p in points for name in names):
        return Influence(np.inf)
    signs = (1.0, -1.0, -1.0, 1.0)
    values = {
        name: np.asarray(np.sum([s * p.values[name] for s, p in zip(signs, points, strict=True)], axis=0))
        for name in names
    }
    deviation = {
        name: np.sqrt(np.sum([np.square(p.deviation.get(name, 0.0 * p.values[name])) for p in points], axis=0))
        for name in names
    }
    nothing = Point({**both.values, **{name: np.zeros_like(value) for name, value in values.items()}}, {}, {}, 0)
    return influence(Point(values, {}, deviation, 0), nothing, quantity, members)


def cell(dataset: xr.Dataset, name: str, at: tuple[int, ...]) -> str:
    """Format an effect size of a dataset, of the quantity of the last index, with its uncertainty."""
    value, uncertainty = (float(dataset[part].values[at]) for part in (name, f"{name}_uncertainty"))
    unit = str(dataset["unit"].values[at[-1]])
    return "none" if value == uncertainty == 0.0 else format_difference(value, uncertainty, unit)


def format_difference(value: float, uncertainty: float, unit: str) -> str:
    """Format a difference with its uncertainty by chance, in a fitting unit; one that is all chance as a limit."""
    if np.isnan(value):
        return "–"
    if np.isinf(value):
        return NOT_COMPARABLE
    if value < 0.05 * uncertainty:  # no digit of it would be shown
        return f"< {in_unit(value + uncertainty, unit, 2)}"
    return format_with_error(value, uncertainty, unit) if uncertainty > 0.0 else in_unit(value, unit, 3)


def join_names(names: Sequence[str]) -> str:
    """Return names with commas and a final `and`."""
    return "".join(names) if len(names) < 2 else ", ".join(names[:-1]) + f" and {names[-1]}"


def staying_contacts_sentence(names: Sequence[str]) -> str:
    """Return a sentence on the contacts that an ideal mechanism keeps, with these names; empty without any."""
    if not names:
        return ""
    places = " ".join(f"joint.{name}" for name in names)
    verb = "stays" if len(names) == 1 else "stay"
    return (
        f"{join_names(names)} {verb} in every variant, as a ball on a plane has no ideal counterpart "
        f"(its own effect: flexclear effects --of {places})."
    )


def chart(name: str, dataset: xr.Dataset, title: str, requested: Mapping[str, float] | None = None) -> dict[str, bytes]:
    """Draw bars of the sizes of single effects, a panel for each quantity; a line where an accuracy is requested.

    Uses `dropped` and, where they exist, `added` or `early`, with their uncertainties.
    """
    from matplotlib.ticker import NullFormatter

    from flexclear.post.plotting import style

    names = [str(effect) for effect in dataset["effect"].values]
    chosen = [str(quantity) for quantity in dataset["quantity"].values]
    early = "added" not in dataset and "early" in dataset and bool(np.isfinite(dataset["horizon"].values).any())
    kinds = [kind for kind in ("dropped", "added", "early") if kind in dataset and (early or kind != "early")]
    with style.set_style():
        figure, axes = style.panels(len(chosen), min(2, len(chosen)), 10.0, 1.1, 0.9 + 0.3 * len(names), sharey=True)
        for k, panel in enumerate(axes):
            for n, kind in enumerate(kinds):
                values = dataset[kind].values[:, k]
                by_chance = np.nan_to_num(dataset[f"{kind}_uncertainty"].values[:, k])
                rows = np.arange(len(names)) + 0.36 * (n - 0.5 * (len(kinds) - 1))
                shown = np.where(np.isfinite(values) & (values > 0.0), values, np.nan)
                panel.barh(rows, shown, 0.34, label=LEGEND[kind], color=("#0072B2", "#E69F00")[n])
                drawn = np.isfinite(shown) & (by_chance > 0.0)
                # 0.9: the error bar goes back over at most this fraction of a bar, since the axis is logarithmic
                ends = [np.minimum(by_chance, 0.9 * shown)[drawn], by_chance[drawn]]
                panel.errorbar(
                    shown[drawn], rows[drawn], xerr=ends, fmt="none", ecolor="#222222", elinewidth=0.9, capsize=2
                )
                for row, (y, value) in enumerate(zip(rows, values, strict=True)):
                    text = "refused" if np.isnan(value) and kind != "early" else cell(dataset, kind, (row, k))
                    text = "" if np.isfinite(value) and value > 0.0 else text
                    panel.text(0.01, y, text, transform=panel.get_yaxis_transform(), va="center", fontsize=6.8)
            panel.set_xscale("log")
            sizes = np.array([dataset[kind].values[:, k] for kind in kinds])
            drawn = sizes[np.isfinite(sizes) & (sizes > 0.0)]
            if len(drawn):  # bars that begin near their ends would exaggerate small differences
                panel.set_xlim(left=0.1 * float(drawn.min()))
            if requested and np.isfinite(requested.get(chosen[k], np.nan)):
                if not len(drawn):  # a line alone has no extent to scale axes by
                    panel.set_xlim(0.1 * requested[chosen[k]], 10.0 * requested[chosen[k]])
                panel.axvline(requested[chosen[k]], color="#D55E00", lw=1.3, label="requested accuracy")
            low, high = panel.get_xlim()
            if high < FEW * low:
                style.set_plain_numbers(panel.xaxis)
            else:
                panel.xaxis.set_minor_formatter(NullFormatter())
            panel.set_yticks(np.arange(len(names)), names, fontsize=7.6)
            panel.set_title(f"{chosen[k]} [{dataset['unit'].values[k]}]")
        axes[0].set_ylim(len(names) - 0.5, -0.5)  # the first on top, and space for a last row without a bar
        style.heading(figure, title)
        style.shared_legend(figure, axes[0], 3)
        return style.files(name, figure)
