"""What the paper's models differ in, as numbers: largest deviations, forces, accelerations, paths."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import xarray as xr

from flexclear.papers.wang_wang_2019.deviations import Deviation, ensemble_deviations, max_deviation
from flexclear.papers.wang_wang_2019.figures import Data
from flexclear.papers.wang_wang_2019.models import BALL_FRAME, IDEAL, JOINT, PLATFORM, Model
from flexclear.pipeline.core.artifacts.quantities import common_times

#: two answers differ by more than this fraction, and those of two ensembles also by this many standard deviations of
#: the members
SLIGHT, SEPARATION = 0.1, 2.0


def moved(data: Data, model: Model, ideal_model: Model = IDEAL) -> Deviation:
    """Largest deviations from the ideal model; of a model with an ensemble the means over the members."""
    ideal = data[f"{ideal_model.scene}:run"]
    if f"{model.scene}:ensemble" not in data:
        return max_deviation(data[f"{model.scene}:run"], ideal, PLATFORM)
    members = ensemble_deviations(data[f"{model.scene}:ensemble"], ideal, PLATFORM)
    names = ("angle", "rotation", "displacement", "velocity", "until")
    return Deviation(**{name: float(np.mean([getattr(m, name) for m in members])) for name in names})


def sizes(data: Data, ideal_model: Model = IDEAL) -> Deviation:
    """Largest values of the ideal model's own motion."""
    run, post = data[f"{ideal_model.scene}:run"], data[f"{ideal_model.scene}:post"]
    z = np.abs(post.displacement.sel(body=PLATFORM, axis="z").values).max()
    v = np.abs(run.velocity.sel(body=PLATFORM, axis="z").values).max()
    angle = np.abs(post.rotation_y.sel(body=PLATFORM).values).max()
    return Deviation(float(angle), float(angle), float(z), float(v), float(run.time.values[-1]))


def effects(data: Data, model: Model) -> dict[str, float]:
    """Largest differences from the ideal model, that of the force at A1 [N] among them."""
    most = moved(data, model)
    newtons = float(np.linalg.norm(difference(data, model, force), axis=1).max())
    return {"angle": most.angle, "displacement": most.displacement, "velocity": most.velocity, "force": newtons}


def reaction(data: Data, model: Model) -> float:
    """Largest force at A1 [N], with clearance the normal one; of ensembles the mean of the members' largest."""
    if f"{model.scene}:ensemble" in data:
        return float(data[f"{model.scene}:ensemble"].peak_force.sel(contact=JOINT).mean())
    post = data[f"{model.scene}:post"]
    return float(post.peak_force.sel(contact=JOINT) if "contact" in post.sizes else post.peak_reaction.sel(joint=JOINT))


def acceleration(data: Data, model: Model) -> float:
    """Largest vertical acceleration of the platform [m/s^2]."""
    if f"{model.scene}:ensemble" in data:
        return float(data[f"{model.scene}:ensemble"].peak_acceleration.sel(body=PLATFORM, axis="z").mean())
    return float(data[f"{model.scene}:post"].peak_acceleration.sel(body=PLATFORM, axis="z"))


def difference(data: Data, model: Model, of: Callable[[xr.Dataset], np.ndarray]) -> np.ndarray:
    """Sizes of the differences from the ideal model at the outputs that both have."""
    run, ideal = data[f"{model.scene}:run"], data[f"{IDEAL.scene}:run"]
    i, j = common_times(run.time.values, ideal.time.values)
    return np.abs(of(run)[i] - of(ideal)[j])


def vertical(run: xr.Dataset) -> np.ndarray:
    """The platform's acceleration along z [m/s^2], shape (time,)."""
    values: np.ndarray = run.acceleration.sel(body=PLATFORM, axis="z").values
    return values


def centre(run: xr.Dataset) -> np.ndarray:
    """The centre of ball A1, world axes [m], shape (time, 3)."""
    values: np.ndarray = run.frame_position.sel(frame=BALL_FRAME).values
    return values


def force(run: xr.Dataset) -> np.ndarray:
    """What joint A1 transmits [N], shape (time, 3)."""
    values: np.ndarray = run.joint_force.sel(joint=JOINT).values
    return values


def differ(a: np.ndarray, b: np.ndarray) -> bool:
    """Whether the means of two ensembles' members do, by `SLIGHT` and by `APART`."""
    gap, spread = abs(a.mean() - b.mean()), max(a.std(ddof=1), b.std(ddof=1))
    return bool(gap > SLIGHT * abs(b.mean()) and gap > SEPARATION * spread)


def mode_set(model: Model) -> str:
    """The name of a model's modes, such as `free-free`; empty where its rod is rigid."""
    return model.label.partition(", ")[2].split(" ")[0]
