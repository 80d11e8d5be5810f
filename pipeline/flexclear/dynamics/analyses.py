"""Other results of a scene and its bundles: costs, ensembles, sections, equilibria and vibrations.

The keys of single runs do not depend on this module.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import xarray as xr

    from flexclear.artifacts.labelled import Labelled
    from flexclear.dynamics.model.mobility import Mobility
    from flexclear.dynamics.model.model import Model
    from flexclear.dynamics.record.cost import Cost
    from flexclear.scene.quantity import Quantity
    from flexclear.scene.schema import Scene
    from flexclear.system.progress import Progress

#: free coordinates of mechanisms whose ideal start or equilibrium is found without compilation
MOST_SOUGHT = 12


def cost(scene: Scene, bundles: Mapping[str, Labelled], progress: Progress, *, checked: bool = True) -> Cost:
    """Run a scene once and measure the costs of integration and recording (`dynamics.record.cost.measure`)."""
    from flexclear.dynamics.record.cost import measure

    require_without_events(scene, "the cost of a run")
    return measure(scene, bundles, progress, checked=checked)


def ensemble(scene: Scene, bundles: Mapping[str, Labelled], progress: Progress) -> xr.Dataset:
    """Run all members of a scene's ensemble; return their values at its regular output times (schema ENSEMBLE)."""
    from flexclear.dynamics.record.ensemble import ensemble as run

    require_without_events(scene, "an ensemble")
    return run(scene, bundles, progress)


def sections(scene: Scene, bundles: Mapping[str, Labelled], progress: Progress) -> xr.Dataset:
    """Sample a scene with periodic laws once in each period (schema SECTIONS)."""
    from flexclear.dynamics.record.sections import sections as run

    require_without_events(scene, "a section of the motion")
    return run(scene, bundles, progress)


def require_without_events(scene: Scene, what: str) -> None:
    """Raise InputError for a scene with events, for which this result is not available."""
    from flexclear.system.errors import InputError

    if scene.event:
        name = next(iter(scene.event))
        raise InputError(f"[event.{name}]", f"{what} needs a scene without events", 'remove them: remove = ["event"]')


def start_refusals(
    scene: Scene, bundles: Mapping[str, Labelled], model: Model, mobility: Mobility
) -> Iterator[Callable[[], object]]:
    """Yield checks of the start of a scene's run, which raise its errors, without compilation.

    The start that the scene asks for, its velocities, paths and surfaces; then actuators, conditions of events and
    periods of sections.  model: at the start, or where the start of another mechanism is still to be found.
    """
    from flexclear.dynamics.run.evaluation.engine import engine_in_python
    from flexclear.dynamics.run.evaluation.start import consistent_start
    from flexclear.dynamics.run.evaluation.without_compiler import without_compiler
    from flexclear.dynamics.run.run import engine_of
    from flexclear.system.progress import silent

    found: list[Any] = []
    at = None if scene.start is None else scene.start.begins
    # the laws of actuators come from a run; poses of many coordinates, or of modes, take seconds to find in Python
    actuated = any(getattr(drive, "actuators", None) for drive in scene.drive.values())
    afar = actuated or (at != "recorded" and (bool(bundles) or model.nv > MOST_SOUGHT))

    def start() -> None:
        with without_compiler():
            engine = engine_in_python(model, mobility) if at is None or afar else engine_of(scene, bundles, silent)
            found.extend([engine, consistent_start(engine)])

    if at == "equilibrium" and afar:
        return
    yield start
    if not found:
        return
    from flexclear.dynamics.events.phases import require_false
    from flexclear.dynamics.record.sections import engines_of_period
    from flexclear.dynamics.run.inverse import enough

    yield lambda: enough(*found)
    if scene.event and (at is None or not afar):
        yield lambda: require_false(scene, *found)
    if scene.sections is not None:
        yield lambda: engines_of_period(*found)


def equilibrium(
    scene: Scene,
    bundles: Mapping[str, Labelled],
    progress: Progress,
    time: float | None = None,
    drives: Mapping[str, float] | None = None,
    moving: bool = False,
) -> xr.Dataset:
    """Return the static equilibrium close to the scene's start pose, with drives held (schema EQUILIBRIUM).

    time: at which the drives' laws are evaluated [s]; the start when None.  drives: positions [m or rad] by
    name instead.  moving: True when the drives keep their speed at that time; the pose is then one of steady motion.
    Raises InputError for a scene that cannot be built, SolverError when no equilibrium is found.
    """
    from flexclear.dynamics.linear import dataset
    from flexclear.dynamics.linear.equilibrium import bench_in_equilibrium

    bench, rest, _ = bench_in_equilibrium(scene, bundles, progress, time, drives, moving)
    return dataset.equilibrium(bench, rest, moving)


def frequencies(
    scene: Scene,
    bundles: Mapping[str, Labelled],
    progress: Progress,
    time: float | None = None,
    drives: Mapping[str, float] | None = None,
    moving: bool = False,
) -> xr.Dataset:
    """Return natural vibrations about `equilibrium`, which has the same arguments (schema LINEAR)."""
    from flexclear.dynamics.linear import dataset
    from flexclear.dynamics.linear.equilibrium import bench_in_equilibrium
    from flexclear.dynamics.linear.vibrations import vibrations

    bench, rest, small = bench_in_equilibrium(scene, bundles, progress, time, drives, moving)
    return dataset.linear(bench, rest, small or vibrations(bench, rest.at), moving)


def state_space(
    scene: Scene,
    bundles: Mapping[str, Labelled],
    progress: Progress,
    outputs: Sequence[Quantity],
    time: float | None = None,
    drives: Mapping[str, float] | None = None,
    held: bool = False,
) -> xr.Dataset:
    """Return the state space about the static equilibrium (schema STATE_SPACE); `equilibrium` has the same arguments.

    outputs: those that the mechanism then has.  held: False where joints' drives become the forces that hold it there.
    Raises InputError for a controller that samples, SolverError when no equilibrium is found.
    """
    from flexclear.dynamics.linear import dataset
    from flexclear.dynamics.linear.bench import hold, state
    from flexclear.dynamics.linear.equilibrium import bench_in_equilibrium, newton
    from flexclear.dynamics.linear.state_space import require_continuous, state_space
    from flexclear.dynamics.starts.snapshot import with_forces_for_drives, with_poses

    require_continuous(scene)
    bench, rest, _ = bench_in_equilibrium(scene, bundles, progress, time, drives)
    moved = {name: drive for name, drive in scene.drive.items() if hasattr(drive, "joint")}
    if moved and not held:
        forces = dataset.equilibrium(bench, rest, moving=False)["drive_force"]
        given = {name: float(forces.sel(drive=name)) for name in moved}
        still = with_poses(scene, bench.engine, state(bench, rest.at.q), bench.time)
        bench, q = hold(with_forces_for_drives(still, given), bundles, progress, bench.time, {}, moving=False)
        rest = newton(bench, q)
    owners = bench.scene.owners()
    return state_space(bench, rest, [q for q in outputs if q.over_time and q.is_there(owners)])
