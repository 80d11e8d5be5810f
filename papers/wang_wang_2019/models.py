"""The paper's models: scenes, legends, and the quantities that its figures and tables show."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr

PLATFORM = "platform"
JOINT = "A1"
BALL_FRAME = "ball_A1.centre"
#: times that differ by less than this fraction of the run's end are equal: outputs of two runs differ by rounding
SAME_TIME = 1e-13


@dataclass(frozen=True, slots=True)
class Model:
    """One curve of the paper's comparisons. `ours` marks a curve that the paper lacks."""

    scene: str
    label: str
    color: str  #: Okabe-Ito palette: distinguished by colour-blind readers too
    ours: bool = False


IDEAL = Model("sps4/ideal", "ideal", "#111111")
CSJ = Model("sps4/csj", "CSJ", "#E69F00")
FAR_FREE = Model("sps4/far_free", "FAR, free-free modes", "#0072B2")
FAR_FIXED = Model("sps4/far_fixed", "FAR, fixed-fixed modes", "#D55E00")
FAR_CB = Model("sps4/far_cb", "FAR, Craig-Bampton modes (added)", "#009E73", ours=True)
FAR_CSJ_FREE = Model("sps4/far_csj_free", "FAR-CSJ, free-free modes", "#0072B2")
FAR_CSJ_FIXED = Model("sps4/far_csj_fixed", "FAR-CSJ, fixed-fixed modes", "#D55E00")
FAR_CSJ_CB = Model("sps4/far_csj_cb", "FAR-CSJ, Craig-Bampton modes (added)", "#009E73", ours=True)

#: the layout that was assumed before one was identified from Table 8
FIRST_IDEAL = Model("sps4/variants/first", "ideal, first layout", "#111111", ours=True)
FIRST_CSJ = Model("sps4/variants/first_csj", "CSJ, first layout", "#E69F00", ours=True)

FAR = (FAR_FREE, FAR_FIXED, FAR_CB)
FAR_CSJ = (FAR_CSJ_FREE, FAR_CSJ_FIXED, FAR_CSJ_CB)
MODELS = (IDEAL, *FAR, CSJ, *FAR_CSJ)
FIRST = (FIRST_IDEAL, FIRST_CSJ)


def references(models: Sequence[Model], *artifacts: str) -> tuple[str, ...]:
    """Return references of these artifacts of each model, such as ``sps4/csj:run``."""
    return tuple(f"{model.scene}:{artifact}" for model in models for artifact in artifacts)


def mode_set(model: Model) -> str:
    """Return the name of a model's mode set, such as `free-free`; empty where its rod is rigid."""
    return model.label.partition(", ")[2].split(" ")[0]


@dataclass(frozen=True, slots=True)
class Motion:
    """The six quantities of figures 11-13 for one run, in the paper's units."""

    model: Model
    post: xr.Dataset  #: results derived from the run (schema POST)
    time: np.ndarray  #: [s]
    angle: np.ndarray  #: about y0 [rad]
    displacement: np.ndarray  #: z [mm]
    velocity: np.ndarray  #: z [mm/s]
    acceleration: np.ndarray  #: z [mm/s^2]
    reaction: np.ndarray  #: at A1 [N]
    ball: np.ndarray  #: centre of ball A1, world axes [mm], shape (time, 3)
    horizon: float  #: [s]
    impacts: np.ndarray  #: middle [s] and largest normal force [N] of each impact, shape (impact, 2)


@dataclass(frozen=True, slots=True)
class Quantity:
    """A quantity that figures show over time. `jumps`: impacts drive it far out of the ideal model's range."""

    title: str
    unit: str
    values: Callable[[Motion], np.ndarray]
    ensemble: tuple[str, float]  #: variable of the post artifact, factor to the unit
    jumps: bool = False

    @property
    def label(self) -> str:
        """Title and unit, for an axis."""
        return f"{self.title} ({self.unit})"


ANGLE = Quantity("angle about y0", "rad", lambda m: m.angle, ("rotation_y", 1.0))
DISPLACEMENT = Quantity("displacement along z0", "mm", lambda m: m.displacement, ("displacement", 1e3))
VELOCITY = Quantity("velocity along z0", "mm/s", lambda m: m.velocity, ("velocity", 1e3))
ACCELERATION = Quantity(
    "acceleration along z0", "10³ mm/s²", lambda m: 1e-3 * m.acceleration, ("acceleration", 1.0), jumps=True
)
REACTION = Quantity("reaction force at A1", "N", lambda m: m.reaction, ("normal_force", 1.0), jumps=True)


def minus(motion: Motion, reference: Motion, values: Callable[[Motion], np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Return the times that both motions have, and values of the first minus those of the reference there."""
    i, j = common_times(motion.time, reference.time)
    return motion.time[i], values(motion)[i] - values(reference)[j]


def motion(model: Model, data: dict[str, xr.Dataset]) -> Motion:
    """Return the paper's quantities of one model from its run and post artifacts."""
    run, post = data[f"{model.scene}:run"], data[f"{model.scene}:post"]
    platform = run.sel(body=PLATFORM)
    return Motion(
        model=model,
        post=post,
        time=run.time.values,
        angle=post.rotation_y.sel(body=PLATFORM).values,
        displacement=1e3 * post.displacement.sel(body=PLATFORM, axis="z").values,
        velocity=1e3 * platform.velocity.sel(axis="z").values,
        acceleration=1e3 * platform.acceleration.sel(axis="z").values,
        reaction=post.reaction.sel(joint=JOINT).values,
        ball=1e3 * run.frame_position.sel(frame=BALL_FRAME).values,
        horizon=comparable_until(post),
        impacts=_impacts(post),
    )


def parameters(run: xr.Dataset) -> dict[str, Any]:
    """Return the parameters of a run's scene, by the keys of its file."""
    result: dict[str, Any] = json.loads(run.attrs["parameters"])
    return result


def common_times(a: np.ndarray, b: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return indices into a and into b of the times that both contain, ascending, each time once."""
    unit = SAME_TIME * max(np.abs(a).max(initial=0.0), np.abs(b).max(initial=0.0)) or 1.0
    _, first, second = np.intersect1d(np.round(a / unit), np.round(b / unit), return_indices=True)
    return first, second


def comparable_until(post: xr.Dataset) -> float:
    """Return the end of pointwise comparison [s]: where the run's ensemble diverges, or else the perturbed run."""
    return float(post.ensemble_horizon if "ensemble_horizon" in post else post.horizon)


def _impacts(post: xr.Dataset) -> np.ndarray:
    if "impact_time" not in post:
        return np.empty((0, 2))
    own = post.impact_contact.values == JOINT
    middle = post.impact_time.values + 0.5 * np.nan_to_num(post.impact_duration.values)
    return np.column_stack([middle, post.impact_peak_force.values])[own]
