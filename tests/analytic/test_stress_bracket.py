"""Stresses of the gallery's bracket: against a direct solution by scikit-fem, and the same wherever it is turned."""

import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import skfem

from flexclear import dynamics
from flexclear.numerics.rotations import rotation_vector_to_matrix, von_mises
from flexclear.scene.load import edited, load_scene
from flexclear.scene.schema import Scene
from flexclear.system.progress import silent
from tests.analytic.mechanism_runs import TREE, bundles
from tests.analytic.solid_models import build
from tests.analytic.test_stress_solid import by_scikit_fem, everywhere, nodes_of

MATERIAL = {"density": 2700.0, "youngs_modulus": 70e9, "poisson": 0.33}
G = 9.81


def bracket(**changes: Any) -> Scene:
    return edited(load_scene(TREE / "scenes" / "gallery" / "bracket.toml"), {"output.stress": ["bracket"], **changes})


def weight(_: Any, basis: skfem.Basis) -> np.ndarray:
    return skfem.LinearForm(lambda v, w: -MATERIAL["density"] * G * v[1]).assemble(basis)


def test_the_bracket_under_its_weight_has_the_stress_of_scikit_fem(tmp_path: Path) -> None:
    """With a tip whose frame is the mean of its nodes, which stiffens nothing.

    The run has the levers of the deformed part: it deflects by 1e-6 of its size.
    """
    folder = TREE / "meshes" / "gallery"
    recipe = (folder / "bracket.toml").read_text().replace('"bracket.msh"', f'"{(folder / "bracket.msh").as_posix()}"')
    head, tip = recipe.split("[frames.tip]")
    (tmp_path / "bracket.toml").write_text(f"{head}[frames.tip]{tip.replace('rigid', 'mean')}")
    # nothing moves, so that the energies that are exchanged are rounding
    still = {
        "start": {"at": "equilibrium"},
        "time.end": 1e-4,
        "output.interval": 1e-5,
        "solver": {"ledger_tolerance": 10.0},
    }
    mine = {"body.bracket.mesh": str(tmp_path / "bracket.toml"), "joint.pin.type": "fixed"}
    scene = bracket(**mine, **still)
    made = bundles(scene)
    run = dynamics.simulate(scene, made, silent)
    mesh = build(tomllib.loads((tmp_path / "bracket.toml").read_text()), tmp_path)
    theirs = by_scikit_fem(mesh, MATERIAL, lambda x: np.abs(x[1] - 0.12) < 1e-9, weight)
    shown, scale = nodes_of(mesh, made["bracket"]), np.abs(theirs).max()
    clear = made["bracket"]["node_doubtful"].values == 0
    off = np.abs(everywhere(made["bracket"], run, 0) - theirs[shown]).max(axis=1) / scale
    # measured 5e-8
    assert off.max() < 1e-6
    assert run["von_mises_stress"].sel(gauge="bracket").values[0] == pytest.approx(
        von_mises(theirs[shown])[clear].max(), rel=1e-6
    )


def test_the_stress_of_a_swinging_bracket_does_not_know_where_it_is_turned() -> None:
    """Ground, pose and weight turned by one rotation: the same motion, and the same invariants of stress."""
    short = {"time.end": 0.02, "solver": {"rtol": 1e-11}}
    scene = bracket(**short)
    made = bundles(scene)
    upright = dynamics.simulate(scene, made, silent)
    centre = (made["bracket"]["first_moment"] / made["bracket"]["mass"]).values
    vector = [0.7, -1.9, 0.4]
    R = rotation_vector_to_matrix(np.array(vector))
    turned = {
        "body.ground.frames.pin": {"rotation_vector": vector},
        "body.bracket.pose": {
            "position": (R @ (upright["position"].values[0, 0] - centre)).tolist(),
            "rotation_vector": vector,
        },
        "load.gravity.acceleration": (R @ [0.0, -G, 0.0]).tolist(),
    }
    oblique = dynamics.simulate(bracket(**short, **turned), made, silent)
    for name in ("von_mises_stress", "first_principal_stress", "third_principal_stress"):
        one, other = (run[name].sel(gauge="bracket").values for run in (upright, oblique))
        # what rows between steps have of the integration; measured 4e-9
        assert np.abs(one - other).max() < 1e-5 * np.abs(one).max()
