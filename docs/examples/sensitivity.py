"""Which of eight unknowns of the mechanism with clearance decides how high the platform is at the top of the stroke.

Sobol's indices with SALib (``pip install 'flexclear[sensitivity]'``): the first-order index of an unknown is the share
of the variance that it explains alone, the total one the share that goes with it, together with others.
Source: Saltelli et al. (2010), Computer Physics Communications 181, 259-270.
"""

from pathlib import Path

import numpy as np
from SALib.analyze import sobol as indices
from SALib.sample import sobol

import flexclear as fc

SCENE = Path(__file__).parents[2] / "scenes/sps4/csj.toml"
#: place of the scene -> range, in SI
UNKNOWNS = {
    "joint.A1.clearance": (0.2e-3, 0.8e-3),
    "joint.A1.normal.restitution": (0.6, 0.95),
    "joint.A1.friction.dynamic": (0.02, 0.15),
    "joint.A1.ball_radius": (0.018, 0.022),
    "body.platform.mass": (0.2, 0.5),
    "body.rod1.mass": (0.15, 0.3),
    "drive.P1.law.change.0": (0.059, 0.061),
    "drive.P2.law.change.0": (0.059, 0.061),
}
#: the stroke up alone, to where the platform is looked at
SET = {
    f"drive.{leg}.law": {"type": "step", "start": [0.0], "end": ["0.09 s"], "change": [0.06]} for leg in ("P1", "P2")
}
SET |= {"time.end": "0.09 s", "solver.rtol": 1e-6}
PROBLEM = {
    "num_vars": len(UNKNOWNS),
    "names": list(UNKNOWNS),
    "bounds": [list(ends) for ends in UNKNOWNS.values()],
}


def study(count: int = 32, workers: int | None = None) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """How far each point is above the platform's mean height [m], and the indices ``S1``, ``ST`` of it.

    count: a power of two; there are 10 points for each of them.
    """
    points = sobol.sample(PROBLEM, count, calc_second_order=False, seed=1)
    vary = {name: points[:, k] for k, name in enumerate(UNKNOWNS)}
    keep = ["platform.position.final"]
    found = fc.sweep(SCENE, vary, keep, combine="list", set=SET, workers=workers)
    height = found["platform.position.final"].sel(axis="z").values
    error = height - height.mean()
    return error, indices.analyze(PROBLEM, error, calc_second_order=False, seed=1)


def figure(found: dict[str, np.ndarray], target: Path) -> None:
    """Bars of both indices, with their 95 % intervals."""
    from matplotlib.figure import Figure

    made = Figure(figsize=(7.2, 3.6), layout="constrained")
    ax, rows = made.subplots(), np.arange(len(UNKNOWNS))
    for shift, key, words in ((-0.2, "S1", "alone"), (0.2, "ST", "with others")):
        ax.barh(rows + shift, found[key], 0.36, xerr=found[f"{key}_conf"], label=words, error_kw={"lw": 0.8})
    ax.set_yticks(rows, list(UNKNOWNS))
    ax.invert_yaxis()
    ax.set_xlabel("share of the variance of the platform's height")
    ax.legend(frameon=False)
    made.savefig(target, dpi=150, metadata={"Software": None})


if __name__ == "__main__":
    _, shares = study()
    figure(shares, Path("sensitivity.png"))
    for name, alone, whole in zip(UNKNOWNS, shares["S1"], shares["ST"], strict=True):
        print(f"{name:28} {alone:6.2f} {whole:6.2f}")
