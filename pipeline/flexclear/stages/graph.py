"""Tasks of a scene: the artifact that each stage produces, and the artifacts that it reads."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

from flexclear.scene.limits import require_scatter
from flexclear.scene.load import edited, number_in, with_number
from flexclear.scene.registry import suggestion
from flexclear.scene.schema import Scene
from flexclear.scene.toml_files import read_toml
from flexclear.stages import (
    derived_series,
    meshing,
    modal_analysis,
    reduction,
    rendering,
    simulation,
)
from flexclear.system.errors import InputError
from flexclear.workflow.task import PATH, Task

#: stages in order, by the names that `--to` takes
STAGES = ("mesh", "modes", "bundle", "simulate", "ensemble", "post", "render")
#: stage that produces each artifact, by the name in references ``<scene>:<artifact>[/<body>]`` of figures
ARTIFACTS = {name: name for name in (*STAGES, "sections", "verdict", "tight")}
ARTIFACTS |= {"run": "simulate", "fine-modes": "fine_modes"}
#: code that decides the results of a module of `stages`, besides its own
STRUCTURE, POST = ("flexclear.structure",), ("flexclear.post",)
CODE: dict[str, tuple[str, ...]] = dict.fromkeys(("meshing", "modal_analysis", "reduction", "rigid_body"), STRUCTURE)
CODE |= dict.fromkeys(("simulation", "analyses"), simulation.CODE)
CODE |= {"derived_series": ("flexclear.stages.meshing", *POST), "evaluation": POST}
CODE |= {"rendering": ("flexclear.stages.simulation", *POST)}
#: factor of `tight` on the tolerance, factor of `fine-modes` on the number of elements
TIGHTER, FINER = 1e-2, 4
#: tightest useful tolerance: below it, rounding dominates the error
TIGHTEST = 1e-13


@dataclass(frozen=True)
class Graph:
    """All tasks of one scene; each is built at its first use.

    A scene without flexible bodies has no tasks `mesh`, `modes` and `bundle`; one without an ensemble has no task
    `ensemble`. Raises InputError for names that no family lists and for recipes that cannot be read. shown: whether
    artifacts are shown below results/runs; an edited copy of a scene must not replace those of its original. recipe:
    edits of all mesh recipes: `theory`, and a factor for the number of `elements`.
    """

    scene: Scene
    shown: bool = True
    recipe: Mapping[str, Any] = field(default_factory=dict)

    @cached_property
    def mesh(self) -> dict[str, Task]:
        """Meshing tasks of the bodies with a recipe, by body."""
        recipes = {body: Path(recipe) for body, recipe in self.scene.recipes().items()}
        for recipe in recipes.values():
            meshing.check_size(recipe, self.scene.limits, self.recipe)
        return {
            body: self._task(
                "mesh",
                "meshing:run",
                meshing.params(recipe, self.recipe, getattr(self.scene.body[body], "segment", None)),
                part=body,
                context={"folder": str(recipe.parent.resolve()), "file": self.scene.recipes()[body]},
                files=meshing.files(read_toml(recipe), recipe.parent),
            )
            for body, recipe in recipes.items()
        }

    @cached_property
    def modes(self) -> dict[str, Task]:
        """Modal analyses of the flexible bodies, by body."""
        return {
            body: self._task(
                "modes",
                "modal_analysis:run",
                modal_analysis.params(part),
                {"mesh": self.mesh[body]},
                part=body,
                check="flexclear.stages.modal_analysis:check",
            )
            for body, part in self.scene.flexible().items()
        }

    @cached_property
    def bundle(self) -> dict[str, Task]:
        """Reductions of the flexible bodies, by body."""
        for body, part in self.scene.flexible().items():
            reduction.check(self.scene, body, meshing.kind_of(Path(part.mesh)))
        return {
            body: self._task(
                "bundle",
                "reduction:run",
                reduction.params(self.scene, body),
                {"mesh": self.mesh[body], "modes": self.modes[body]},
                part=body,
            )
            for body in self.scene.flexible()
        }

    @cached_property
    def rigid(self) -> dict[str, Task]:
        """Tasks for mass and inertia of the rigid bodies with a recipe, by body."""
        return {
            body: self._task(
                "rigid",
                "rigid_body:run",
                {},
                {"mesh": self.mesh[body]},
                part=body,
            )
            for body, part in self.scene.meshed_bodies().items()
        }

    @cached_property
    def simulate(self) -> Task:
        """Task of one run; shown as ``run.nc``."""
        return self._simulation("simulate", simulation.params(self.scene), "run")

    @cached_property
    def ensemble(self) -> Task | None:
        """Task of the ensemble; None when the scene requests none."""
        if self.scene.ensemble is None:
            return None
        require_scatter(self.scene, "[ensemble]")
        return self._simulation("ensemble", simulation.params(self.scene, ensemble=True))

    @cached_property
    def sections(self) -> Task:
        """Task that samples the motion once in each period of its laws; shown as ``sections.nc``."""
        params = simulation.params(self.scene, sections=True, without=("output", "accuracy"))
        return self._simulation("sections", params)

    def sensitivities(self, of: Sequence[str], to: Sequence[str]) -> Task:
        """Return the task that differentiates quantities `of` by numbers `to`, up to the horizon of the run.

        A number of a recipe, ``body.rod.mesh.material.youngs_modulus``, changes the bundle of its body.
        """
        from flexclear.dynamics.sensitivity.recipes import RECIPE_STEP

        params, more = {**simulation.params(self.scene), "of": list(of), "to": list(to)}, dict[str, Task]()
        for path in to:
            family, body, key, inside = (*path.split(".", 3), "", "", "")[:4]
            if (family, key) != ("body", "mesh") or body not in self.scene.recipes() or not inside:
                continue
            if body not in self.bundle:
                raise InputError(path, f"is a number of the recipe of '{body}', which is rigid", "name a flexible body")
            table = read_toml(Path(self.scene.recipes()[body]))
            value, unit = number_in(table, inside, path)
            params.setdefault("recipes", {})[path] = [body, value, unit]
            for k in (-2, -1, 1, 2):
                number = value + k * RECIPE_STEP * (abs(value) or 1.0)
                edit = with_number(table, inside, f"{number!r} {unit}" if unit else number)
                top = inside.partition(".")[0]
                other = Graph(self.scene, shown=False, recipe={**self.recipe, top: edit[top]})
                more[f"varied/{k}/{path}"] = other.bundle[body]
        task = self._simulation("sensitivities", params)
        run = {"run": self.simulate} if self.scene.contacts() or self.scene.stops() else {}
        return replace(task, inputs={**task.inputs, **run, **more}, names={}, folder="")

    @cached_property
    def verdict(self) -> Task:
        """Task that classifies the sections (periodic, quasi-periodic, chaotic); shown as ``verdict.nc``."""
        # the name of the scene is in the figure's title, so the key must depend on it here
        params = {"scene": self.scene.name}
        return self._task("verdict", "evaluation:verdict", params, {"sections": self.sections}, shown="verdict")

    @cached_property
    def post(self) -> Task:
        """Task of the series derived from the run."""
        inputs = {"run": self.simulate} | ({"ensemble": self.ensemble} if self.ensemble else {})
        return self._task("post", "derived_series:run", derived_series.params(self.scene), inputs, shown="post")

    @cached_property
    def render(self) -> dict[str, Task]:
        """Picture, film and page of the motion, and the page of the modes, by subject and format."""
        pairs = [("motion", "png"), ("motion", "mp4"), ("motion", "html")]
        pairs += [("modes", "html")] if self.scene.flexible() else []
        return {f"{what} {kind}": self.picture(what, kind) for what, kind in pairs}

    def picture(self, what: str, kind: str, time: float | None = None) -> Task:
        """Return the task of one subject and format of `rendering.FORMATS`; `time`: of vibrations, as in `linear`."""
        inputs = {f"bundle/{body}": task for body, task in self.bundle.items()}
        if what == "vibrations":
            inputs["linear"] = self.linear(time)
        elif what != "modes":
            inputs["run"] = self.simulate
        params, files = rendering.params(self.scene, what, kind), rendering.files(self.scene, what)
        task = self._task("render", "rendering:run", params, inputs, files=files)
        return replace(task, part=f"{what} {kind}", folder=self._folder("paraview" if kind == "pvd" else ""))

    def linear(
        self,
        time: float | None = None,
        drives: Mapping[str, float] | None = None,
        *,
        moving: bool = False,
        vibrations: bool = True,
        speeds: Sequence[float] | None = None,
        drive: str | None = None,
    ) -> Task:
        """Return the task of the equilibrium in one pose (``equilibrium.nc``), or with vibrations (``linear.nc``).

        speeds: of a drive; vibrations about the steady motion at each of them, shown as ``campbell.nc``.
        """
        pose = {"time": time, "drives": dict(drives or {}), "moving": moving, "vibrations": vibrations}
        stage, params = "linear" if vibrations else "equilibrium", simulation.params(self.scene, without=("output",))
        if speeds is not None:
            stage, params = "campbell", {**params, "speeds": list(map(float, speeds)), "drive": drive}
        return self._simulation(stage, {**params, "pose": pose}, function="linear")

    def state_space(
        self, time: float | None = None, drives: Mapping[str, float] | None = None, *, held: bool = False
    ) -> Task:
        """Return the task of the state space about the equilibrium in one pose; shown as ``state_space.nc``."""
        params = {
            **simulation.params(self.scene, without=("output",)),
            "outputs": [quantity.to_json() for quantity in self.scene.watched_quantities()],
            "pose": {"time": time, "drives": dict(drives or {}), "held": held},
        }
        return self._simulation("state_space", params)

    def up_to(self, stage: str) -> list[Task]:
        """Return all tasks of the scene up to and including a stage."""
        requested = STAGES[: STAGES.index(stage) + 1]
        return [task for name in requested for task in self.of(name).values()]

    def of(self, stage: str) -> dict[str, Task]:
        """Return the tasks of one stage by body; a task of the whole scene has the empty name."""
        tasks = getattr(self, stage)
        return tasks if isinstance(tasks, dict) else {"": tasks} if tasks is not None else {}

    def artifact(self, reference: str) -> Task:
        """Return the task of ``run``, ``post``, ``modes/rod1`` ...; raise InputError for an unknown reference."""
        name, _, body = reference.partition("/")
        where = f"{self.scene.name}:{reference}"
        if name not in ARTIFACTS:
            raise InputError(where, f"no artifact is called '{name}'", suggestion(name, ARTIFACTS))
        tasks = self.of(ARTIFACTS[name])
        if body not in tasks:
            whose = f"'{body}'" if body else "the whole scene"
            raise InputError(where, f"there is no {name} of {whose}", suggestion(body, tasks))
        return tasks[body]

    @cached_property
    def tight(self) -> Task:
        """Task of the same run at a tighter tolerance, or at half of a fixed step, which determines the run's error."""
        solver = self.scene.solver
        finer = {"solver.rtol": max(TIGHTER * solver.rtol, TIGHTEST)}
        change = finer if solver.step is None else {"solver.step": 0.5 * solver.step}
        task = Graph(edited(self.scene, {**change, "accuracy": None}), shown=False, recipe=self.recipe).simulate
        # without a name of its own in progress and messages, the scene would seem to be run twice
        how = "a tighter tolerance" if solver.step is None else "half the step"
        return replace(task, scene=f"{task.scene} at {how}")

    @cached_property
    def overview(self) -> Task:
        """Task of the general figures of the run."""
        inputs = {"run": self.simulate, "post": self.post}
        watched = {"watched": [quantity.to_json() for quantity in self.scene.watched_quantities()]}
        task = self._task("overview", "evaluation:overview", watched, inputs)
        return replace(task, part="figures", folder=self._folder("figures"))

    @cached_property
    def fine_modes(self) -> dict[str, Task]:
        """Modal analyses on a finer mesh, which determine the error of `modes`, by flexible body."""
        return Graph(self.scene, shown=False, recipe={**self.recipe, "elements": FINER}).modes

    def bodies(self) -> dict[str, Task]:
        """Return the tasks of the bodies that runs need, by name of the input: ``bundle/<body>``, ``rigid/<body>``."""
        return {f"bundle/{body}": task for body, task in self.bundle.items()} | {
            f"{simulation.RIGID}{body}": task for body, task in self.rigid.items()
        }

    def _simulation(self, stage: str, params: Mapping[str, Any], shown: str = "", function: str = "") -> Task:
        """Return a task of `simulation` or `analyses`; function, shown: names that differ from the stage's."""
        single_run = shown == "run"
        run = "simulation:run" if single_run else f"analyses:{function or stage}"
        task = self._task(stage, run, params, self.bodies(), shown=shown or stage)
        return replace(task, check="flexclear.stages.simulation:check_parts")

    def _folder(self, below: str = "") -> str:
        return f"runs/{self.scene.name}/{below}".rstrip("/") if self.shown else ""

    def _task(
        self,
        stage: str,
        run: str,
        params: Mapping[str, Any],
        inputs: Mapping[str, Task] | None = None,
        *,
        part: str = "",
        shown: str = "",
        check: str = "",
        context: Mapping[str, Any] | None = None,
        files: Mapping[str, Path] | None = None,
    ) -> Task:
        """Return a task. run: ``module:function`` of `stages`. part: body with its files in a folder of the stage.

        shown: name of the dataset, without its ending, where it differs from the store's.
        """
        names = {"nc": f"{part}.nc", "vtu": f"{part}.vtu"} if part else {"nc": f"{shown}.nc"} if shown else {}
        of_scene = {} if part else {"name": self.scene.name, "limits": self.scene.limits.as_table()}
        of_scene |= {PATH: str(self.scene.path)} if of_scene and self.scene.path is not None else {}
        return Task(
            stage=stage,
            scene=self.scene.name,
            part=part,
            context=context or of_scene,
            run=f"flexclear.stages.{run}",
            params=params,
            folder=self._folder(stage if part else ""),
            inputs=inputs or {},
            names=names,
            code=CODE[run.partition(":")[0]],
            check=check,
            files=files or {},
        )
