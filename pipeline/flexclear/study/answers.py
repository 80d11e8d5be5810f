"""Three answers about a scene: what accuracy costs, whether its run is stable, which effects matter.

Runs within one budget of processor time give the answers: an eighth at most for the costs of accuracy, what is left for
the effects, which take as many runs as there are effects and members. Without a given budget effects are compared with
the fewest members, since they are decided up to the horizon and the answer names the members for more. Stability is
judged from the scene's run and from the runs that measured the costs of accuracy.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

from flexclear.post.pages import prose
from flexclear.stages import scenes
from flexclear.stages.graph import Graph
from flexclear.stages.workplace import Made, Workplace, open_workplace, seconds
from flexclear.study import cost, effects
from flexclear.study.members import MEMBERS, Budget, comparing_task
from flexclear.system.errors import SolverError

if TYPE_CHECKING:
    import xarray as xr

    from flexclear.scene.schema import Scene

#: fractions of the budget that the costs of accuracy may take: next to effects, and of the default one without effects
ACCURACY, ALONE = 0.125, 0.5
#: default budget: so many times the processor time of the scene's own run, and at least so long [s]
TIMES, LEAST = 6.0, 60.0


@dataclass(frozen=True)
class ShownAnswer:
    """An answer as a page shows it: heading, text, file name of its picture with a caption, and a table as HTML."""

    heading: str
    text: str
    picture: str
    caption: str
    table: str = ""


def shown_answer(name: str, answer: Made, scene: Scene) -> ShownAnswer:
    """Return heading, text, picture and table of the answer called accuracy, stability or effects."""
    from flexclear.post.answers import effect_answer
    from flexclear.post.cost.study import sentences

    data = answer.dataset()
    if name == "accuracy":
        caption = "Error of each quantity against processor time"
        return ShownAnswer("Accuracy against cost", sentences(data), f"{cost.FIGURE}.png", caption)
    if name == "stability":
        columns = ("value", "limit", "verdict", "remedy")
        rows = [[str(c), *(str(data[n].sel(check=c).item()) for n in columns)] for c in data["check"].values]
        caption = "Errors of energy and loops over time, and their limits"
        table = prose(("check", *columns), rows)
        return ShownAnswer("Is the integration stable", data.attrs["answer"], "stability.png", caption, table)
    asked = scene.accuracy.quantities if scene.accuracy is not None else {}
    requested = {n: w.absolute for n, w in asked.items() if w.absolute is not None}
    caption = "Change of each quantity without the effect; thin lines: part that may be due to chance"
    text, table = effect_answer.sentence(data, requested), scenes.tables(answer, "effects.md")
    return ShownAnswer("Which effects matter", text, "effects.png", caption, table)


def dataset(name: str, scene: Scene, budget: str | float | None, *, of: Sequence[str] = ()) -> xr.Dataset:
    """Return one of the three answers, or the whole study "cost", as a dataset that shows the answer in a notebook.

    budget: processor time [s], or text such as "2min"; without it effects are also added, and combined in pairs.  of:
    as of `Answers`. Raises as `answer_of`.
    """
    from flexclear.post.answers.answered import with_answer

    workplace, given = open_workplace(), None if budget is None else seconds(budget, "budget")
    if name != "effects" or given is not None:
        workplace = replace(workplace, jobs=1)  # in this process: a worker would run a caller's script again
    if name == "cost":
        name, answer = "accuracy", cost.measure_costs(scene, workplace, budget=given or cost.BUDGET)
    else:
        answer = answer_of(name, scene, workplace, given, of)
    words = shown_answer(name, answer, scene)
    picture = answer.read(words.picture) if words.picture in answer.record.files else None
    return with_answer(answer.dataset(), words.text, picture, words.table)


def answer_of(
    name: str,
    scene: Scene,
    workplace: Workplace,
    budget: float | None,
    of: Sequence[str] = (),
    members: int = MEMBERS[0],
) -> Made:
    """Return the answer called stability or effects, for the whole budget of processor time [s]; of: as of `Answers`.

    Without a budget effects are also added, and combined in pairs, over this number of members. Raises InputError for a
    scene without effects or watched quantities.
    """
    if name == "effects" and budget is None:
        return effects.examine_effects(scene, workplace, (members,), of, pairs=True)
    answer: Made = getattr(Answers(scene, workplace, budget, 1, of), name)
    return answer


@dataclass(frozen=True)
class Answers:
    """The three answers about a scene, each computed at its first use.

    seconds: processor time of the runs; by default TIMES that of the scene's own run, and at least LEAST. questions:
    number of answers that take runs, the costs of accuracy and the effects; 0: only stability is judged. of: names of
    effects or parts, as of `variants.effects_of`.
    """

    scene: Scene
    workplace: Workplace
    seconds: float | None = None
    questions: int = 2
    of: Sequence[str] = ()

    @cached_property
    def _study_of_own_run(self) -> cost.Study:
        """Return the study with the scene's own run measured, and with the budget that follows from that run."""
        study = cost.Study(self.scene, self.workplace, Budget(self.seconds or LEAST))
        study.begin()
        study.budget.seconds = self.seconds or max(LEAST, TIMES * study.own * study.seconds_each)
        return study

    @cached_property
    def _study(self) -> cost.Study:
        """Return the study with the points in the neighbourhood of the scene's own setting."""
        study, part = self._study_of_own_run, ALONE if self.seconds is None else 1.0
        part = ACCURACY if self.questions > 1 else part
        study.measure_neighbours(part)
        return study

    @cached_property
    def accuracy(self) -> Made:
        """Return what accuracy costs (`stages.studies`); raise SolverError where no run succeeds."""
        return self.workplace.made(self._study.task())[0]

    @cached_property
    def stability(self) -> Made:
        """Return the verdict on stability (`stages.evaluation`), which also uses the runs of the costs of accuracy."""
        try:
            study = {"study": self._study.task()} if self.questions else {}
        except SolverError:
            study = {}
        graph = Graph(self.scene, shown=False)
        inputs = {"run": graph.simulate, **study, **({"post": graph.post} if graph.ensemble else {})}
        params = {"by_need": self.scene.by_need()}
        task = comparing_task("stability", self.scene.name, params, inputs, "evaluation:stability")
        return self.workplace.made(task)[0]

    @cached_property
    def effects(self) -> Made:
        """Return which effects matter (`effects.examine_effects`), which raises InputError."""
        study, levels = self._study_of_own_run, MEMBERS[:1] if self.seconds is None else MEMBERS
        own = study.setting, study.own * study.seconds_each
        return effects.examine_effects(self.scene, self.workplace, levels, self.of, own=own, budget=study.budget)
