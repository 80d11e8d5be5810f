"""Public functions: from an FE mesh to a converged answer about a mechanism with flexible bodies and clearance.

They do what the command ``flexclear`` does, from Python::

    import flexclear as fc

    scene = fc.load_scene("slider_crank.toml", override={"joint.pin.clearance": "0.2 mm"})
    run = fc.run(scene)
    both = fc.compare(scene, ideal=True)
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

from flexclear.scene import load
from flexclear.scene.schema import Scene
from flexclear.stages import formats, new_scene, scenes
from flexclear.stages import show as start_pose
from flexclear.stages.graph import Graph
from flexclear.stages.single_stage import Step, single_stage
from flexclear.stages.workplace import open_workplace, seconds
from flexclear.study import answers
from flexclear.study import compare as comparison
from flexclear.study import plan as planning
from flexclear.study import report as page
from flexclear.system.errors import FlexclearError as FlexclearError
from flexclear.system.errors import InputError as InputError
from flexclear.system.errors import ResourceError as ResourceError
from flexclear.system.errors import SolverError as SolverError
from flexclear.system.version import version
from flexclear.workflow.program import exit_code as exit_code

if TYPE_CHECKING:
    import xarray as xr

    from flexclear.dynamics.stepwise import Simulation

__version__ = version()
#: what functions take as scene: a scene, its file, its name below scenes/, or a table with the keys of a scene file
AnyScene: TypeAlias = Scene | str | Path | Mapping[str, Any]


def load_scene(source: str | Path | Mapping[str, Any], override: Mapping[str, object] | None = None) -> Scene:
    """Load a scene from a TOML file, with everything that it extends, or from a table of the same keys.

    override: dotted path -> value.  A scene may be built part by part, too: ``Scene(title=..., time=..., body=...)``.
    Raises InputError (exit code 2 of the command) with all errors at once.

    >>> import flexclear as fc
    >>> fc.load_scene("scenes/checks/pendulum.toml", override={"time.end": "0.2 s"})
    <Scene checks/pendulum: 1 rigid body, 1 joint, 1 load; 0 to 0.2 s>
    """
    return load.scene_of(source, override) if isinstance(source, Mapping) else load.load_scene(source, override)


def edited(scene: AnyScene, changes: Mapping[str, object]) -> Scene:
    """Return a copy of a scene with dotted paths changed: ``{"joint.pin.clearance": "0.2 mm"}``, or a part as a table.

    Raises InputError.

    >>> import flexclear as fc
    >>> fc.edited(fc.load_scene("scenes/checks/pendulum.toml"), {"body.bob.mass": "200 g"}).body["bob"].mass
    0.2
    """
    return load.edited(_loaded(scene), changes)


def new(source: str | Path, folder: str | Path = ".") -> Path:
    """Write a commented scene to start from into a folder and return its path.

    source: a kind of mechanism, as ``flexclear new`` lists them, or a robot's file, URDF or MJCF; that needs the extra
    ``robots``. The head of the scene lists what it does not take over.  Raises FlexclearError.
    """
    if source in new_scene.KINDS:
        return new_scene.write(str(source), Path(folder))[0]
    return new_scene.write_from(Path(source), Path(folder))[0][0]


def run(scene: AnyScene) -> xr.Dataset:
    """Run a scene and return the dataset of the simulate stage (schema RUN), from the cache when fresh.

    Raises FlexclearError: InputError, SolverError or ResourceError.

    >>> import flexclear as fc
    >>> run = fc.run(fc.load_scene("scenes/checks/pendulum.toml", override={"time.end": "0.2 s"}))
    >>> round(float(run["joint_position"].sel(coordinate="hinge")[-1]), 4)  # [rad]
    0.1959
    """
    return scenes.run(_loaded(scene))


def simulation(scene: AnyScene) -> Simulation:
    """Begin a motion that advances in steps of your own, for controllers and forces in Python and for co-simulation.

    `advance(1e-3)` goes on by a duration [s], with steps as short as accuracy, contacts and events inside need; `time`
    is the present time.  `inputs["load.push"] = 3.0` sets a force, torque, set point or motion that the scene gives as
    a number, in SI or as text with a unit, and `inputs` lists them.  `read("slider.position")` evaluates a quantity as
    `[view] watch` names it, `equations()` mass matrix, bias forces and closures, `jacobian("slider.velocity")` a
    velocity's change per free speed.  `state` is a value of bytes: set it to go back, to the last bit, in this or
    another process.  A simulation is a context, or ends with `close()`.
    Raises FlexclearError: InputError for wrong names and values, SolverError where the motion cannot continue.

    >>> import flexclear as fc
    >>> with fc.simulation("scenes/checks/pendulum.toml") as sim:
    ...     sim.advance(0.2)
    ...     round(sim.read("hinge.position"), 4)  # [rad]
    0.1959
    """
    from flexclear.stages.stepping import begin

    return begin(_loaded(scene), open_workplace())


def cost(scene: AnyScene, budget: str | float | None = None) -> xr.Dataset:
    """Measure what accuracy costs: error against cost over integrators, tolerances and steps; cached point by point.

    The quantities are those of the scene's `[accuracy]`, else the watched ones.  budget: processor time of the runs
    [s], or text such as "2min"; by default that of ``flexclear cost``.  In a notebook the dataset shows the answer
    first.  Raises FlexclearError.
    """
    return answers.dataset("cost", _loaded(scene), budget)


def stability(scene: AnyScene, budget: str | float | None = None) -> xr.Dataset:
    """Judge whether the run of a scene is stable: value, limit, verdict and remedy over `check`.

    The checks: energy balance, closed loops, agreement with tighter runs and with another method, rejected and stiff
    steps, singular poses, predictability.  budget: as of `cost`; by default three times the run's own cost.  In a
    notebook the dataset shows the answer first.  Raises FlexclearError.
    """
    return answers.dataset("stability", _loaded(scene), budget)


def sweep(
    scene: AnyScene,
    vary: Mapping[str, object],
    keep: Sequence[str],
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    **more: object,
) -> xr.Dataset:
    """Run many points of one scene, as ``flexclear sweep`` does; finished points come from the cache.

    vary: path in the scene -> its values (a list), or a parameter's table as in a sweep file. keep: recorded quantities
    of each point, e.g. ``["platform.velocity.largest", "A1.peak_force"]``.
    workers: processes of this machine, its cores by default; scheduler: address of a Dask cluster instead.
    more: `set`, `combine`, `sample`, `members` and `error` of a sweep file.
    The result has the parameters as dimensions.  Raises FlexclearError.

    >>> import flexclear as fc
    >>> where = {"load.gravity.acceleration.1": [-9.81, -1.62]}  # on the earth, and on the moon
    >>> kept, short = ["bob.velocity.largest"], {"time.end": "0.2 s"}
    >>> result = fc.sweep("scenes/checks/pendulum.toml", where, kept, set=short, workers=1)
    >>> result["bob.velocity.largest"].values.round(3).tolist()  # [m/s]
    [1.954, 0.324]
    """
    from flexclear.study import sweep as variation

    given = {name: _plain(values) for name, values in vary.items()}
    table = {"vary": given, "keep": list(keep), **more}
    return variation.of_scene(_loaded(scene), table, workers, scheduler)


def _plain(values: Any) -> Any:
    """Return arrays as lists of Python's own numbers, the form of values in a sweep file."""
    return values.tolist() if hasattr(values, "tolist") else values


def stage(scene: AnyScene, name: str) -> list[Step]:
    """Run one stage alone (mesh, modes, bundle, simulate or post), on the files that the stages before it have written.

    Each step, one for each body where the stage has bodies, has the paths that it `reads` and `writes`, and the dataset
    in `result`.  Raises FlexclearError: InputError where a file of the stage before is missing or out of date.
    """
    one = _loaded(scene)
    scenes.examine(one)
    return single_stage(Graph(one, shown=scenes.as_in_its_file(one)), name, open_workplace())


def sections(scene: AnyScene) -> tuple[xr.Dataset, xr.Dataset]:
    """Sample a periodically driven motion once in each period (schema SECTIONS), and judge it.

    The verdict (schema VERDICT) says in its attributes whether the motion is periodic, quasi-periodic or chaotic, and
    why.  The scene's `[sections]` has the number of periods.  Raises FlexclearError: InputError if the laws do not
    repeat.
    """
    one = _loaded(scene)
    graph = Graph(one, shown=scenes.as_in_its_file(one))
    made = open_workplace().datasets(graph.sections, graph.verdict, jobs=1)
    recorded, verdict = (data.assign_attrs(title=one.title, scene=one.name) for data in made)
    return recorded, verdict


def wear(scene: AnyScene, cycles: float, *, per_run: float = 1.0, tolerance: float | None = None) -> xr.Dataset:
    """Wear the surfaces of a scene's loose joints over many cycles (schema WEAR), by runs and steps between them.

    The run of the scene is `per_run` cycles. tolerance: estimated error of the depths of a step, as fraction of the
    clearance; by default that of ``flexclear wear``.  Finished runs come from the cache.  Raises FlexclearError:
    InputError for a scene without wear.
    """
    from flexclear.study.wear import TOLERANCE, wear_surfaces

    allowed = TOLERANCE if tolerance is None else tolerance
    scenes.examine(one := _loaded(scene))
    return wear_surfaces(one, open_workplace(), cycles, per_run=per_run, tolerance=allowed).dataset()


def sensitivities(scene: AnyScene, of: Sequence[str], to: Sequence[str]) -> xr.Dataset:
    """Return derivatives of quantities by numbers of a scene, through its impacts; from the cache when fresh.

    of: quantities over time, ``slider.position``, or reduced as in a sweep, ``pin.peak_force``,
    ``slider.velocity.largest``.  to: dotted paths of numbers, ``joint.pin.clearance``, of lists by index, ``com.0``, or
    of a flexible body's recipe, ``body.rod.mesh.material.youngs_modulus``, through differences of its bundles.
    Each variable has the dimension `parameter`; its unit is that of the quantity per SI unit of the parameter. Values
    are NaN beyond the predictability horizon.  Raises FlexclearError: InputError for a path that is no number or
    changes the mechanism's structure, SolverError where the motion has no derivative.

    >>> import flexclear as fc
    >>> short = fc.load_scene("scenes/checks/pendulum.toml", override={"time.end": "0.2 s"})
    >>> result = fc.sensitivities(short, ["bob.velocity.final"], ["load.gravity.acceleration.1"])
    >>> result["bob.velocity.final"].sel(parameter="load.gravity.acceleration.1").values.shape
    (3,)
    """
    scenes.examine(one := _loaded(scene))
    return open_workplace().datasets(Graph(one, shown=False).sensitivities(of, to), jobs=1)[0]


def quantity(run: xr.Dataset, name: str) -> xr.DataArray:
    """Evaluate a quantity of a run over time, in SI units with the attribute `units`.

    name: ``slider.acceleration``, a component, ``slider.position.x``, or an expression, ``force(A1) - force(A2)``.
    Vectors have the dimension `axis`, x y z of the world.  Quantities of single contact events (`peak_force`,
    `impact_times`, `impulse`) have no time.  Raises InputError for a quantity that the run lacks.
    """
    from flexclear.artifacts.quantities import evaluate

    return evaluate(run, name)


def equilibrium(
    scene: AnyScene, time: float | None = None, drives: Mapping[str, float] | None = None, *, moving: bool = False
) -> xr.Dataset:
    """Return the static equilibrium of a mechanism close to its start pose, the drives held (schema EQUILIBRIUM).

    time: at which the drives' laws give their positions [s], the scene's start when None.
    drives: positions [m or rad] by drive, instead of the law's.
    moving: the drives keep their speed at that time; the pose is then one of steady motion, as of a rotor. Loose bodies
    settle: a ball falls onto its socket's floor where no drive holds it.
    Raises FlexclearError: InputError, SolverError (also when nothing balances the loads) or ResourceError.

    >>> import flexclear as fc
    >>> rest = fc.equilibrium("scenes/checks/oscillator.toml")
    >>> round(rest["position"].sel(body="mass", axis="z").item(), 9)  # where its spring is free [m]
    0.25
    """
    return scenes.linear(_loaded(scene), time, drives=drives, moving=moving, vibrations=False)


def frequencies(
    scene: AnyScene,
    time: float | None = None,
    drives: Mapping[str, float] | None = None,
    *,
    moving: bool = False,
    speeds: Sequence[float] | None = None,
    drive: str | None = None,
) -> xr.Dataset:
    """Return natural frequencies, damping and shapes of the assembled mechanism about `equilibrium` (schema LINEAR).

    Arguments, errors: see `equilibrium`.  speeds: of a drive [rad/s, or m/s]; the result is then a Campbell diagram,
    the vibrations about steady motion at each speed (schema CAMPBELL).  drive: its name, where several drives move.

    >>> import flexclear as fc
    >>> result = fc.frequencies("scenes/checks/oscillator.toml")
    >>> round(result["frequency"].item(), 4), round(result["damping_ratio"].item(), 6)  # [Hz], [-]
    (1.5836, 0.1)
    """
    return scenes.linear(_loaded(scene), time, drives=drives, moving=moving, speeds=speeds, drive=drive)


def state_space(
    scene: AnyScene, time: float | None = None, drives: Mapping[str, float] | None = None, *, held: bool = False
) -> xr.Dataset:
    """Return matrices A, B, C, D of small motions about `equilibrium` (schema STATE_SPACE), in changes from there.

    Inputs are the values of loads, references of controllers and forces of drives; outputs the watched quantities.
    time, drives, errors: see `equilibrium`.  held: the drives hold their positions, and their forces are no inputs.

    >>> import flexclear as fc
    >>> fc.state_space("scenes/checks/oscillator.toml")["A"].values.round(9).tolist()
    [[0.0, 1.0], [-100.0, -2.0]]
    """
    return scenes.linear(_loaded(scene), time, task="state_space", drives=drives, held=held)


def export(scene: AnyScene, format: str, target: str | Path | None = None, **options: Any) -> str:
    """Write a scene for another program, as ``flexclear export`` does, and return what it prints.

    format: "state-space" or "loads".  target: file, by default one named like the scene in the current folder.
    options: `at` [s], `held` and `body` of the command.  Raises FlexclearError.
    """
    path = None if target is None else Path(target)
    return formats.write(_loaded(scene), format, path, options, open_workplace())


def compare(*scenes: AnyScene, ideal: bool | Literal["both", "clearance", "flexibility", "each"] = False) -> xr.Dataset:
    """Compare scenes with each other, or with their ideal mechanisms: differences, errors of the runs, events and
    costs.

    ideal: compare each scene with itself without clearance and flexibility (True or "both"), without one of them, or
    with each of these.  The first run is the reference; `post.overview.comparison` describes the variables.
    Raises FlexclearError.
    """
    without = "both" if ideal is True else ideal or None
    return comparison.dataset([_loaded(scene) for scene in scenes], without)


def effects(scene: AnyScene, budget: str | float | None = None, *, of: Sequence[str] | str = ()) -> xr.Dataset:
    """Return the size of each effect on each quantity, removed and added, alone and in pairs.

    Variables and meanings: `post.answers.effect_sizes`; a notebook shows the answer first.  The quantities are those of
    `[view] watch`, else of `[accuracy]`, else the usual ones.  budget: as of `cost`; with it each effect is removed
    alone, the most important ones first, with as many members as decide the change.  of: effects or parts to examine,
    ``"joint.pin"``, ``"load.spring"``; without it those that plans examine, which leave out bushings (against an ideal
    joint), springs, forces, gears and balls on planes.  Raises FlexclearError.
    """
    places = (of,) if isinstance(of, str) else tuple(of)
    return answers.dataset("effects", _loaded(scene), budget, of=places)


def plan(
    scene: AnyScene, budget: str | float | None = None, *, accuracy: str | None = None
) -> tuple[Scene, xr.Dataset]:
    """Plan which of a scene's effects the requested accuracy calls for: the planned scene, and the evidence.

    The dataset (`post.answers.plan.dataset`) holds the estimated effect size of each effect on each quantity
    of `[accuracy]`, the decisions and their reasons.  accuracy: of all watched quantities, as a fraction of their
    sizes; default: the scene's `[accuracy]`, else "1 %".  budget: processor time in which members of the full
    and the planned scene are compared [s], or text such as "1min"; the dataset then has the plan's true `error` where
    it is decided, its `chance`, the `allowed` error, the `horizon` as a fraction of the run and the `scatter` of
    single runs. In a notebook the dataset shows the answer first.  Raises FlexclearError.
    """
    return planning.dataset(_loaded(scene), accuracy, budget)


def render(scene: AnyScene) -> Path:
    """Return the folder with the scene's pictures, film and mode shapes, brought up to date.  Raises FlexclearError."""
    scenes.require_names(one := _loaded(scene))
    return open_workplace().made(*Graph(one).render.values(), jobs=1)[0].folder


def show(scene: AnyScene | xr.Dataset | xr.DataTree, folder: str | Path | None = None) -> Any:
    """Return a page to turn, which a notebook shows: the motion of a run, or the start pose of a scene with all names.

    A start takes seconds: nothing is run or compiled.  folder: also write the page there, and of a start the picture,
    as ``flexclear show`` does.  Of a start, `gaps` lists the joints that do not fit, `refused` says why (None where all
    fit).  Raises InputError where no pose can be drawn, and for a run from a file with flexible bodies, whose shapes
    are not in it.

    >>> import flexclear as fc
    >>> seen = fc.show("scenes/checks/pendulum.toml")
    >>> [mark.text for mark in seen.view.marks], seen.refused
    (['bob', 'hinge'], None)
    """
    from xarray import Dataset, DataTree

    target = None if folder is None else Path(folder)
    if isinstance(scene, (Dataset, DataTree)):
        return start_pose.motion(scene if isinstance(scene, Dataset) else scene.to_dataset(), target)
    return start_pose.start(_loaded(scene), target)


def report(scene: AnyScene, budget: str | float | None = None, *, answers: bool = True) -> Path:
    """Return the page with everything about a scene, one file, brought up to date.

    budget: of what accuracy costs, whether the run is stable and which effects matter, as of `stability`; answers:
    False leaves out those that take further runs.  Raises FlexclearError.
    """
    given = None if budget is None else seconds(budget, "budget")
    scenes.examine(one := _loaded(scene))
    graph = Graph(one, shown=one.path is None or scenes.as_in_its_file(one))
    return page.write_report(graph, open_workplace(), budget=given, answers=answers)


def open(scene: AnyScene) -> xr.DataTree:
    """Return the stored datasets of a scene as a tree: mesh, modes, bundle by body; run, post, ensemble.

    `post` is left out while it is derived from another run than `run`, as after `fc.run` of a changed scene. The path
    of a dataset (``results/runs/checks/pendulum/run.nc``) gives a tree with that dataset, under the file's name.
    Nothing is run.  Raises InputError when nothing is stored, or the file is no dataset of a scene.
    """
    return scenes.results(scene if isinstance(scene, (str, Path)) else _loaded(scene))


def _loaded(scene: AnyScene) -> Scene:
    """Return a scene: as given, from a file, by its name below scenes/, or of a table."""
    if isinstance(scene, (str, Path)):
        return load_scene(scenes.find_scene(str(scene)))
    if isinstance(scene, Mapping):
        return load_scene(scene)
    if not isinstance(scene, Scene):
        raise InputError("scene", f"is of type {type(scene).__name__}", "give a scene, its file or name, or a table")
    return scene
