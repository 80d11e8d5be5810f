"""``flexclear plan``: effects, modes and tolerance that a scene's requested accuracy requires, with the evidence."""

from __future__ import annotations

import json
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from flexclear.artifacts.store import publish
from flexclear.post.plotting.table import as_html, as_markdown
from flexclear.scene import variants
from flexclear.scene.load import edited, load_scene
from flexclear.scene.quantity import parse
from flexclear.scene.units import quantity as number
from flexclear.scene.variants import without_parts
from flexclear.stages import effect_plan, scenes
from flexclear.stages.workplace import Made, Workplace, open_workplace, seconds
from flexclear.study.members import MEMBERS, Budget, Members
from flexclear.system.errors import InputError, SolverError

if TYPE_CHECKING:
    import xarray as xr

    from flexclear.artifacts.points import Point
    from flexclear.scene.schema import Scene

#: ending of a planned scene's file, after the scene's name
SUFFIX = ".planned.toml"
#: budget of `--verify` [s]
BUDGET = 60.0
#: accuracy that is planned for a scene without `[accuracy]`, as a fraction of each watched quantity's size
LEVEL = "1 %"


def with_accuracy(scene: Scene, level: str) -> Scene:
    """Return the scene with one accuracy of all its watched quantities, as a fraction of their sizes."""
    try:
        fraction = number(level, "number")
        if not 0.0 < fraction < 1.0:
            raise ValueError("it must be above 0 and below 1")
    except ValueError as error:
        raise InputError(f"accuracy {level}", f"is no fraction: {error}", "write a number with %, as '1 %'") from None
    chosen = {quantity.name: {"relative": fraction} for quantity in scene.watched_quantities()}
    if not chosen:
        raise InputError(str(scene.path or scene.name), "watches no quantity", "name quantities in [view] watch")
    asked = edited(scene, {"accuracy": chosen})
    asked._name = f"{scene.name} to {level.replace(' ', '')}"
    return asked


class Result(NamedTuple):
    """A plan in a notebook: its answer, then the planned scene."""

    planned: Scene
    evidence: xr.Dataset

    def _repr_html_(self) -> str:
        return f"{self.evidence._repr_html_()}{self.planned._repr_html_()}"


def dataset(scene: Scene, level: str | None, budget: str | float | None) -> Result:
    """Return the planned scene, and the plan as a dataset that shows its answer in a notebook.

    level: as of `make_plan`.  budget: time for `errors_of`
    [s], or text; None leaves the errors out.
    """
    from flexclear.post.answers.answered import with_answer
    from flexclear.post.answers.plan import plan_in_words, verification_table

    workplace = open_workplace()
    planned = make_plan(scene, workplace, level)
    result, table = planned.made.dataset(), scenes.tables(planned.made, "plan.md")
    if budget is not None:
        compared = errors_of(planned, workplace, seconds(budget, "budget"))
        result = result.assign(
            {name: compared[name] for name in ("requested", "error", "chance", "allowed", "horizon", "scatter")}
        )
        table = as_html(verification_table(compared)) + table
    return Result(planned.planned, with_answer(result, plan_in_words(result), planned.made.read("plan.png"), table))


@dataclass(frozen=True)
class Planned:
    """A plan that is up to date. scene: the full one.  planned: the scene with the plan's decisions.

    made: effect sizes, decisions and evidence (`post.answers.plan.dataset`), and the table ``plan.md``.
    """

    scene: Scene
    planned: Scene
    made: Made

    @property
    def target(self) -> Path:
        """Path of the planned scene's file."""
        return self.made.folder / f"{self.scene.name.rpartition('/')[2]}{SUFFIX}"

    def file(self, target: Path) -> bytes:
        """Return the planned scene's file for a given path; it extends the full scene's."""
        assert self.scene.path is not None
        head = (
            "written by flexclear plan",
            "omitted: effects that the requested accuracy of the full scene does not require",
        )
        base = load_scene(self.scene.path)
        return variants.variant_text(base, self.planned, variants.relative_path(target, self.scene.path), head).encode()


def make_plan(scene: Scene, workplace: Workplace, level: str | None = None) -> Planned:
    """Bring the plan of a scene up to date, and write the planned scene's file.

    level: accuracy of all watched quantities that change, in place of the scene's `[accuracy]`, as in `with_accuracy`;
    None for that of the scene, else LEVEL.  Raises InputError for a scene without effects or watched quantities, or
    whose accuracy no plan or every plan meets, and the errors of its runs.
    """
    if scene.accuracy is None or not scene.accuracy.quantities:
        level = level or LEVEL
    scene = scene if level is None else with_accuracy(scene, level)
    where = f"{scene.path or scene.name}"
    if not variants.effects(scene):
        raise InputError(
            where, "has no effect that could be omitted: no clearance, flexible body, friction, gravity or stop"
        )
    (made,) = workplace.made(effect_plan.task(scene, watched=level is not None))
    planned = Planned(scene, planned_scene(scene, made.dataset()), made)
    if scene.path is not None:
        publish(planned.target, planned.file(planned.target))
    return planned


def planned_scene(scene: Scene, plan: xr.Dataset) -> Scene:
    """Apply a plan to a scene: replace and remove parts, set solver and watched quantities."""
    decided = json.loads(plan.attrs["planned"])
    bare = variants.without_effects(scene, variants.effects_by_name(scene, decided["gone"], f"{scene.name} [plan]"))
    fewer = without_parts(variants.with_modes(bare, decided["modes"]), decided["uncoupled"])
    owners = fewer.owners()
    watch = [q.name for q in scene.watched_quantities() if q.is_there(owners)]
    view = bare.view.model_dump(mode="json", exclude_none=True) if bare.view is not None else {}
    solver: dict[str, Any] = {key: decided[key] for key in ("integrator", "rtol", "ledger_tolerance") if key in decided}
    if "evaluations" in scene.solver.model_fields_set:
        solver["evaluations"] = scene.solver.evaluations  # a limit that the scene sets itself
    result = edited(
        fewer,
        {
            "title": f"{scene.title}, as planned",
            "accuracy": None,
            "ensemble": None,
            **({"solver": solver} if "integrator" in decided else {}),  # without a decision the solver stays
            "view": view | {"watch": watch},
        },
    )
    result._name, result._path = f"{scene.name}-planned", None
    return result


def verify(planned: Planned, workplace: Workplace, budget: float = BUDGET) -> list[str]:
    """Run the full and the planned scene, print their differences, and return a sentence for each missed accuracy.

    budget: processor time for members that decide the verdicts [s].
    """
    from flexclear.post.answers.plan import agreement_of, verification_table

    compared = errors_of(planned, workplace, budget)
    print(as_markdown(verification_table(compared)))
    if planned.scene.accuracy is not None and planned.scene.accuracy.allow_missed:
        return []
    verdicts = [agreement_of(compared, k) for k in range(compared.sizes["quantity"])]
    columns = zip(compared["quantity"].values, compared["unit"].values, verdicts, strict=True)
    return [
        f"{planned.scene.name}: the plan misses {name}: {one.error:.3g} instead of {one.allowed:.3g} {unit}"
        for name, unit, one in columns
        if one.is_missed
    ]


def errors_of(planned: Planned, workplace: Workplace, budget: float = BUDGET) -> xr.Dataset:
    """Return the distance of the planned run from the full one by quantity, over members where the scene has contacts.

    Members are added until every verdict is decided, as far as the budget of processor time [s] allows.
    """
    from flexclear.artifacts import effect_size
    from flexclear.post.answers.plan import UNDECIDED, verdict

    assert planned.scene.accuracy is not None
    asked, full = planned.scene.accuracy.quantities, edited(planned.scene, {"accuracy": None})
    result, verdicts = planned.made.dataset()[["requested"]].copy(), list[effect_size.Agreement]()
    chosen = [parse(str(name), planned.scene.owners()) for name in result["quantity"].values]

    def undecided(members: int, points: Mapping[str, Point]) -> Collection[str]:
        one, two = points["full"], points["planned"]
        for what, point in points.items():
            if point.refused:
                raise SolverError(f"{planned.scene.name}: the {what} run is refused: {point.refused}")
        for k, q in enumerate(chosen):
            relative = asked[q.name].relative
            if relative is not None:  # the size of the quantity is known now
                result["requested"][k] = relative * effect_size.reference_size(one, q)
        result["scatter"] = (("quantity",), [effect_size.scatter(one, q) for q in chosen])
        result.attrs |= {"full_evaluations": one.evaluations, "planned_evaluations": two.evaluations}
        requested = map(float, result["requested"].values)
        verdicts[:] = [effect_size.agreement(two, one, q, members, r) for q, r in zip(chosen, requested, strict=True)]
        return points if any(verdict(one) == UNDECIDED for one in verdicts) else ()

    loose = planned.scene.contacts() or planned.scene.stops()
    runs = Members(workplace, chosen, Budget(budget))
    both = {"full": full, "planned": planned.planned}
    members = runs.until_decided(both, MEMBERS if loose else MEMBERS[:1], undecided)["planned"]
    for name in ("error", "chance", "allowed", "horizon"):
        result[name] = (("quantity",), [getattr(one, name) for one in verdicts])
    return result.assign_attrs(members=members if loose else 0)
