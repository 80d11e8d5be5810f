"""flexclear: from an FE mesh to a converged answer about a mechanism with flexible bodies and clearance.

The same things that the command ``flexclear`` does, from Python::

    scene = pipeline.load_scene("scenes/sps4/csj.toml", override={"joint.A1.clearance": "0.2 mm"})
    run = pipeline.run(scene)
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import xarray as xr

    from pipeline.core.scene.schema import Scene

# One thread in BLAS and OpenMP, before NumPy is loaded: the matrices are small, and sums whose
# order depends on the number of cores would break the promise of equal bytes for equal inputs.
for _variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS"):
    os.environ.setdefault(_variable, "1")

__all__ = ["cost", "equilibrium", "frequencies", "load_scene", "run", "sweep"]


def load_scene(path: str | Path, override: Mapping[str, object] | None = None) -> Scene:
    """The scene in a TOML file, with everything that it extends; `override` as dotted place -> value.

    Raises InputError (exit code 2 of the command) with all mistakes at once.
    """
    from pipeline.core.scene.load import load_scene as load

    return load(path, override)


def run(scene: Scene | str | Path) -> xr.Dataset:
    """Dataset of the simulate stage (schema RUN), from the cache when fresh.

    Raises FlexclearError: InputError, SolverError or ResourceError.
    """
    return _stages("run").run(_loaded(scene))


def cost(scene: Scene | str | Path) -> xr.Dataset:
    """Error against cost of a scene over integrators, tolerances, steps and models; cached point by point.

    The quantities are those of the scene's `[accuracy]`, else the usual ones.  Raises FlexclearError.
    """
    dataset, _ = _stages("cost").bring(_loaded(scene), _stages("run").workplace())
    return dataset


def sweep(
    scene: Scene | str | Path,
    vary: Mapping[str, object],
    keep: Sequence[str],
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    **more: object,
) -> xr.Dataset:
    """Many points of one scene, as ``flexclear sweep`` makes them; finished points come from the cache.

    vary: place of the scene -> its values (a list), or what else a sweep file says of a parameter.
    keep: what is kept of each point, e.g. ``["platform.velocity.largest", "A1.peak_force"]``.
    workers: processes of this machine, its cores by default; scheduler: address of a Dask cluster instead.
    more: `set`, `combine`, `sample`, `members` and `error` of a sweep file.
    The result has the parameters as dimensions.  Raises FlexclearError.
    """
    given = {name: _plain(values) for name, values in vary.items()}
    table = {"vary": given, "keep": list(keep), **more}
    return _stages("sweep").of_scene(_loaded(scene), table, workers, scheduler)


def _plain(values: Any) -> Any:
    """Arrays as lists of Python's own numbers, which are what a sweep file can say."""
    return values.tolist() if hasattr(values, "tolist") else values


def equilibrium(
    scene: Scene | str | Path,
    time: float | None = None,
    drives: Mapping[str, float] | None = None,
    *,
    moving: bool = False,
) -> xr.Dataset:
    """Static equilibrium of a mechanism near its start pose, the drives held (schema EQUILIBRIUM).

    time: at which the drives' laws give their positions [s], the scene's start when None.
    drives: positions [m or rad] by drive, instead of the law's.
    moving: the drives keep the speed of that moment; the pose is then one of steady motion, as of a rotor.
    A drive that does not hold the mechanism leaves it free to settle: a ball falls onto its socket's floor.
    Raises FlexclearError: InputError, SolverError (also when nothing balances the loads) or ResourceError.
    """
    return _linear(scene, time, drives, moving=moving, vibrations=False)


def frequencies(
    scene: Scene | str | Path,
    time: float | None = None,
    drives: Mapping[str, float] | None = None,
    *,
    moving: bool = False,
) -> xr.Dataset:
    """Natural frequencies, damping and shapes of the assembled mechanism about `equilibrium` (schema LINEAR).

    Arguments and errors as there.
    """
    return _linear(scene, time, drives, moving=moving, vibrations=True)


def _linear(
    scene: Scene | str | Path,
    time: float | None,
    drives: Mapping[str, float] | None,
    *,
    moving: bool,
    vibrations: bool,
) -> xr.Dataset:
    return _stages("run").linear(_loaded(scene), time, drives, moving=moving, vibrations=vibrations)


def _loaded(scene: Scene | str | Path) -> Scene:
    return load_scene(scene) if isinstance(scene, (str, Path)) else scene


def _stages(name: str) -> Any:
    """A module of the stages. They stand above this package and may import it, not the other way round: this is the
    one door upwards, and it opens at a call, when everything is loaded."""
    return import_module(f"stages.{name}")
