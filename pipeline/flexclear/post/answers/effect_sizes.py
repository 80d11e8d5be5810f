"""Effect sizes of each effect on each quantity, by removal and addition, alone and in pairs: dataset, table, chart.

Variants are named by the effects that they lack. The full scene lacks none, the bare one lacks all.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from itertools import combinations

import numpy as np
import xarray as xr

from flexclear.artifacts.effect_size import Influence, early_changes, influence, influence_of_removal, over_run
from flexclear.artifacts.points import Point
from flexclear.post.overview.curves import format_with_error, in_unit
from flexclear.post.plotting.table import Table
from flexclear.scene.quantity import Quantity
from flexclear.scene.variants import Effect

Names = frozenset[str]
#: substitute for a variant that did not run
UNKNOWN = Point({}, {}, {}, 0, "not run")
#: ratio of an axis's limits below which it has ticks between the powers of ten
FEW = 30.0
#: labels of the chart's bars
LEGEND = {"dropped": "removed", "added": "added alone", "early": "removed, up to the horizon"}
#: words for an infinite effect size, and their meaning
NOT_COMPARABLE = "not comparable"
MEANING_NOT_COMPARABLE = (
    "Not comparable: the quantity exists only with the effect, or the runs differ in their number of impacts."
)
#: variables of the dataset, and their meaning
MEANINGS = {
    "dropped": "change of the quantity when the effect, or both effects, are removed from the full scene",
    "added": "change when the effect, or both, are added to the bare scene (friction: with its clearance)",
    "interaction": "change by both effects together in the bare scene minus the sum of their single changes",
}


def variants(effects: Sequence[Effect]) -> list[Names]:
    """Return the necessary variants, each once: full, bare, and each effect and pair removed and added."""
    every = frozenset(effect.name for effect in effects)
    chosen = [frozenset(pair) for n in (0, 1, 2) for pair in combinations(every, n)]
    sets = [with_dependents(effects, gone) for few in chosen for gone in (few, every - closed_up(effects, few))]
    return list(dict.fromkeys(sorted(sets, key=lambda names: (len(names), sorted(names)))))


def with_dependents(effects: Sequence[Effect], gone: Names) -> Names:
    """Return the removed effects with those that exist only within them."""
    return gone | {effect.name for effect in effects if effect.within in gone}


def closed_up(effects: Sequence[Effect], present: Names) -> Names:
    """Return the effects with those within which they exist."""
    return present | {effect.within for effect in effects if effect.name in present and effect.within}


def assemble(
    effects: Sequence[Effect],
    chosen: Sequence[Quantity],
    points: Mapping[Names, Point],
    members: int,
    units: Sequence[str],
    times: Sequence[float] = (),
    error: Callable[[Quantity, float], float] = lambda quantity, until: 0.0,
) -> xr.Dataset:
    """Return effect sizes over (effect, other, quantity) in the quantities' SI units, each with an `_uncertainty`.

    The diagonal of (effect, other) holds single effects.  points: by the effects that a variant lacks. units: of the
    chosen quantities.  times, error: of `effect_size.early_changes`.  nan where a variant was refused; infinite where
    the quantity goes with the effect.
    """
    every, n = frozenset(effect.name for effect in effects), len(effects)
    shape = (n, n, len(chosen))
    begun = list[tuple[float, list[Influence]]]()
    data = {f"{name}{part}": np.full(shape, np.nan) for name in MEANINGS for part in ("", "_uncertainty")}
    full = points[frozenset()]
    for i, one in enumerate(effects):
        for j, other in enumerate(effects):
            pair = frozenset({one.name, other.name})
            # an effect within another one is added on top of that one
            ground = every - (closed_up(effects, pair) - pair)
            bare, lost = points.get(ground, UNKNOWN), points[with_dependents(effects, pair)]
            gained = points[every - closed_up(effects, pair)]
            single = [points.get(ground - closed_up(effects, frozenset({e.name})), UNKNOWN) for e in (one, other)]
            independent = i != j and one.within != other.name and other.within != one.name
            if i == j:
                begun.append(early_changes(lost, full, chosen, members, times, error))
            for k, quantity in enumerate(chosen):
                variables = {"dropped": influence_of_removal(lost, full, quantity, members)}
                if i == j:
                    variables["dropped"] = over_run(variables["dropped"], begun[i][1][k], quantity)
                variables["added"] = influence_of_removal(gained, bare, quantity, members)
                if independent:
                    variables["interaction"] = _interaction(gained, single, bare, quantity, members)
                for name, value in variables.items():
                    data[name][i, j, k], data[f"{name}_uncertainty"][i, j, k] = value.difference, value.uncertainty
    dims = ("effect", "other", "quantity")
    result = xr.Dataset(
        {name: (dims, values) for name, values in data.items()},
        coords={
            "effect": [effect.name for effect in effects],
            "other": [effect.name for effect in effects],
            "words": ("effect", [effect.words for effect in effects]),
            "quantity": [quantity.name for quantity in chosen],
            "unit": ("quantity", list(units)),
        },
        attrs={"Conventions": "CF-1.11", "members": members},
    )
    for name, text in MEANINGS.items():
        result[name].attrs = {"long_name": text}
        result[f"{name}_uncertainty"].attrs = {"long_name": f"{text}: part that may be due to chance"}
    refused = {"+".join(sorted(gone)) or "full": p.refused for gone, p in points.items() if p.refused}
    why = "\n".join(f"without {gone}: {why}" for gone, why in refused.items())
    return with_early_changes(result, begun).assign_attrs(refused=why)


def with_early_changes(result: xr.Dataset, begun: Sequence[tuple[float, Sequence[Influence]]]) -> xr.Dataset:
    """Return the dataset of effects with their horizons [s] and their changes of each quantity up to these.

    begun: results of `effect_size.early_changes`, by effect.
    """
    rows = [[(c.difference, c.uncertainty) for c in changes] for _, changes in begun]
    early = np.array(rows).reshape(len(begun), result.sizes["quantity"], 2)
    dims, change = ("effect", "quantity"), f"{MEANINGS['dropped']}, up to the horizon"
    doubt = "part of that change that may be due to errors of the time integration"
    words = "time up to which the members of both variants are one motion each; nan: they always are"
    return result.assign(
        early=(dims, early[:, :, 0], {"long_name": change}),
        early_uncertainty=(dims, early[:, :, 1], {"long_name": doubt}),
        horizon=(("effect",), [horizon for horizon, _ in begun], {"units": "s", "long_name": words}),
    )


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


def table(dataset: xr.Dataset) -> Table:
    """Tabulate the change of each quantity by removal and addition of each effect; and the strongest interactions."""
    rows, horizon = [], dataset["horizon"].values
    until = ["dropped, up to the horizon"] if np.isfinite(horizon).any() else []
    for k, quantity in enumerate(dataset["quantity"].values):
        unit = str(dataset["unit"].values[k])
        for i, effect in enumerate(dataset["effect"].values):
            reached = f" to {in_unit(horizon[i], 's')}" if np.isfinite(horizon[i]) else ""
            finite = np.isfinite(dataset["early"].values[i, k])
            cells = [f"{cell(dataset, 'early', (i, k), unit)}{reached if finite else ''}" for _ in until]
            cells += [cell(dataset, name, (i, i, k), unit) for name in ("dropped", "added")]
            rows.append((str(quantity), str(effect), *cells, *_partner(dataset, i, k, unit)))
    notes = [
        "Dropped: largest change of the quantity over the run when the effect is removed from the full scene. Added: "
        "when it is added to the bare scene (friction: to the one with its clearance). Interaction: change by both "
        "effects together minus the sum of their single changes.",
        "For runs with contacts, the number after ± may be due to chance (Student's t of the members' means).",
    ]
    notes += [f"Refused: {line}" for line in filter(None, dataset.attrs["refused"].split("\n"))]
    notes += [MEANING_NOT_COMPARABLE] if any(NOT_COMPARABLE in row for row in rows) else []
    notes += filter(None, [dataset.attrs.get("staying")])
    notes += ["Up to the horizon all runs of a variant are one motion."] if until else []
    columns = ("quantity", "effect", *until, "dropped", "added", "interaction", "with")
    return Table("Effect sizes", columns, tuple(rows), tuple(notes))


def _partner(dataset: xr.Dataset, i: int, k: int, unit: str) -> tuple[str, str]:
    """Return the strongest interaction of an effect, and the name of its partner."""
    sizes = dataset["interaction"].values[i, :, k]
    finite = np.where(np.isfinite(sizes), sizes, -1.0)
    if not len(finite) or finite.max() < 0.0:
        return "–", "–"
    j = int(np.argmax(finite))
    return cell(dataset, "interaction", (i, j, k), unit), str(dataset["effect"].values[j])


def cell(dataset: xr.Dataset, name: str, at: tuple[int, ...], unit: str) -> str:
    """Format an effect size of a dataset with its uncertainty."""
    value, uncertainty = (float(dataset[part].values[at]) for part in (name, f"{name}_uncertainty"))
    return _cell(value, uncertainty, unit)


def _cell(value: float, uncertainty: float, unit: str) -> str:
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

    Uses `dropped` and, where they exist, `added` or `early`, of single effects.
    """
    from matplotlib.ticker import NullFormatter

    from flexclear.post.plotting import style

    if "other" in dataset.dims:
        diagonal = xr.DataArray(np.arange(dataset.sizes["effect"]), dims="effect")
        dataset = dataset.isel(effect=diagonal, other=diagonal)
    names = [str(effect) for effect in dataset["effect"].values]
    chosen = [str(quantity) for quantity in dataset["quantity"].values]
    early = "added" not in dataset and "early" in dataset and bool(np.isfinite(dataset["horizon"].values).any())
    kinds = [kind for kind in ("dropped", "added", "early") if kind in dataset and (early or kind != "early")]
    with style.set_style():
        figure, axes = style.panels(len(chosen), min(2, len(chosen)), 10.0, 1.1, 0.9 + 0.3 * len(names), sharey=True)
        for k, panel in enumerate(axes):
            for n, kind in enumerate(kinds):
                values, unit = dataset[kind].values[:, k], str(dataset["unit"].values[k])
                by_chance = np.nan_to_num(dataset.get(f"{kind}_uncertainty", 0.0 * dataset[kind]).values[:, k])
                rows = np.arange(len(names)) + 0.36 * (n - 0.5 * (len(kinds) - 1))
                shown = np.where(np.isfinite(values) & (values > 0.0), values, np.nan)
                panel.barh(rows, shown, 0.34, label=LEGEND[kind], color=("#0072B2", "#E69F00")[n])
                drawn = np.isfinite(shown) & (by_chance > 0.0)
                # 0.9: the error bar goes back over at most this fraction of a bar, since the axis is logarithmic
                ends = [np.minimum(by_chance, 0.9 * shown)[drawn], by_chance[drawn]]
                panel.errorbar(
                    shown[drawn], rows[drawn], xerr=ends, fmt="none", ecolor="#222222", elinewidth=0.9, capsize=2
                )
                for y, value, chance in zip(rows, values, by_chance, strict=True):
                    text = "not examined" if np.isnan(value) else _cell(value, chance, unit)
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
