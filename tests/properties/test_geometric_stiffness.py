"""The shortening of a bent beam: forms of the bundle against direct integration, and what loads on its ends do."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from flexclear.dynamics import analyses
from flexclear.scene.load import read_toml
from flexclear.scene.schema import Scene
from flexclear.structure.kinds import kind
from flexclear.structure.modes import bundle
from flexclear.structure.modes.geometric_stiffness import variables
from flexclear.structure.modes.solution import solve
from tests.analytic.mechanism_runs import TREE
from tests.properties.mechanisms import ground, joint, rigid, scene

RECIPE = TREE / "meshes" / "checks" / "slender_beam.toml"


@dataclass(frozen=True)
class Reduced:
    mesh: xr.Dataset
    modes: xr.Dataset
    bundle: xr.Dataset


def reduce(reference: str, count: int | None, interfaces: tuple[str, ...] | None = None, **recipe: object) -> Reduced:
    """A beam's bundle; `recipe` replaces whole parts of the recipe."""
    grid = kind.build({**read_toml(Path(RECIPE)), **recipe})
    modes = solve(grid, reference, count, interfaces=interfaces)
    return Reduced(grid, modes, bundle.build(grid, modes, variables(grid, modes)))


def slopes_squared(reduced: Reduced, q: np.ndarray, points: int) -> tuple[np.ndarray, np.ndarray]:
    """Places and v'^2 + w'^2 of cubic elements, at the middles of `points` parts of each element."""
    x = reduced.mesh["node_position"].values[:, 0]
    d = (reduced.modes["vector"].values @ q).reshape(-1, 6)
    s = (np.arange(points) + 0.5) / points
    at, total = [], []
    for i in range(len(x) - 1):
        h = x[i + 1] - x[i]
        ends = np.array([-6 * s + 6 * s**2, h * (1 - 4 * s + 3 * s**2), 6 * s - 6 * s**2, h * (3 * s**2 - 2 * s)]) / h
        v = np.array([d[i, 1], d[i, 5], d[i + 1, 1], d[i + 1, 5]]) @ ends
        w = np.array([d[i, 2], -d[i, 4], d[i + 1, 2], -d[i + 1, 4]]) @ ends
        at.append(x[i] + h * s)
        total.append(v**2 + w**2)
    return np.concatenate(at), np.concatenate(total)


@pytest.mark.parametrize("first", ["root", "middle", "tip"])
@pytest.mark.parametrize("reference", ["craig-bampton", "free-free"])
def test_forms_are_what_the_shortened_axis_integrates_to(reference: str, first: str) -> None:
    """Brute force: running sums of slopes, then of places, with the origin of the way at the first interface."""
    frames = {"root": {"x": 0.0}, "middle": {"x": 0.25}, "tip": {"x": 1.0}}
    other = "tip" if first != "tip" else "root"
    reduced = reduce(reference, None, (first, other), elements=4, frames=frames)
    q = np.random.default_rng(5).normal(size=reduced.bundle.sizes["mode"])
    points = 4000
    x, squares = slopes_squared(reduced, q, points)
    width = 1.0 / len(x)
    way = -width * (np.cumsum(squares) - 0.5 * squares)
    edges = np.concatenate([[0.0], -width * np.cumsum(squares)])
    at = {name: edges[round(part["x"] / width)] for name, part in frames.items()}
    way = way - at[first]
    line = 7850.0 * np.pi * 4e-6
    # midpoint sums over 4000 parts per element: 1 / (24 * 4000^2) of the curvature of the squares
    near = 1e-6
    for name, weight in (("first", line), ("second", line * x)):
        form = reduced.bundle[f"shortening_{name}_moment"].values
        assert q @ form @ q == pytest.approx(np.sum(weight * way) * width, rel=near)
        assert np.array_equal(form, form.T)
    for name in frames:
        form = reduced.bundle["frame_shortening"].sel(frame=name).values
        assert q @ form @ q == pytest.approx(at[name] - at[first], rel=near, abs=1e-12)


def test_stretching_and_twisting_shorten_nothing() -> None:
    """Not at all where they are pure; modes have bending in them that the eigensolver's rounding left there."""
    reduced = reduce("craig-bampton", 20)
    plain = np.isin(reduced.modes["kind"].values, ["axial", "torsion"])
    assert plain.any()
    vectors = reduced.modes["vector"]
    bends = np.isin(np.arange(len(vectors)) % 6, [1, 2, 4, 5])
    pure = vectors.values.copy()
    pure[np.ix_(bends, plain)] = 0.0
    exact = variables(reduced.mesh, reduced.modes.assign(vector=(vectors.dims, pure)))
    # the axial mode is 0.7 % above a bending one: eps times the largest eigenvalue of the mesh, 25 times theirs, over
    # their gap is 4e-13; some two hundred times that
    rounding = 1e-10
    for name in ("shortening_first_moment", "shortening_second_moment", "frame_shortening"):
        assert np.abs(exact[name][1][..., ~plain, :]).max() > 0.0
        assert not exact[name][1][..., plain, :].any()
        form = reduced.bundle[name].values
        assert np.abs(form[..., plain, :]).max() < rounding * np.abs(form).max()


#: all bending of the mast in both planes, and some of its stretching and twisting
USUAL: dict[str, object] = {"reference": "craig-bampton", "count": 24}


def mast(tmp_path: Path, mass: float, modes: dict[str, object] = USUAL, elements: int = 16) -> xr.Dataset:
    """A light upright beam with a point mass on its top; a negative mass means that it hangs."""
    light = {"density": 1.0, "youngs_modulus": 200e9, "poisson": 0.3}
    (tmp_path / "mast.toml").write_text(RECIPE.read_text().replace('"7850 kg/m^3"', "1.0"))
    bodies = {
        "ground": ground(axle=(0.0, 0.0, 0.0)),
        "hub": rigid(1.0, 1.0, {"axle": {}, "seat": {}}),
        "beam": {"type": "flexible", "mesh": str(tmp_path / "mast.toml"), "modes": modes, "stiffening": {}},
        "head": rigid(abs(mass), 0.0, {"seat": {}}),
    }
    joints = {
        "axle": joint("revolute", "ground.axle", "hub.axle"),
        "seat": joint("fixed", "hub.seat", "beam.root"),
        "head": joint("fixed", "beam.tip", "head.seat"),
    }
    up = -9.81 if mass > 0.0 else 9.81
    load = {"gravity": {"type": "gravity", "acceleration": [0.0, 0.0, up]}}
    drive = {"axle": {"joint": "axle", "law": {"type": "constant"}}}
    made = Scene.model_validate(scene(bodies, joints, end=1.0, load=load, drive=drive))
    kept = made.flexible()["beam"].modes
    reduced = reduce(kept.reference, kept.count, kept.interfaces, material=light, elements=elements)
    return analyses.frequencies(made, {"beam": reduced.bundle}, lambda fraction, text: None)


STIFFNESS = 200e9 * np.pi * 1.6e-11 / 4.0  #: E I [N m^2]
CRITICAL = STIFFNESS * np.pi**2 / 4.0  #: Euler's load of the clamped-free column of 1 m [N]


def side_stiffness(load: float) -> float:
    """Force per deflection at the top of a clamped column that carries a dead load (negative: a pull) [N/m]."""
    k = np.sqrt(abs(load) / STIFFNESS)
    return load / (np.tan(k) / k - 1.0) if load > 0.0 else -load / (1.0 - np.tanh(k) / k)


@pytest.mark.parametrize("fraction", [-5.0, -0.5, 0.3, 0.9])
def test_a_load_on_its_top_softens_a_mast_and_a_pull_stiffens_it(tmp_path: Path, fraction: float) -> None:
    """Beam-column theory, exact for a massless column: the load acts through the frame at its end alone."""
    mass = fraction * CRITICAL / 9.81
    found = mast(tmp_path, mass)
    omega = 2.0 * np.pi * found.frequency.values[:2]
    # the column's own 1.3e-5 kg move with a quarter of their mass and press with a third of their weight
    near = 13e-6 / abs(mass) / (1.0 - max(fraction, 0.0)) + 1e-5
    assert omega == pytest.approx([np.sqrt(side_stiffness(fraction * CRITICAL) / abs(mass))] * 2, rel=near)


def test_a_mast_buckles_under_eulers_load(tmp_path: Path) -> None:
    below, above = (mast(tmp_path, fraction * CRITICAL / 9.81) for fraction in (0.9999, 1.0001))
    assert below.decay_rate.min() == 0.0
    assert above.decay_rate.min() < 0.0


@pytest.mark.parametrize(
    "modes",
    [
        {"reference": "craig-bampton", "count": 12, "interfaces": ["tip", "root"]},
        {"reference": "free-free", "count": 12},
        {"reference": "craig-bampton", "count": 12, "interfaces": ["root"]},
    ],
    ids=["held at its top", "free-free", "cantilever"],
)
def test_where_the_body_frame_is_held_does_not_matter(tmp_path: Path, modes: dict[str, object]) -> None:
    """Another origin of the shortening is another frame for the same motion."""
    mass = 0.5 * CRITICAL / 9.81
    usual, other = (mast(tmp_path, mass, kept, elements=2) for kept in (USUAL | {"count": 12}, modes))
    # two elements have 12 elastic coordinates, so all sets are complete; the fastest is 1e6 times the first
    assert other.frequency.values[:2] == pytest.approx(usual.frequency.values[:2], rel=1e-5)
