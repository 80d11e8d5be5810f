"""Verdicts on the statements of the paper's section 6."""

from __future__ import annotations

import csv
from collections.abc import Callable, Mapping, Sequence
from functools import partial

import numpy as np

from flexclear.publishing import Table
from papers import PROJECT, rows
from papers.comparison import HOLDS, NOT, Data, Outcome, drawn, verdict, verdict_table
from papers.wang_wang_2019 import deviations
from papers.wang_wang_2019 import models as paper
from papers.wang_wang_2019.deviations import SEPARATION, SLIGHT, difference
from papers.wang_wang_2019.figures.errors import NOISE
from papers.wang_wang_2019.figures.table10 import evaluations
from papers.wang_wang_2019.models import mode_set
from papers.wang_wang_2019.published import TABLE10

#: verdicts on the repeated stroke, which take two hours and are stored in the repository (`make chaos`)
SECTIONS = "docs/chaos/verdicts.csv"
#: largest fraction of "no influence"; SLIGHT is the largest one of a slight effect, and of answers that agree
SMALL = 0.05
#: factor within which a cost agrees with the paper's
NEAR = 1.5
#: fractions below this are rounding of the runs
ROUNDING = 1e-9


@drawn(
    "Verdicts (added): what the paper states in section 6, and whether it holds here",
    *paper.references((paper.IDEAL, *paper.FAR, paper.CSJ, *paper.FIRST), "run", "post"),
    *paper.references(paper.FAR_CSJ, "post", "ensemble"),
    "sps4:timing",
    files=(SECTIONS,),
)
def verdicts(data: Data) -> Table:
    """Tabulate each statement with the verdict of its test."""
    notes = (
        f"Slight: below {100 * SLIGHT:g} % of the ideal model's largest value; no influence: below {100 * SMALL:g} %. "
        f"Of ensembles the mean over the members, which differ where they do by more than {100 * SLIGHT:g} % and "
        f"{SEPARATION:g} standard deviations. Costs agree where evaluations, which do not depend on the "
        f"machine, are within a factor of {NEAR:g} of the paper's ratio of times. In brackets: numbers of the "
        "layout assumed before one was identified from Table 8; the verdict is on the others. The prismatic joint is "
        "at the rod's lower end here; [reference-conditions.md](reference-conditions.md) judges mode sets at other "
        "positions, over layouts of the mechanism, and against the full rod, [chaos.md](chaos.md) the motion under a "
        "repeated stroke, [geometry.md](geometry.md) what Table 8 says of the joint coordinates. Tables 4 "
        "and 5 have verdicts of their own below them.",
    )
    return verdict_table("Verdicts on the paper's statements (added)", STATEMENTS, TESTS, data, notes)


def _same_motion(data: Data) -> Outcome:
    own = deviations.sizes(data)
    fractions = [max(deviations.moved(data, model).over(own)) for model in paper.FAR]
    text = f"angle, displacement and velocity change by {100 * max(fractions):.1g} % of their largest values at most"
    return verdict(*(s < SMALL for s in fractions)), text


def _same_acceleration(data: Data) -> Outcome:
    largest = deviations.acceleration(data, paper.IDEAL)
    changes = {mode_set(m): difference(data, m, deviations.vertical).max() / largest for m in paper.FAR}
    text = _listed({name: fraction for name, fraction in changes.items() if fraction > ROUNDING}) or "nothing"
    return verdict(*(change < SMALL for change in changes.values())), f"it changes by {text} of the largest"


def _listed(fractions: Mapping[str, float]) -> str:
    return ", ".join(f"{100 * fraction:.2g} % ({name})" for name, fraction in fractions.items())


def _same_path(data: Data, models: Sequence[paper.Model]) -> Outcome:
    """Judge whether the ball's centre stays close to the ideal model's, as a fraction of that one's path."""
    ideal = deviations.ball_centre(data[f"{paper.IDEAL.scene}:run"])
    stroke = float(np.linalg.norm(ideal - ideal[0], axis=1).max())
    off = {m: float(np.linalg.norm(difference(data, m, deviations.ball_centre), axis=1).max()) for m in models}
    lengths = {m: f"{1e3 * far:.2g} mm" if 1e3 * far > NOISE else "nothing" for m, far in off.items()}
    words = ", ".join(f"{mode_set(model) or model.label} {length}" for model, length in lengths.items())
    numbers = f"off by {words} at most, of a path that goes {1e3 * stroke:.0f} mm far"
    return verdict(*(far < SMALL * stroke for far in off.values())), numbers


def _other_path(data: Data) -> Outcome:
    """Judge the contrary statement by the same numbers."""
    verdict, numbers = _same_path(data, [paper.CSJ])
    return {HOLDS: NOT, NOT: HOLDS}[verdict], f"{numbers}: by the measure of the platform's displacement no influence"


def _slight_vibration(data: Data) -> Outcome:
    ideal = deviations.reaction(data, paper.IDEAL)
    reactions = {m: deviations.reaction(data, m) for m in paper.FAR}
    text = ", ".join(f"{mode_set(m)} {force:.0f} N" for m, force in reactions.items())
    return verdict(*(force / ideal - 1.0 < SLIGHT for force in reactions.values())), f"ideal {ideal:.0f} N; {text}"


def _consistent(data: Data) -> Outcome:
    free, fixed, full = (deviations.effects(data, model) for model in (paper.FAR_FREE, paper.FAR_FIXED, paper.FAR_CB))
    fractions = {name: abs(free[name] - fixed[name]) / size for name, size in full.items() if size > 0.0}
    missed = max(free["velocity"], fixed["velocity"]) < SLIGHT * full["velocity"]
    return verdict(*(fraction < SLIGHT for fraction in fractions.values())), (
        f"they differ by {_listed(fractions)} of the effect that a basis with all static compliance finds"
        f"{'; of that on the velocity both miss nearly all' if missed else ''}"
    )


def _free_suitable(data: Data) -> Outcome:
    free, full = deviations.moved(data, paper.FAR_FREE).velocity, deviations.moved(data, paper.FAR_CB).velocity
    return verdict(abs(free / full - 1.0) < SLIGHT), (
        f"free-free modes find {1e3 * free:.2g} mm/s of the {1e3 * full:.2g} mm/s that a basis with all static "
        "compliance finds"
    )


def _in_both_layouts(data: Data, outcome: Callable[[Data, paper.Model, paper.Model], Outcome]) -> Outcome:
    """Return the outcome in the scenes' layout, with the first layout's numbers after it."""
    verdict, numbers = outcome(data, paper.CSJ, paper.IDEAL)
    return verdict, f"{numbers} ({outcome(data, paper.FIRST_CSJ, paper.FIRST_IDEAL)[1]})"


def _no_influence(data: Data, csj: paper.Model, ideal: paper.Model) -> Outcome:
    angle, displacement, _ = deviations.moved(data, csj, ideal).over(deviations.sizes(data, ideal))
    text = f"angle {100 * angle:.1f} %, displacement {100 * displacement:.1f} %"
    return verdict(angle < SMALL, displacement < SMALL), text


def _velocity_free(data: Data, csj: paper.Model, ideal: paper.Model) -> Outcome:
    *_, fraction = deviations.moved(data, csj, ideal).over(deviations.sizes(data, ideal))
    return verdict(fraction < SMALL), f"{100 * fraction:.1f} % of the largest velocity"


def _conspicuous(data: Data, csj: paper.Model, ideal: paper.Model) -> Outcome:
    (force, acceleration), (base, base_acceleration) = (deviations.peaks(data, model) for model in (csj, ideal))
    return verdict(force > 2.0 * base, acceleration > 2.0 * base_acceleration), (
        f"force {base:.0f} to {force:.0f} N, acceleration {base_acceleration:.0f} to {acceleration:.0f} m/s²"
    )


def _lowered(data: Data) -> Outcome:
    peaks = {model: deviations.peaks(data, model) for model in paper.FAR_CSJ}
    rigid = deviations.peaks(data, paper.CSJ)
    text = "; ".join(f"{mode_set(m)} {force:.0f} N, {a:.0f} m/s²" for m, (force, a) in peaks.items())
    tests = [force < rigid[0] and a < rigid[1] for force, a in peaks.values()]
    return verdict(*tests), f"CSJ {rigid[0]:.0f} N, {rigid[1]:.0f} m/s²; {text}"


def _motion_kept(data: Data) -> Outcome:
    """Judge whether angle and displacement are those of the ideal model and independent of the mode set."""
    moved, own = {model: deviations.moved(data, model) for model in paper.FAR_CSJ}, deviations.sizes(data)
    largest = np.max([one.over(own) for one in moved.values()], axis=0)
    sets = [abs(ratio - 1.0) for ratio in moved[paper.FAR_CSJ_FREE].over(moved[paper.FAR_CSJ_FIXED])]
    return verdict(*(s < SMALL for s in largest), *(s < SLIGHT for s in sets)), (
        f"angle {100 * largest[0]:.1f} %, displacement {100 * largest[1]:.1f} %, velocity {100 * largest[2]:.1f} % off "
        f"the ideal model; between free-free and fixed-fixed modes these differ by {100 * max(sets):.2g} % at most"
    )


def _paths_differ(data: Data) -> Outcome:
    """Judge the ball's path in the socket by statistics of the members, which are valid beyond the horizon."""
    free, fixed = (
        data[f"{model.scene}:ensemble"].sel(contact=paper.JOINT) for model in (paper.FAR_CSJ_FREE, paper.FAR_CSJ_FIXED)
    )
    names = {"impact_count": ("impacts", 1.0), "contact_time_share": ("% of the time in contact", 100.0)}
    tests = [deviations.differ(free[name].values, fixed[name].values) for name in names]
    texts = [
        f"{factor * free[n].mean():.0f} ± {factor * free[n].std(ddof=1):.0f} and "
        f"{factor * fixed[n].mean():.0f} ± {factor * fixed[n].std(ddof=1):.0f} {words}"
        for n, (words, factor) in names.items()
    ]
    return verdict(*tests), f"free-free and fixed-fixed: {'; '.join(texts)}"


def _dashpot(data: Data) -> Outcome:
    """Judge the vibration: root mean square of the platform's acceleration minus the ideal one, at the outputs."""
    ideal = deviations.vertical(data[f"{paper.IDEAL.scene}:run"])
    rigid = float(np.sqrt(np.mean(difference(data, paper.CSJ, deviations.vertical) ** 2)))
    rows = {}
    for model in paper.FAR_CSJ:
        members = data[f"{model.scene}:ensemble"].acceleration.sel(body=paper.PLATFORM, axis="z").values
        rows[model] = float(np.sqrt(np.mean((members - ideal) ** 2, axis=1)).mean())
    count = {m: float(data[f"{m.scene}:ensemble"].impact_count.sel(contact=paper.JOINT).mean()) for m in paper.FAR_CSJ}
    text = "; ".join(f"{mode_set(m)} {rows[m]:.0f} m/s² and {count[m]:.0f} impacts" for m in paper.FAR_CSJ)
    impacts = int(data[f"{paper.CSJ.scene}:post"].impact_count.sel(contact=paper.JOINT))
    return verdict(*(size < rigid for size in rows.values())), (
        f"vibration CSJ {rigid:.0f} m/s² and {impacts} impacts; "
        f"{text}; without structural damping the rod takes no energy out of the mechanism"
    )


def _sets_differ(data: Data) -> Outcome:
    free, fixed = (deviations.peaks(data, model) for model in (paper.FAR_CSJ_FREE, paper.FAR_CSJ_FIXED))
    force, acceleration = (abs(a / b - 1.0) for a, b in zip(free, fixed, strict=True))
    text = f"by {100 * force:.0f} % in force, {100 * acceleration:.0f} % in acceleration"
    return verdict(force > SLIGHT, acceleration > SLIGHT), text


def _fixed_right(data: Data) -> Outcome:
    *peaks, best = (deviations.peaks(data, model) for model in paper.FAR_CSJ)
    free, fixed = ([own / of - 1.0 for own, of in zip(one, best, strict=True)] for one in peaks)
    return verdict(*(abs(b) < abs(a) for a, b in zip(free, fixed, strict=True))), (
        f"against all static compliance: free-free {100 * free[0]:+.0f} % (force), {100 * free[1]:+.0f} % "
        f"(acceleration); fixed-fixed {100 * fixed[0]:+.0f} %, {100 * fixed[1]:+.0f} %"
    )


def _clearance_dominates(data: Data) -> Outcome:
    parts = deviations.moved(data, paper.FAR_CB).over(deviations.moved(data, paper.CSJ))
    return verdict(*(s < SLIGHT for s in parts)), (
        f"the rod's part of the clearance's: angle {100 * parts[0]:.2g} %, displacement {100 * parts[1]:.2g} %, "
        f"velocity {100 * parts[2]:.2g} %"
    )


def _enlarged(data: Data) -> Outcome:
    rigid = deviations.moved(data, paper.CSJ)
    rises = {m: [ratio - 1.0 for ratio in deviations.moved(data, m).over(rigid)] for m in paper.FAR_CSJ}
    texts = [f"{mode_set(m)} " + ", ".join(f"{100 * r:+.1f} %" for r in rise) for m, rise in rises.items()]
    return verdict(*(min(rise) > 0.0 for rise in rises.values())), f"angle, displacement, velocity: {'; '.join(texts)}"


def _costs(data: Data, models: Sequence[paper.Model]) -> Outcome:
    """Judge whether evaluations over the ideal model's are as the paper's times, at each setting of Table 10."""
    tests, words = [], []
    for setting, name in (("equal", "equal error"), ("step", "the paper's step"), ("tolerance", "its tolerance")):
        costs = {m: evaluations(data["sps4:timing"], setting).get(m.scene, np.nan) for m in models}
        tests.append(all(1.0 / NEAR < ratio / TABLE10[m.scene] < NEAR for m, ratio in costs.items()))
        texts_by_model = {m: f"{ratio:.3g}" if np.isfinite(ratio) else "fails" for m, ratio in costs.items()}
        words.append(f"{name}: " + ", ".join(f"{mode_set(m) or m.label} {text}" for m, text in texts_by_model.items()))
    printed = ", ".join(f"{TABLE10[m.scene]:g}" for m in models)
    return verdict(*tests), f"printed times {printed}; evaluations at {'; at '.join(words)}"


def _becomes_chaotic(data: Data) -> Outcome:
    """Judge whether clearance makes the periodic motion quasi-periodic, and the rod's modes make it chaotic."""
    if not (PROJECT / SECTIONS).is_file():
        return _one_stroke(data)
    with (PROJECT / SECTIONS).open(newline="", encoding="utf-8") as file:
        rows = {row["scene"]: row for row in csv.DictReader(file)}
    requested = {paper.CSJ: "quasi-periodic", **dict.fromkeys(paper.FAR_CSJ, "chaotic")}
    texts = [f"{mode_set(model) or model.label} {_motion(rows[model.scene])}" for model in requested]
    return verdict(*(rows[model.scene]["verdict"] == motion for model, motion in requested.items())), (
        f"over {rows[paper.CSJ.scene]['periods']} repeated strokes: {'; '.join(texts)} (chaos.md)"
    )


def _motion(row: Mapping[str, str]) -> str:
    """Return a verdict, for chaotic motion with the largest Lyapunov exponent."""
    if row["verdict"] != "chaotic":
        return row["verdict"]
    return f"chaotic ({row['exponent']} 1/s, 95 %: {row['exponent_low']} to {row['exponent_high']})"


def _one_stroke(data: Data) -> Outcome:
    end = float(data[f"{paper.CSJ.scene}:run"].time.values[-1])
    horizon = float(data[f"{paper.CSJ.scene}:post"].horizon)
    parts = [1e3 * float(data[f"{m.scene}:post"].ensemble_horizon) for m in paper.FAR_CSJ]
    return "cannot be determined from one stroke", (
        f"neighbours of the CSJ run stay together to {1e3 * horizon:.0f} of {1e3 * end:.0f} ms; of the undamped "
        f"FAR-CSJ runs they part after {min(parts):.0f} to {max(parts):.0f} ms. Sections of a repeated stroke: chaos.md"
    )


#: statements of the paper: name of the test, where the paper states it, and its words
STATEMENTS = rows("""
same motion | 6.2.1, Fig. 11(a)-(c) | With ideal joints the rod's flexibility has no effect on angle, displacement and
    velocity
same acceleration | 6.2.1, Fig. 11(d) | With ideal joints the rod's flexibility has no effect on the acceleration
slight vibration | 6.2.1, Fig. 11(e) | The reaction at A1 differs slightly, by a vibration
same path | 6.2.1, Fig. 11(f) | With ideal joints the path of the ball's centre is almost the same
consistent | 6.2.1, Table 7 | Free-free and fixed-fixed modes give the same with ideal joints
free suitable | 6.2.1 | Free-free modes give the right solution where there is no clearance
no influence | 6.2.2, Fig. 12(a), (b) | Clearance has almost no influence on trajectory and displacement
velocity free | 6.2.2, Fig. 12(c) | The velocity does not suffer from clearance
conspicuous | 6.2.2, Fig. 12(d), (e) | The effect of clearance on acceleration and force is conspicuous
other path | 6.2.2, Fig. 12(f) | Clearance makes the path of the ball's centre significantly different
motion kept | 6.2.3, Fig. 13(a)-(c), Figs. 14, 15 | With clearance and a flexible rod, angle, displacement and velocity
    stay those of the ideal model, whatever the mode set
sets differ | 6.2.3, Fig. 13(d), (e) | Free-free and fixed-fixed modes differ obviously in force and acceleration
lowered | 6.2.3 | A flexible rod lowers contact force and acceleration
dashpot | 6.2.3, section 7 | The rod is a dashpot that damps the vibration out
fixed right | 6.2.3, section 7 | The right reference conditions, fixed-fixed, must be imposed with clearance
clearance dominates | Tables 7 and 8 | Clearance, not the rod's flexibility, costs the accuracy
enlarged | Tables 8 and 9 | Clearance and a flexible rod together enlarge the errors further
paths differ | Fig. 13(f), Fig. 17 | The ball's path in the socket differs significantly between the mode sets
costs of a rod | 6.2.3, Table 10 | A flexible rod with ideal joints costs hardly more than the ideal model
costs of clearance | 6.2.3, Table 10 | Clearance makes the ideal model twenty times as dear
costs of both | 6.2.3, Table 10 | Clearance and a flexible rod together make it forty times as dear
becomes chaotic | Fig. 16 | The motion changes from periodic to quasi-periodic and chaotic
""")
TESTS: dict[str, Callable[[Data], Outcome]] = {
    "same motion": _same_motion,
    "same acceleration": _same_acceleration,
    "slight vibration": _slight_vibration,
    "same path": partial(_same_path, models=paper.FAR),
    "consistent": _consistent,
    "free suitable": _free_suitable,
    "no influence": partial(_in_both_layouts, outcome=_no_influence),
    "velocity free": partial(_in_both_layouts, outcome=_velocity_free),
    "conspicuous": partial(_in_both_layouts, outcome=_conspicuous),
    "other path": _other_path,
    "motion kept": _motion_kept,
    "sets differ": _sets_differ,
    "lowered": _lowered,
    "dashpot": _dashpot,
    "fixed right": _fixed_right,
    "clearance dominates": _clearance_dominates,
    "enlarged": _enlarged,
    "paths differ": _paths_differ,
    "costs of a rod": partial(_costs, models=(paper.FAR_FREE, paper.FAR_FIXED)),
    "costs of clearance": partial(_costs, models=(paper.CSJ,)),
    "costs of both": partial(_costs, models=(paper.FAR_CSJ_FREE, paper.FAR_CSJ_FIXED)),
    "becomes chaotic": _becomes_chaotic,
}
