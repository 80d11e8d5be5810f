"""Three answers about a scene: what accuracy costs, whether its run is stable, which effects matter.

Runs within one budget of processor time give the answers: a quarter at most for the costs of accuracy, what is left of
it for the effects, which take as many runs as there are effects and members. Stability is judged from the scene's run
and from the runs that measured the costs of accuracy.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import accumulate
from typing import TYPE_CHECKING

from flexclear.post.pages import prose
from flexclear.scene import variants
from flexclear.scene.variants import CLEARANCE, FLEXIBILITY, Effect
from flexclear.stages import effect_study, scenes
from flexclear.stages.graph import Graph
from flexclear.stages.workplace import Made, Workplace, open_workplace, seconds
from flexclear.study import cost
from flexclear.study.members import Members, with_setting
from flexclear.system.errors import InputError, SolverError
from flexclear.workflow.task import Task

if TYPE_CHECKING:
    import xarray as xr

    from flexclear.artifacts.points import Point
    from flexclear.scene.quantity import Quantity
    from flexclear.scene.schema import Scene

#: fraction of the budget of both that the costs of accuracy may take
ACCURACY = 0.25
#: default budget: so many times the processor time of the scene's own run, and at least so long [s]
TIMES, LEAST = 3.0, 30.0
#: number of variants that are run and compiled concurrently
AT_ONCE = 2.0
#: numbers of members with which effects are compared; within a given budget they rise until the difference is decided,
#: else the first one does, since effects are decided up to the horizon and the answer names the members for more
MEMBERS = (4, 8, 16, 32)
#: name of the effect that comprises all clearances and flexible bodies, as in `post.answers.effect_ranking`
IDEAL = "clearance and flexibility"


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
    from flexclear.post.answers import effect_ranking
    from flexclear.post.cost.answer import sentences

    data = answer.dataset()
    if name == "accuracy":
        caption = "Error against processor time; the star is this scene"
        return ShownAnswer("Accuracy against cost", sentences(data), "accuracy.png", caption)
    if name == "stability":
        columns = ("value", "limit", "verdict", "remedy")
        rows = [[str(c), *(str(data[n].sel(check=c).item()) for n in columns)] for c in data["check"].values]
        caption = "Errors of energy and loops over time, and their limits"
        table = prose(("check", *columns), rows)
        return ShownAnswer("Is the integration stable", data.attrs["answer"], "stability.png", caption, table)
    asked = scene.accuracy.quantities if scene.accuracy is not None else {}
    requested = {n: w.absolute for n, w in asked.items() if w.absolute is not None}
    caption = "Change of each quantity without the effect; thin lines: part that may be due to chance"
    text, table = effect_ranking.sentence(data, requested), scenes.tables(answer, "effect_ranking.md")
    return ShownAnswer("Which effects matter", text, "effect_ranking.png", caption, table)


def dataset(
    name: str, scene: Scene, budget: str | float | None, *, models: bool = False, of: Sequence[str] = ()
) -> xr.Dataset:
    """Return one of the three answers, or the whole study "cost", as a dataset that shows the answer in a notebook.

    budget: processor time [s], or text such as "2min".  models: as in `cost.bring`, for the study.  of: as of
    `Answers`. Raises as `answer_of`.
    """
    from flexclear.post.answers.answered import answered

    # in this process: a worker would run a caller's script again from its top
    workplace, given = replace(open_workplace(), jobs=1), None if budget is None else seconds(budget, "budget")
    if name == "cost":
        name, answer = "accuracy", cost.bring(scene, workplace, budget=given or cost.BUDGET, models=models)
    else:
        answer = answer_of(name, scene, workplace, given, of)
    words = shown_answer(name, answer, scene)
    picture = answer.read(words.picture) if words.picture in answer.record.files else None
    return answered(answer.dataset(), words.text, picture, words.table)


def answer_of(name: str, scene: Scene, workplace: Workplace, budget: float | None, of: Sequence[str] = ()) -> Made:
    """Return the answer called stability or effects, for the whole budget of processor time [s]; of: as of `Answers`.

    Raises InputError for a scene without effects or watched quantities.
    """
    answer: Made | None = getattr(Answers(scene, workplace, budget, 1, of), name)
    if answer is None:
        raise InputError(str(scene.path or scene.name), "has no effect that can be removed, or [view] watch is empty")
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
    def _started(self) -> cost.Study:
        """Return the study with the scene's own run measured, and with the budget that follows from that run."""
        study = cost.Study(self.scene, self.workplace, self.seconds or LEAST)
        study.begin()
        study.seconds = self.seconds or max(LEAST, TIMES * study.own * study.seconds_each)
        return study

    @cached_property
    def _study(self) -> cost.Study:
        """Return the study with the points in the neighbourhood of the scene's own setting."""
        study = self._started
        study.reserve = study.seconds * (1.0 - ACCURACY) if self.questions > 1 else 0.0
        study.first()
        study.neighbourhood()
        return study

    @cached_property
    def accuracy(self) -> Made:
        """Return what accuracy costs (`stages.cost_study`); raise SolverError where no run succeeds."""
        return self.workplace.made(self._study.task())[0]

    @cached_property
    def stability(self) -> Made:
        """Return the verdict on stability (`stages.evaluation`), which also uses the runs of the costs of accuracy."""
        try:
            study = {"study": self._study.task()} if self.questions else {}
        except SolverError:
            study = {}
        graph = Graph(self.scene, shown=False)
        members = {"post": graph.post} if graph.ensemble else {}
        task = Task(
            stage="stability",
            scene=self.scene.name,
            run="flexclear.stages.evaluation:stability",
            params={"by_need": self.scene.by_need()},
            inputs={"run": graph.simulate, **study, **members},
            code=("flexclear.post",),
            folder=f"stability/{self.scene.name.replace('/', '_')}",
            names={"nc": "stability.nc"},
        )
        return self.workplace.made(task)[0]

    @cached_property
    def effects(self) -> Made | None:
        """Return which effects matter (`stages.effect_study`); None for a scene without effects or watches."""
        effects, chosen = variants.effects_of(self.scene, self.of, "of"), self.scene.watched()
        if not effects or not chosen:
            return None
        self._started.tighter()
        levels = MEMBERS[:1] if self.seconds is None else MEMBERS
        comparison = _Comparison(self.scene, self.workplace, effects, chosen, self._started, levels)
        return self.workplace.made(comparison.task())[0]


@dataclass
class _Comparison:
    """Comparison of the scene with the scene without each effect; more members run where a change is undecided."""

    scene: Scene
    workplace: Workplace
    effects: Sequence[Effect]
    chosen: Sequence[Quantity]
    study: cost.Study
    #: numbers of members that are tried until a change beyond the horizon is decided
    levels: Sequence[int]
    #: number of members that have run, by missing effect
    done: dict[str, int] = field(default_factory=dict)
    points: dict[tuple[str, int], Point] = field(default_factory=dict)
    spent: float = 0.0
    #: True when members run at the scene's own tolerance, since the looser one for means was refused
    tight: bool = False

    @cached_property
    def members(self) -> Members:
        """Members of the variants so far."""
        return Members(self.workplace, self.chosen)

    def task(self) -> Task:
        """Run the points that the budget allows and return the task of the answer."""
        from flexclear.post.answers.effect_ranking import Pair, undecided

        levels = self.levels if self._has_contacts("") else (0,)
        waiting = names = self._affordable(list(self._removed), levels[0])
        pairs = dict.fromkeys(names, 0)
        for members in levels:
            if members != levels[0]:
                waiting = self._affordable(waiting, members)
            if not waiting:
                break
            self._bring(["", *waiting], members)
            if not self.tight and any(self.points[name, members].refused for name in ("", *waiting)):
                self.tight, self.done = True, {}
                self._bring(["", *waiting], members)
            pairs |= dict.fromkeys(waiting, members)
            full = self.points["", members]
            waiting = [n for n in waiting if undecided(Pair(full, self.points[n, members], members), self.chosen)]
        repeated = self._removed.get(IDEAL) in [gone for name, gone in self._removed.items() if name != IDEAL]
        words = {effect.name: effect.words for effect in self.effects} | {IDEAL: "" if repeated else IDEAL}
        without = {name: self._variant(name) for name in ("", *names)}
        left = [words[name] for name in self._removed if name not in names and words[name]]
        points = self.study.pair
        return effect_study.ranking(self.scene, self.chosen, words, without, self.members.tasks, pairs, left, points)

    @cached_property
    def _removed(self) -> Mapping[str, frozenset[str]]:
        """Return the effects that go with each one: first all clearances and flexible bodies, then single effects."""
        single = {e.name: self._closed({e.name}) for e in self.effects}
        ideal = {e.name for e in variants.effects(self.scene) if e.kind in (CLEARANCE, FLEXIBILITY)}
        both = {IDEAL: self._closed(ideal)} if ideal and ideal <= set(single) else {}
        order = sorted(self.effects, key=lambda effect: effect.kind not in (CLEARANCE, FLEXIBILITY))
        return both | {effect.name: single[effect.name] for effect in order}

    def _closed(self, names: set[str]) -> frozenset[str]:
        """Return the names of effects, and those of effects that exist only within them."""
        return frozenset(names | {e.name for e in self.effects if e.within in names})

    def _variant(self, name: str) -> Scene:
        gone = self._removed[name] if name else frozenset()
        variant = variants.without(self.scene, [e for e in self.effects if e.name in gone])
        return with_setting(variant, self.study.setting, tight=self.tight)

    def _has_contacts(self, name: str) -> bool:
        scene = self._variant(name)
        return bool(scene.contacts() or scene.stop)

    def _seconds(self, name: str, members: int) -> float:
        """Predict the wall time of members of a variant [s]: from its last round, else from the scene's own run."""
        runs = members - self.done.get(name, 0) if self._has_contacts(name) else 1
        each, _ = self.members.seconds.get(name, (self.study.own * self.study.seconds_each, 0.0))
        return (runs * each + cost.POINT) / AT_ONCE

    def _affordable(self, names: Sequence[str], members: int) -> list[str]:
        """Return the first names that the rest of the budget allows, in the order in which the summary needs them; at
        least one while no point exists."""
        rest = self.study.seconds - self.study.spent - self.spent - self._seconds("", members)
        times = list(accumulate(self._seconds(name, members) for name in names))
        least = 0 if self.points else 1
        gone = {self._removed[name] for name in names[: max(least, sum(time <= rest for time in times))]}
        return [name for name in names if self._removed[name] in gone]  # equal ones cost nothing more

    def _bring(self, names: Sequence[str], members: int) -> None:
        points = self.members.points({name: self._variant(name) for name in names}, members)
        for name, point in points.items():
            self.points[name, members] = point
            self.spent += self._seconds(name, members) + self.members.seconds[name][1] / AT_ONCE
            self.done[name] = members
