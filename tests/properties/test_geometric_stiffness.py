"""Second-order motion of beams: forms of the bundle against direct integration, and what loads on their ends do."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from flexclear.dynamics import analyses
from flexclear.numerics.rotations import skew
from flexclear.scene.schema import Scene
from flexclear.scene.toml_files import read_toml
from flexclear.structure.fe import beam as beams
from flexclear.structure.fe.section import POINTS
from flexclear.structure.fe.slices import fields_at_points, section_motion
from flexclear.structure.kinds import kind
from flexclear.structure.modes import bundle
from flexclear.structure.modes.solution import solve
from tests.analytic.mechanism_runs import TREE
from tests.properties.mechanisms import ground, joint, rigid, scene

RECIPE = TREE / "meshes" / "checks" / "slender_beam.toml"
AXIS = np.array([1.0, 0.0, 0.0])


@dataclass(frozen=True)
class Reduced:
    mesh: xr.Dataset
    modes: xr.Dataset
    bundle: xr.Dataset


def reduce(reference: str, count: int | None, interfaces: tuple[str, ...] | None = None, **recipe: object) -> Reduced:
    """A beam's bundle; `recipe` replaces whole parts of the recipe."""
    grid = kind.build({**read_toml(Path(RECIPE)), **recipe})
    modes = solve(grid, reference, count, interfaces=interfaces)
    return Reduced(grid, modes, bundle.build(grid, modes, stiffening=True))


def second_order(reduced: Reduced, q: np.ndarray, x0: float, steps: int) -> tuple[np.ndarray, ...]:
    """Middles of equal steps; there, second-order displacement and rotation matrix; displacement at their ends.

    The section turns by its tilt and then by its twist about the tilted axis; the position follows the tilted axis from
    x0, so that shear and stretch stay those of the linear fields: u2' = b x (b x e) / 2 + b x strain, less what twist
    shortens the fibres by, r^2 phi'^2 / 4 on average over a round section.
    """
    beam, vector = beams.assemble(reduced.mesh), (reduced.modes["vector"].values @ q)[:, None]

    def strains(*fields: object) -> tuple[object, ...]:
        found, (_, v, w) = beam.kinematics.strains(*fields), beam.kinematics.section(*fields)[0]
        return found["stretch"], v.grad[0], w.grad[0], found["twist"], -1.0 * found["bend_w"], found["bend_v"]

    # polynomials of a cell have degree three at most: its five Gauss points carry them
    s = (np.arange(steps) + 0.5) / steps
    carry = np.vander(s, 5) @ np.linalg.inv(np.vander(POINTS, 5))
    shape = (*beam.basis.dx.shape, 6)
    at_points = [(part @ vector).reshape(shape) for part in (section_motion(beam), fields_at_points(beam, strains))]
    section, strain = (np.einsum("sp,cpk->csk", carry, part).reshape(-1, 6) for part in at_points)
    x = np.linspace(0.0, 1.0, len(section), endpoint=False) + 0.5 / len(section)
    theta, curvature = section[:, 3:], strain[:, 3:]
    stretched = strain[:, :3] - np.cross(theta, AXIS)

    def integral(rate: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """From x0, by the midpoint rule: at the middles and at the ends of the steps."""
        edges = np.concatenate([np.zeros((1, 3)), np.cumsum(rate, axis=0)]) / len(x)
        edges -= edges[round(x0 * len(x))]
        return 0.5 * (edges[1:] + edges[:-1]), edges

    tilt = theta * (1.0 - AXIS)
    rate = 0.5 * np.cross(tilt, np.cross(tilt, AXIS)) + np.cross(tilt, stretched)
    rate -= np.outer(0.25 * 4e-6 * curvature[:, 0] ** 2, AXIS)
    moved, moved_ends = integral(rate)
    return x, moved, 0.5 * skew(theta) @ skew(theta) + skew(twist_of_tilt(theta)), moved_ends


def twist_of_tilt(theta: np.ndarray) -> np.ndarray:
    """Second-order rotation vectors of a tilt followed by a twist about the tilted axis (Baker-Campbell-Hausdorff)."""
    return 0.5 * theta[..., :1] * np.cross(theta, AXIS)


@pytest.mark.parametrize("theory", ["rayleigh", "timoshenko"])
@pytest.mark.parametrize("first", ["root", "middle", "tip"])
def test_forms_are_integrals_of_the_motion_that_keeps_the_strains_linear(first: str, theory: str) -> None:
    """Work of the loads' internal forces on the strains, against displacements integrated along the rod."""
    frames = {"root": {"x": 0.0}, "middle": {"x": 0.25}, "tip": {"x": 1.0}}
    other = "tip" if first != "tip" else "root"
    reduced = reduce("free-free", None, (first, other), elements=4, frames=frames, theory=theory)
    q, steps = np.random.default_rng(5).normal(size=reduced.bundle.sizes["mode"]), 4000
    x, u, turned, at_ends = second_order(reduced, q, frames[first]["x"], steps)
    line, width = 7850.0 * np.pi * 4e-6, 1.0 / len(x)
    spread = line * 1e-6 * np.diag([0.0, 1.0, 1.0])
    # midpoint sums over 4000 parts per element: 1 / (24 * 4000^2) of the curvature of the sums
    near = 2e-6

    def close(form: np.ndarray, integral: np.ndarray, size: float) -> None:
        assert np.allclose(form, form.swapaxes(-1, -2), rtol=0.0, atol=1e-12 * np.abs(form).max())
        assert 0.5 * np.einsum("...ij,i,j->...", form, q, q) == pytest.approx(integral, rel=near, abs=near * size)

    total = line * width * u.sum(axis=0)
    close(reduced.bundle["second_order_first_moment"].values, total, np.abs(total).max())
    moment = np.zeros((3, 3))
    moment[0] = line * width * x @ u
    moment += width * np.einsum("km,slm->kl", spread, turned)
    close(reduced.bundle["second_order_moment"].values, moment, np.abs(moment).max())
    for name, part in frames.items():
        turned_end = twist_of_tilt(reduced.bundle["frame_rotation_shape"].sel(frame=name).values @ q)
        for motion_of, value in (("translation", at_ends[round(part["x"] * len(x))]), ("rotation", turned_end)):
            form = reduced.bundle[f"frame_second_{motion_of}"].sel(frame=name).values
            close(form, value, max(np.abs(at_ends).max(), np.abs(value).max()))


def test_stretching_alone_moves_nothing_to_second_order() -> None:
    reduced = reduce("craig-bampton", 20)
    axial = reduced.modes["kind"].values == "axial"
    assert axial.any()
    for name in ("second_order_first_moment", "second_order_moment", "frame_second_translation"):
        form = reduced.bundle[name].values
        # bending that the eigensolver's rounding left in these modes
        assert np.abs(form[..., axial, :][..., axial]).max() < 1e-10 * np.abs(form).max()


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
