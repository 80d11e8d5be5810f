"""What a flexible mechanism tends to: rigid ones as it stiffens, one answer as its basis completes."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from pipeline import dynamics
from pipeline.core.scene.load import load_scene, read_toml
from pipeline.structure.fe import mesh
from pipeline.structure.modes import bundle, solve
from tests.analytic.mechanism_runs import TREE

END = 0.01


@cache
def stroke(
    scene: str, modes: tuple[tuple[str, object], ...] = (), stiffer: float = 1.0, elements: int = 12
) -> xr.Dataset:
    """The first 10 ms of the mechanism's stroke; rod 1 with other modes or elements, E times a factor."""
    overrides = {"time.end": END, "output.interval": 5e-4, **{f"body.rod1.modes.{k}": v for k, v in modes}}
    loaded = load_scene(TREE / "scenes" / f"{scene}.toml", overrides)
    bundles = {}
    for name, body in loaded.flexible().items():
        recipe = read_toml(Path(body.mesh))
        recipe["material"]["youngs_modulus"] *= stiffer
        grid = mesh.build({**recipe, "elements": elements})
        shapes = solve(grid, body.modes.reference, body.modes.count, interfaces=body.modes.interfaces)
        bundles[name] = bundle.build(grid, shapes)
    return dynamics.simulate(loaded, bundles, lambda share, text: None)


def platform(found: xr.Dataset) -> np.ndarray:
    return found.position.sel(body="platform").values


@pytest.mark.slow
def test_a_rod_of_growing_stiffness_becomes_rigid_as_one_over_e() -> None:
    """Displacements under given loads go as 1/E, and so do the vibrations that the drive's start excites."""
    rigid = platform(stroke("sps4/ideal"))
    factors = np.array([4.0, 16.0, 64.0, 256.0])
    away = [np.abs(platform(stroke("sps4/far_cb", stiffer=f)) - rigid).max() for f in factors]
    # sampled vibrations of other frequencies: their largest values scatter by some per cent
    assert np.polyfit(np.log(factors), np.log(away), 1)[0] == pytest.approx(-1.0, abs=0.03)
    assert away[-1] < 1e-8


#: two elements and one node between them give all 12 elastic coordinates; other frames of reference, same space
COMPLETE = {
    "held below": (("reference", "craig-bampton"), ("count", 12)),
    "held above": (("reference", "craig-bampton"), ("count", 12), ("interfaces", ("top", "bottom"))),
    "free": (("reference", "free-free"), ("count", 12)),
}


@pytest.mark.slow
@pytest.mark.parametrize("one, other", [("held below", "held above"), ("held below", "free")])
def test_complete_sets_of_two_reference_conditions_move_the_mechanism_alike(one: str, other: str) -> None:
    first, second = (platform(stroke("sps4/far_cb", COMPLETE[name], elements=2)) for name in (one, other))
    moved = np.abs(first - first[0]).max()
    deformed = np.abs(first - platform(stroke("sps4/ideal"))).max()
    assert deformed > 1e-6 * moved  # there is something to agree about
    # linear shapes in two frames differ by the foreshortening, which is of second order in the deformation
    assert second == pytest.approx(first, abs=1e-6 * moved)
