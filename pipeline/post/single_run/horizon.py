"""How long a trajectory can be believed point by point, and what an ensemble says beyond."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from flexclear.pipeline.core.artifacts.quantities import LASTING, PERTURBATION, SEPARATED, lasting
from flexclear.pipeline.core.numerics.rotations import angle_about_y

if TYPE_CHECKING:
    import xarray as xr

    from flexclear.pipeline.core.artifacts.labelled import LabelledArrays

#: fractions of the members below the recorded quantiles: of so few, the middle and the bulk
QUANTILES = (0.05, 0.25, 0.5, 0.75, 0.95)

Variables = dict[str, tuple[tuple[str, ...], np.ndarray]]


def spread(velocity: np.ndarray) -> np.ndarray:
    """Largest distance of a member's velocity from the mean [m/s], over members and bodies, shape (time,).

    velocity: shape (member, time, body, axis) [m/s].
    """
    return np.linalg.norm(velocity - velocity.mean(axis=0), axis=-1).max(axis=(0, 2))


def horizon(time: np.ndarray, velocity: np.ndarray, fraction: float = SEPARATED) -> float:
    """Time from which on `spread` stays above `share` of the largest speed; the last time if it never does [s].

    Beyond it two runs that differ by a perturbation far below any tolerance differ visibly, so a
    pointwise value is one draw out of many.
    """
    peak = float(np.linalg.norm(velocity, axis=-1).max())
    first = lasting(time, spread(velocity) > fraction * peak, LASTING * float(time[-1] - time[0]))
    return float(time[-1] if first is None else time[first])


def sentence(horizon: float, end: float, members: float | None = None) -> str:
    """Statement on a run's predictability horizon [s]; end: of the run [s].

    members: horizon of its ensemble [s], which may start further from the run than the perturbed run does.
    """
    neighbour = f"A run whose contacts start {100.0 * PERTURBATION:g} % of their clearance elsewhere"
    difference = f"{100.0 * SEPARATED:g} % of each body's largest motion"
    if horizon >= end:
        text = f"{neighbour} stays within {difference} to the end, but for moments of impacts."
    else:
        whole = f"the run lasts {1e3 * end:.4g} ms"
        text = f"{neighbour} differs by more than {difference} from {1e3 * horizon:.4g} ms on ({whole})."
    if members is None or members >= end:
        return text
    return f"{text} The members of its ensemble differ by {100.0 * SEPARATED:g} % from {1e3 * members:.4g} ms on."


def ensemble_statistics(ensemble: xr.Dataset | LabelledArrays) -> Variables:
    """Mean, standard deviation (``ddof = 1``) and QUANTILES over the members, on the ensemble's own times.

    Quantiles are interpolated between members (numpy's default); of an angle, a vector's components, a contact.
    """
    position, per_contact = ensemble["position"].values, ("contact",)
    members = {
        "rotation_y": (("ensemble_time", "ensemble_body"), angle_about_y(ensemble["quaternion"].values)),
        "displacement": (("ensemble_time", "ensemble_body", "axis"), position - position[:, :1]),
        "velocity": (("ensemble_time", "ensemble_body", "axis"), ensemble["velocity"].values),
        "acceleration": (("ensemble_time", "ensemble_body", "axis"), ensemble["acceleration"].values),
        "normal_force": (("ensemble_time", "contact"), ensemble["contact_normal_force"].values),
        "impact_count": (per_contact, ensemble["impact_count"].values.astype(float)),
        "peak_force": (per_contact, ensemble["peak_force"].values),
        "contact_time_share": (per_contact, ensemble["contact_time_share"].values),
        "peak_acceleration": (("ensemble_body", "axis"), ensemble["peak_acceleration"].values),
    }
    result: Variables = {"spread": (("ensemble_time",), spread(ensemble["velocity"].values))}
    for name, (dims, values) in members.items():
        result[f"{name}_mean"] = (dims, values.mean(axis=0))
        result[f"{name}_std"] = (dims, values.std(axis=0, ddof=1))
        result[f"{name}_quantile"] = (("quantile", *dims), np.quantile(values, QUANTILES, axis=0))
    return result
